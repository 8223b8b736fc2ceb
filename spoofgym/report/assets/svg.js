// Inline SVG: elements, the marks of series and the legends that explain them.
"use strict";

(() => {
  const SPACE = "http://www.w3.org/2000/svg";

  /** An SVG element; children that are text stay text. */
  page.svg = (name, attributes = {}, ...children) => {
    const node = document.createElementNS(SPACE, name);
    for (const [key, value] of Object.entries(attributes)) {
      if (value !== null && value !== undefined) node.setAttribute(key, String(value));
    }
    node.append(...children.filter((child) => child !== null && child !== undefined));
    return node;
  };

  /** A drawing of so many pixels, which a screen reader calls by its label. */
  page.drawing = (width, height, label) =>
    page.svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": label });

  /** The path through points; null breaks it. */
  page.path = (points) => {
    let text = "";
    let pen = false;
    for (const point of points) {
      if (point === null) {
        pen = false;
        continue;
      }
      text += `${pen ? "L" : "M"}${point[0].toFixed(1)} ${point[1].toFixed(1)}`;
      pen = true;
    }
    return text;
  };

  const SHAPES = {
    circle: (r) => page.svg("circle", { r }),
    square: (r) => page.svg("rect", { x: -r, y: -r, width: 2 * r, height: 2 * r }),
    diamond: (r) => page.svg("path", { d: `M0 ${-1.3 * r}L${1.3 * r} 0L0 ${1.3 * r}L${-1.3 * r} 0Z` }),
    triangle: (r) => page.svg("path", { d: `M0 ${-1.2 * r}L${1.2 * r} ${r}L${-1.2 * r} ${r}Z` }),
    cross: (r) => page.svg("path", { d: `M${-r} ${-r}L${r} ${r}M${-r} ${r}L${r} ${-r}`, fill: "none" }),
    down: (r) => page.svg("path", { d: `M0 ${1.2 * r}L${1.2 * r} ${-r}L${-1.2 * r} ${-r}Z` }),
    back: (r) => page.svg("path", { d: `M${-1.3 * r} 0L${r} ${-1.1 * r}L${r} ${1.1 * r}Z` }),
  };
  page.shapes = Object.keys(SHAPES);

  /** A mark of a shape at a place. */
  page.mark = (shape, x, y, radius, colour) => {
    const node = SHAPES[shape](radius);
    node.setAttribute("transform", `translate(${x.toFixed(1)} ${y.toFixed(1)})`);
    node.setAttribute("stroke", colour);
    node.setAttribute("stroke-width", 2);
    if (shape !== "cross") node.setAttribute("fill", colour);
    return node;
  };

  /** A sample of a line or of a mark for a legend. */
  page.sample = ({ colour, dash = [], shape = null, width = 2 }) => {
    const node = page.svg("svg", { width: 28, height: 14, "aria-hidden": "true" });
    if (shape) node.append(page.mark(shape, 14, 7, 4.5, colour));
    else {
      const line = { x1: 1, y1: 7, x2: 27, y2: 7, stroke: colour, "stroke-width": width };
      node.append(page.svg("line", { ...line, "stroke-dasharray": dash.join(" ") }));
    }
    return node;
  };

  /** A legend: a list of samples with their names. */
  page.legend = (entries) =>
    page.element("ul", { class: "legend" }, ...entries.map((each) => page.element("li", {}, page.sample(each), each.name)));
})();
