// Lines over a common axis on uPlot, each with its interval as a band: learning curves, values per round.
"use strict";

(() => {
  const HEIGHT = 300;
  const FEW = 12; // points at which intervals are drawn one by one
  const faded = (colour) => `${colour}33`;

  function colours(figure) {
    let place = -1;
    return figure.lines.map((line) => {
      if (!line.faint || place < 0) place += line.faint ? 0 : 1;
      return { colour: page.seriesColour(Math.max(place, 0)), dash: line.faint ? [2, 3] : page.seriesDash(Math.max(place, 0)), width: line.faint ? 1 : 2.5 };
    });
  }

  function span(figure) {
    const known = figure.lines.flatMap((line) => [line.y, line.low || [], line.high || []].flat()).filter((value) => value !== null);
    const [low, high] = known.length ? [Math.min(...known), Math.max(...known)] : [0, 1];
    const room = 0.06 * (high - low || Math.abs(high) || 1);
    return [low >= 0 && low < 0.4 * high ? 0 : low - room, high + room];
  }

  /** Intervals at single points, where a band would be hard to read. */
  function drawWhiskers(present, figure, styles) {
    const { ctx } = present;
    ctx.save();
    ctx.lineWidth = 2 * devicePixelRatio;
    figure.lines.forEach((line, place) => {
      if (line.low === null) return;
      ctx.strokeStyle = styles[place].colour;
      figure.x.forEach((x, k) => {
        if (line.low[k] === null || line.high[k] === null) return;
        const across = present.valToPos(x, "x", true) + 5 * place * devicePixelRatio;
        ctx.beginPath();
        ctx.moveTo(across, present.valToPos(line.low[k], "y", true));
        ctx.lineTo(across, present.valToPos(line.high[k], "y", true));
        ctx.stroke();
      });
    });
    ctx.restore();
  }

  page.figures.lines = (node, figure) => {
    const sheet = page.element("div");
    const legend = page.element("div");
    let plot = null;

    function draw() {
      if (plot) plot.destroy();
      const styles = colours(figure);
      const ends = [figure.x[0], figure.x[figure.x.length - 1]];
      const alone = figure.whole ? 0.5 : Math.max(0.5, 0.1 * Math.abs(ends[0]));
      const room = ends[0] === ends[1] ? alone : 0;
      const options = page.plotOptions(page.width(sheet), HEIGHT, { xLabel: figure.x_label, xRange: [ends[0] - room, ends[1] + room], scale: { range: span(figure) }, whole: figure.whole });
      options.axes[0].values = (_, marks) => marks.map((mark) => page.compact(mark));
      const data = [figure.x];
      options.bands = [];
      figure.lines.forEach((line, place) => {
        options.series.push({ ...page.plotSeries(styles[place]), points: { show: figure.x.length < 30, size: 6, fill: styles[place].colour } });
        data.push(line.y);
        if (line.low === null) return;
        for (const edge of [line.high, line.low]) {
          options.series.push(page.plotSeries({ colour: faded(styles[place].colour), width: 1 }));
          data.push(edge);
        }
        options.bands.push({ series: [data.length - 2, data.length - 1], fill: faded(styles[place].colour) });
      });
      if (figure.x.length <= FEW) options.hooks.draw = [(present) => drawWhiskers(present, figure, styles)];
      sheet.replaceChildren();
      plot = new uPlot(options, data, sheet);
      legend.replaceChildren(page.legend(figure.lines.map((line, place) => ({ name: line.name, ...styles[place] }))), page.element("div", { class: "legend" }, figure.y_label));
    }

    node.append(legend, sheet);
    draw();
    page.onResize(sheet, draw);
    page.onTheme(draw);
    return () => ({
      columns: [figure.x_label, ...figure.lines.flatMap((line) => (line.low === null ? [line.name] : [line.name, `${line.name}, from`, `${line.name}, to`]))],
      rows: figure.x.map((x, k) => [x, ...figure.lines.flatMap((line) => (line.low === null ? [line.y[k]] : [line.y[k], line.low[k], line.high[k]]))]),
    });
  };
})();
