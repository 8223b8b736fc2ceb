// ROC and DET curves of many detectors for one attack; the legend leaves curves out, and shows the interval of one.
"use strict";

(() => {
  const FIRST = 6; // curves that are shown at first

  const least = (curves) => Math.min(...curves.flatMap((curve) => curve.x), 0.01);
  const clamp = (value) => Math.min(Math.max(value, 0.0005), 0.9995);

  function axes(drawing, { x, y, width, height, xLabel, yLabel, xTicks, yTicks }) {
    for (const tick of xTicks) {
      drawing.append(page.svg("line", { x1: x(tick), x2: x(tick), y1: 10, y2: height - 44, class: "grid" }));
      drawing.append(page.svg("text", { x: x(tick), y: height - 28, "text-anchor": "middle", class: "muted" }, page.number(tick)));
    }
    for (const tick of yTicks) {
      drawing.append(page.svg("line", { x1: 52, x2: width - 10, y1: y(tick), y2: y(tick), class: "grid" }));
      drawing.append(page.svg("text", { x: 46, y: y(tick) + 4, "text-anchor": "end", class: "muted" }, page.number(tick)));
    }
    drawing.append(page.svg("text", { x: (52 + width - 10) / 2, y: height - 8, "text-anchor": "middle", class: "muted" }, xLabel));
    drawing.append(page.svg("text", { transform: `translate(12 ${(height - 34) / 2}) rotate(-90)`, "text-anchor": "middle", class: "muted" }, yLabel));
  }

  function drawCurves(drawing, curves, x, y, ordinate, lit) {
    for (const { curve, place } of curves) {
      const colour = page.seriesColour(place);
      const points = curve.x.map((value, k) => [x(value), y(ordinate(curve.y[k]))]);
      if (curve.name === lit) {
        const upper = curve.x.map((value, k) => [x(value), y(ordinate(curve.high[k]))]);
        const lower = curve.x.map((value, k) => [x(value), y(ordinate(curve.low[k]))]).reverse();
        drawing.append(page.svg("path", { d: `${page.path([...upper, ...lower])}Z`, fill: colour, opacity: 0.2 }));
      }
      const dash = page.dashes[Math.floor(place / 7 + place) % page.dashes.length];
      const line = page.svg("path", { d: page.path(points), fill: "none", stroke: colour, "stroke-width": curve.name === lit ? 3.5 : 2, "stroke-dasharray": dash.join(" ") });
      line.append(page.svg("title", {}, curve.name));
      drawing.append(line);
      if (points.length === 1) drawing.append(page.mark("circle", points[0][0], points[0][1], 3, colour));
    }
  }

  page.figures.curves = (node, figure) => {
    const choices = [...new Set(figure.curves.map((curve) => curve.choice))];
    const names = [...new Set(figure.curves.map((curve) => curve.name))];
    let chosen = Math.max(choices.indexOf(figure.chosen), 0);
    const hidden = new Set(names.slice(FIRST));
    let lit = null;
    const legend = page.element("ul", { class: "legend" });
    const sheets = [page.element("div"), page.element("div")];
    const pair = page.element("div", { class: "pair" }, ...sheets);

    const shown = () => figure.curves.filter((curve) => curve.choice === choices[chosen] && !hidden.has(curve.name) && curve.x.length).map((curve) => ({ curve, place: names.indexOf(curve.name) }));

    function draw() {
      const curves = shown();
      const chosenCurves = figure.curves.filter((curve) => curve.choice === choices[chosen]);
      const low = least(chosenCurves);
      const high = Math.min(Math.max(0.1, ...chosenCurves.flatMap((curve) => curve.x)), 0.999);
      const kinds = [
        { title: "ROC: detection over false alarms", y: [0, 1], ordinate: (value) => value, label: "detection probability", make: page.linear, x: page.logarithmic, span: [low, high] },
        { title: "DET: misses over false alarms", y: [0.0005, 0.9995], ordinate: (value) => clamp(1 - value), label: "miss probability", make: page.deviate, x: page.deviate, span: [Math.max(low, 0.0001), high] },
      ];
      kinds.forEach((kind, index) => {
        const width = page.width(sheets[index]);
        const height = Math.min(Math.round(0.85 * width), 420);
        const drawing = page.drawing(width, height, `${kind.title}, ${choices[chosen]}`);
        const x = kind.x(kind.span, [52, width - 10]);
        const y = kind.make(kind.y, [height - 44, 10]);
        axes(drawing, { x, y, width, height, xLabel: "false-alarm probability of a game", yLabel: kind.label, xTicks: x.ticks(5), yTicks: y.ticks(5) });
        drawCurves(drawing, curves, x, y, kind.ordinate, lit);
        sheets[index].replaceChildren(page.element("h4", {}, kind.title), drawing);
      });
    }

    function drawLegend() {
      legend.replaceChildren(
        ...names.map((name, place) => {
          const sample = page.sample({ colour: page.seriesColour(place), dash: page.dashes[Math.floor(place / 7 + place) % page.dashes.length] });
          const button = page.element("button", { type: "button", "aria-pressed": String(!hidden.has(name)), click: () => {
            hidden.has(name) ? hidden.delete(name) : hidden.add(name);
            button.setAttribute("aria-pressed", String(!hidden.has(name)));
            draw();
          } }, sample, name);
          const light = (which) => () => {
            if (lit === which) return;
            lit = which;
            draw();
          };
          for (const event of ["pointerenter", "focus"]) button.addEventListener(event, light(name));
          for (const event of ["pointerleave", "blur"]) button.addEventListener(event, light(null));
          return page.element("li", {}, button);
        }),
      );
    }

    const choice = page.choice("Attack", choices, chosen, (index) => {
      chosen = index;
      draw();
    });
    node.append(page.element("div", { class: "controls" }, choice), legend, pair);
    drawLegend();
    draw();
    page.onResize(node, draw);
    page.onTheme(() => {
      drawLegend();
      draw();
    });
    return () => ({
      columns: ["detector", "attack", "false-alarm probability", "detection probability", "interval from", "interval to"],
      rows: figure.curves.flatMap((curve) => curve.x.map((x, k) => [curve.name, curve.choice, x, curve.y[k], curve.low[k], curve.high[k]])),
    });
  };
})();
