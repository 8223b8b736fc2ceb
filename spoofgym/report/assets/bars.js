// Horizontal bars with intervals, beside lines for optima and bounds; points where the axis is logarithmic.
"use strict";

(() => {
  const SHAPES = ["circle", "square", "diamond", "triangle", "down", "back"];

  /** Groups in the order in which they come, with a colour and a mark each. */
  function groupsOf(figure) {
    const names = [...new Set(figure.bars.map((bar) => bar.group))];
    const coloured = names.filter((name) => name !== "baseline");
    const look = (name) => ({
      colour: name === "baseline" ? page.colour("baseline") : page.seriesColour(coloured.indexOf(name)),
      shape: figure.logarithmic ? SHAPES[names.indexOf(name) % SHAPES.length] : "square",
    });
    return new Map(names.map((name) => [name, look(name)]));
  }

  function span(figure) {
    const ends = figure.bars.flatMap((bar) => [bar.value, bar.low, bar.high]).concat(figure.marks.map((mark) => mark.value));
    const known = ends.filter((value) => value !== null);
    if (figure.logarithmic) {
      const positive = known.filter((value) => value > 0);
      return positive.length ? [0.85 * Math.min(...positive), 1.15 * Math.max(...positive)] : [0.1, 1];
    }
    const low = Math.min(0, ...known);
    const high = Math.max(0, ...known);
    const room = 0.04 * (high - low || 1);
    return [low < 0 ? low - room : 0, high > 0 ? high + room : room];
  }

  const written = (bar) => [page.withInterval(bar.value, bar.low, bar.high), bar.note].filter(Boolean).join(", ");

  /** Width of a text at 12 pixels, about. */
  const reach = (text) => 6.6 * text.length;

  function draw(node, figure) {
    const width = page.width(node);
    const narrow = width < 640;
    const labels = narrow ? 0 : Math.min(Math.max(...figure.bars.map((bar) => reach(bar.label))) + 10, 0.38 * width);
    const noted = figure.bars.some((bar) => bar.note || (narrow && reach(`${bar.label}: ${written(bar)}`) > width));
    const row = narrow ? (noted ? 60 : 46) : 27;
    const head = 18 * figure.marks.length + 6;
    const bottom = head + row * figure.bars.length;
    const values = narrow ? 8 : Math.min(Math.max(...figure.bars.map((bar) => reach(written(bar)))) + 14, 0.34 * width);
    const make = figure.logarithmic ? page.logarithmic : page.linear;
    const scale = make(span(figure), [labels + 4, width - values]);
    const groups = groupsOf(figure);
    const drawing = page.drawing(width, bottom + 24, figure.title);
    for (const tick of scale.ticks(Math.max(3, Math.floor((width - labels - values) / 80)))) {
      drawing.append(page.svg("line", { x1: scale(tick), x2: scale(tick), y1: head, y2: bottom, class: "grid" }));
      drawing.append(page.svg("text", { x: scale(tick), y: bottom + 16, "text-anchor": "middle", class: "muted" }, page.number(tick)));
    }
    const [bases, marks, tops] = [page.svg("g"), page.svg("g"), page.svg("g")];
    drawing.append(bases, marks, tops);
    figure.bars.forEach((bar, place) => drawBar({ bases, tops }, figure, bar, { scale, groups, labels, narrow, width, middle: head + row * place + (narrow ? row - 14 : row / 2), noted }));
    figure.marks.forEach((mark, place) => {
      const x = scale(mark.value);
      marks.append(page.svg("line", { x1: x, x2: x, y1: head - 4, y2: bottom, stroke: page.colour("bound"), "stroke-width": 1.5, "stroke-dasharray": page.dashes[(place + 1) % 4].join(" ") }));
      const text = `${mark.label} ${page.number(mark.value)}`;
      const end = x > width / 2;
      marks.append(page.svg("text", { x: x + (end ? -5 : 5), y: 14 + 18 * place, "text-anchor": end ? "end" : "start", style: `fill:${page.colour("bound")}` }, text));
      marks.append(page.svg("line", { x1: x, x2: x, y1: 4 + 18 * place, y2: head, stroke: page.colour("bound"), "stroke-width": 1 }));
    });
    const legend = [...groups].filter(([name]) => name).map(([name, { colour, shape }]) => ({ name, colour, shape }));
    node.replaceChildren(...(legend.length > 1 ? [page.legend(legend)] : []), drawing, page.element("div", { class: "unit" }, figure.unit));
  }

  function drawBar({ bases, tops }, figure, bar, { scale, groups, labels, narrow, width, middle, noted }) {
    const { colour, shape } = groups.get(bar.group);
    const [least] = span(figure);
    const above = noted ? 28 : 14;
    const named = narrow && !noted ? `${bar.label}: ${written(bar)}` : bar.label;
    const place = narrow ? { x: 2, y: middle - above, class: "halo" } : { x: labels - 4, y: middle + 4, "text-anchor": "end" };
    const label = page.svg("text", place, cut(named, narrow ? width : labels));
    label.append(page.svg("title", {}, `${bar.label}: ${written(bar)}`));
    tops.append(label);
    if (narrow && noted) tops.append(page.svg("text", { x: 2, y: middle - 14, class: "muted halo" }, cut(written(bar), width)));
    if (bar.value === null) {
      if (!narrow) tops.append(page.svg("text", { x: labels + 8, y: middle + 4, class: "muted" }, bar.note || "–"));
      return;
    }
    const x = scale(bar.value);
    const zero = scale(figure.logarithmic ? least : Math.max(0, least));
    if (!figure.logarithmic) {
      bases.append(page.svg("rect", { x: Math.min(zero, x), y: middle - 8, width: Math.max(Math.abs(x - zero), 1), height: 16, fill: colour }));
    }
    if (bar.low !== null && bar.high !== null) {
      const ends = [scale(Math.max(bar.low, figure.logarithmic ? least : -Infinity)), scale(bar.high)];
      const d = `M${ends[0]} ${middle - 5}V${middle + 5}M${ends[0]} ${middle}H${ends[1]}M${ends[1]} ${middle - 5}V${middle + 5}`;
      tops.append(page.svg("path", { d, stroke: page.colour("ink"), "stroke-width": 1.5, fill: "none" }));
    }
    if (figure.logarithmic) tops.append(page.mark(shape, x, middle, 4, colour));
    if (!narrow) tops.append(page.svg("text", { class: "halo", x: Math.max(x, bar.high === null ? x : scale(bar.high), zero) + 8, y: middle + 4 }, written(bar)));
  }

  /** A text that fits into so many pixels. */
  function cut(text, pixels) {
    const most = Math.max(Math.floor(pixels / 6.4), 8);
    return text.length > most ? `${text.slice(0, most - 1)}…` : text;
  }
  page.cut = cut;

  page.figures.bars = (node, figure) => {
    const redraw = () => draw(node, figure);
    redraw();
    page.onResize(node, redraw);
    page.onTheme(redraw);
    return () => ({
      columns: ["name", "group", figure.unit, "interval from", "interval to", "note"],
      rows: [
        ...figure.bars.map((bar) => [bar.label, bar.group, bar.value, bar.low, bar.high, bar.note]),
        ...figure.marks.map((mark) => [mark.label, "line", mark.value, null, null, ""]),
      ],
    });
  };
})();
