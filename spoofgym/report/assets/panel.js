// A panel of time series on uPlot: the events of a game behind it, its playhead, and a legend that tells the values there.
"use strict";

(() => {
  const AXIS = 66; // pixels of the vertical axis: the same in all panels, so that their times stand below each other

  /** What all panels of a page have in common for uPlot. */
  page.plotOptions = (width, height, { xLabel = null, xRange, scale, values = null, splits = null, whole = false }) => {
    const font = "12px system-ui, -apple-system, Segoe UI, Roboto, Arial, sans-serif";
    const line = { stroke: page.colour("grid"), width: 1 };
    const shared = { stroke: page.colour("muted"), font, grid: line, ticks: { ...line, size: 4 } };
    return {
      width,
      height,
      padding: [8, 10, 0, 0],
      legend: { show: false },
      cursor: { x: true, y: false, drag: { x: false, y: false }, points: { show: false } },
      scales: { x: { time: false, range: xRange }, y: scale },
      axes: [
        { ...shared, size: 26, label: xLabel, labelFont: font, labelSize: 18, labelGap: 0, space: 60, ...(whole ? { incrs: [1, 2, 5, 10, 20, 50, 100] } : {}) },
        { ...shared, size: AXIS, space: 26, values: values || ((_, marks) => marks.map((mark) => (mark === null ? "" : page.number(mark)))), ...(splits ? { splits } : {}) },
      ],
      series: [{}],
      hooks: {},
    };
  };

  /** A line of a panel as uPlot takes it. */
  page.plotSeries = ({ colour, dash = [], width = 2 }) => ({ stroke: colour, width, dash, spanGaps: false, points: { show: false } });

  /** Draws lines across the canvas of a plot at values of its scales. */
  page.plotRule = (plot, axis, value, colour, dash, width = 1) => {
    const place = plot.valToPos(value, axis, true);
    const { left, top, width: across, height: down } = plot.bbox;
    const draw = plot.ctx;
    draw.save();
    draw.beginPath();
    draw.strokeStyle = colour;
    draw.lineWidth = width * devicePixelRatio;
    draw.setLineDash(dash.map((part) => part * devicePixelRatio));
    if (axis === "x") {
      draw.moveTo(place, top);
      draw.lineTo(place, top + down);
    } else {
      draw.moveTo(left, place);
      draw.lineTo(left + across, place);
    }
    draw.stroke();
    draw.restore();
  };

  /** Stretches of epochs at which a flag is set, as [first, last]. */
  page.stretches = (flags) => {
    const found = [];
    flags.forEach((flag, index) => {
      if (!flag) return;
      if (index > 0 && flags[index - 1]) found[found.length - 1][1] = index;
      else found.push([index, index]);
    });
    return found;
  };

  function drawAttack(plot, game) {
    const half = (game.time[1] - game.time[0] || 1) / 2;
    plot.ctx.save();
    plot.ctx.globalAlpha = 0.1;
    plot.ctx.fillStyle = page.colour("spoofed");
    for (const [first, last] of page.stretches(game.attacked)) {
      const from = Math.max(plot.valToPos(game.time[first] - half, "x", true), plot.bbox.left);
      const to = Math.min(plot.valToPos(game.time[last] + half, "x", true), plot.bbox.left + plot.bbox.width);
      plot.ctx.fillRect(from, plot.bbox.top, to - from, plot.bbox.height);
    }
    plot.ctx.restore();
  }

  /** The lines of the events, with their marks at the top; those of one epoch stand below each other. */
  function drawEvents(plot, game, marked) {
    const { ctx, bbox } = plot;
    const size = 11 * devicePixelRatio;
    game.firsts.forEach((event, place) => {
      const { dash, glyph } = page.eventKinds[event.kind];
      page.plotRule(plot, "x", game.time[event.epoch], page.colour("event"), dash, 1);
      if (!marked) return;
      const above = game.firsts.slice(0, place).filter((other) => other.epoch === event.epoch).length;
      ctx.save();
      ctx.font = `${size}px system-ui, sans-serif`;
      ctx.fillStyle = page.colour("event");
      [ctx.textBaseline, ctx.textAlign] = ["top", "left"];
      ctx.fillText(glyph, plot.valToPos(game.time[event.epoch], "x", true) + 3 * devicePixelRatio, bbox.top + (2 * devicePixelRatio + size) * above);
      ctx.restore();
    });
  }

  /** Makes a panel; it redraws itself when its width or the theme changes. */
  page.panel = (state, options) => {
    const { game } = state;
    const plotNode = page.element("div", { class: "plot" });
    const head = page.element("div", { class: "playhead" });
    const legend = page.element("ul", { class: "legend" });
    const node = page.element("div", { class: "panel", role: "group", "aria-label": options.title }, page.element("h4", {}, options.title), legend, plotNode);
    let plot = null;
    let told = [];

    function draw() {
      if (plot) plot.destroy();
      const series = options.series();
      const made = page.plotOptions(page.width(plotNode), options.height, { xLabel: options.last ? "time, s" : null, xRange: game.span, scale: options.scale(series), values: options.values, splits: options.splits });
      made.series.push(...series.map(page.plotSeries));
      made.hooks.drawClear = [(present) => drawAttack(present, game)];
      made.hooks.draw = [
        (present) => {
          for (const rule of options.rules || []) page.plotRule(present, "y", rule.value, page.colour(rule.colour), rule.dash, 1.5);
          drawEvents(present, game, !options.last); // the rows of the last panel would hide the marks
          if (options.draw) options.draw(present);
          if (present === plot) move(state.index); // the scales are known now
        },
      ];
      plot = new uPlot(made, [game.time, ...series.map((each) => each.values)], plotNode);
      plot.over.append(head);
      listen(plot.over);
      told = series.filter((each) => each.name).map((each) => ({ ...each, value: page.element("span", { class: "value" }) }));
      legend.replaceChildren(...told.map((each) => page.element("li", {}, page.sample(each), page.element("span", {}, each.name), each.value)));
      move(state.index);
    }

    function listen(over) {
      const go = (event) => state.go(plot.posToIdx(event.clientX - over.getBoundingClientRect().left));
      over.addEventListener("pointerdown", (event) => {
        go(event);
        state.focus(); // so that the keys go on from there
      });
      over.addEventListener("pointermove", (event) => {
        if (event.buttons === 1) go(event);
      });
    }

    function move(index) {
      if (!plot || !(plot.bbox.width > 0)) return;
      head.style.left = `${plot.valToPos(game.time[index], "x") - 1}px`;
      for (const each of told) each.value.textContent = page.number((each.shown || each.values)[index]);
    }

    state.panels.push({ draw, move, node: plotNode });
    return node;
  };
})();
