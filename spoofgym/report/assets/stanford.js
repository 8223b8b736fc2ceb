// Stanford diagrams: epochs by error and protection level, over the four regions that the alert limit makes.
"use strict";

(() => {
  const REGIONS = [
    { corners: (limit) => [[0, 0], [limit, limit], [0, limit]], fill: "none" },
    { corners: (limit) => [[0, 0], [limit, 0], [limit, limit]], fill: "c5" },
    { corners: (limit, end) => [[limit, 0], [end, 0], [end, limit], [limit, limit]], fill: "bad" },
    { corners: (limit, end) => [[0, limit], [end, limit], [end, end], [0, end]], fill: "baseline" },
  ];

  function draw(node, figure) {
    const width = Math.min(page.width(node), 560);
    const total = figure.regions.reduce((sum, [, count]) => sum + count, 0) || 1;
    const told = figure.regions.map(([name, count]) => `${name} ${page.percent(count / total)}`).join(", ");
    const height = width - 6;
    const end = figure.edges[figure.edges.length - 1];
    const x = page.linear([0, end], [52, width - 12]);
    const y = page.linear([0, end], [height - 44, 10]);
    const drawing = page.drawing(width, height, `${figure.name}, ${figure.choice}: ${told}`);
    REGIONS.forEach(({ corners, fill }) => {
      if (fill === "none") return;
      const d = `${page.path(corners(figure.alert_limit, end).map(([a, b]) => [x(a), y(b)]))}Z`;
      drawing.append(page.svg("path", { d, fill: page.colour(fill), opacity: 0.16 }));
    });
    const most = Math.log(Math.max(2, ...figure.cells.map((cell) => cell[2])));
    const [low, high] = ["heat-low", "heat-high"].map((name) => page.colour(name).split(",").map(Number));
    for (const [column, row, count] of figure.cells) {
      const share = 0.35 + (0.65 * Math.log(count)) / most;
      const mixed = low.map((part, place) => Math.round(part + share * (high[place] - part)));
      const [left, right] = [x(figure.edges[column]), x(figure.edges[column + 1])];
      const [bottom, top] = [y(figure.edges[row]), y(figure.edges[row + 1])];
      const cell = page.svg("rect", { x: left, y: top, width: Math.max(right - left, 1), height: Math.max(bottom - top, 1), fill: `rgb(${mixed.join(",")})` });
      cell.append(page.svg("title", {}, `${count} epochs`));
      drawing.append(cell);
    }
    for (const tick of x.ticks(6)) {
      drawing.append(page.svg("text", { x: x(tick), y: height - 28, "text-anchor": "middle", class: "muted" }, page.number(tick)));
      drawing.append(page.svg("text", { x: 46, y: y(tick) + 4, "text-anchor": "end", class: "muted" }, page.number(tick)));
    }
    const limit = figure.alert_limit;
    const line = { stroke: page.colour("ink"), "stroke-width": 1, fill: "none" };
    drawing.append(page.svg("rect", { x: x(0), y: y(end), width: x(end) - x(0), height: y(0) - y(end), ...line }));
    drawing.append(page.svg("path", { d: page.path([[x(0), y(0)], [x(end), y(end)]]), ...line }));
    drawing.append(page.svg("path", { d: `${page.path([[x(0), y(limit)], [x(end), y(limit)]])}${page.path([[x(limit), y(0)], [x(limit), y(limit)]])}`, ...line, "stroke-dasharray": "6 3" }));
    drawing.append(page.svg("text", { x: x(end) - 4, y: y(limit) - 5, "text-anchor": "end" }, "alert limit"));
    drawing.append(page.svg("text", { x: (52 + width - 12) / 2, y: height - 8, "text-anchor": "middle", class: "muted" }, "error, m (last column: and beyond)"));
    drawing.append(page.svg("text", { transform: `translate(12 ${(height - 34) / 2}) rotate(-90)`, "text-anchor": "middle", class: "muted" }, "protection level, m (last row: and beyond)"));
    const legend = figure.regions.map(([name, count], place) => ({
      name: `${name}: ${count} (${page.percent(count / total)})`,
      colour: REGIONS[place].fill === "none" ? page.colour("ink") : page.colour(REGIONS[place].fill),
      shape: ["circle", "triangle", "diamond", "square"][place],
    }));
    node.replaceChildren(page.element("h4", {}, figure.name), page.legend(legend), drawing);
  }

  page.figures.stanford = (node, figure) => {
    const choices = [...new Set(figure.diagrams.map((diagram) => diagram.choice))];
    let chosen = Math.max(choices.indexOf(figure.chosen), 0);
    const pair = page.element("div", { class: "pair" });

    function redraw() {
      const shown = figure.diagrams.filter((diagram) => diagram.choice === choices[chosen]);
      const sheets = shown.map(() => page.element("div", { class: "sheet" }));
      pair.replaceChildren(...sheets);
      shown.forEach((diagram, place) => draw(sheets[place], diagram));
    }

    const choice = page.choice("Signals", choices, chosen, (index) => {
      chosen = index;
      redraw();
    });
    node.append(page.element("div", { class: "controls" }, choice), pair);
    redraw();
    page.onResize(node, redraw);
    page.onTheme(redraw);
    return () => ({
      columns: ["signals", "level", "error from, m", "error to, m", "protection level from, m", "protection level to, m", "epochs"],
      rows: figure.diagrams.flatMap(({ choice, name, edges, cells }) =>
        cells.map(([column, row, count]) => [choice, name, edges[column], edges[column + 1], edges[row], edges[row + 1], count]),
      ),
    });
  };
})();
