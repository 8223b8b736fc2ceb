// A matrix as a table with coloured cells: real text for screen readers, sorted by any row or column.
"use strict";

(() => {
  const MANY = 9; // columns whose names are written upwards

  function parts(name) {
    return page.colour(name).split(",").map(Number);
  }

  /** Relative luminance of a colour (WCAG 2). */
  function luminance(rgb) {
    const [r, g, b] = rgb.map((part) => (part / 255 <= 0.04045 ? part / 255 / 12.92 : ((part / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  }

  /** How strong the colour of a value is, from 0 to 1. */
  function strength(layer) {
    const known = layer.values.flat().filter((value) => value !== null);
    if (layer.logarithmic) {
      const positive = known.filter((value) => value > 0);
      if (!positive.length) return () => 0;
      const [low, high] = [Math.log(Math.max(Math.min(...positive), 1e-3 * Math.max(...positive))), Math.log(Math.max(...positive))];
      return (value) => (value <= 0 ? 0 : Math.min(Math.max((Math.log(value) - low) / (high - low || 1), 0), 1));
    }
    const most = layer.most === null ? Math.max(...known, 1e-9) : layer.most;
    return (value) => Math.min(Math.max(value / most, 0), 1);
  }

  function style(share) {
    const [low, high] = [parts("heat-low"), parts("heat-high")];
    const mixed = low.map((part, place) => Math.round(part + share * (high[place] - part)));
    const light = luminance(mixed);
    const ink = (light + 0.05) ** 2 > 1.05 * 0.05 ? "#000000" : "#ffffff"; // whichever has the larger contrast
    return `background:rgb(${mixed.join(",")});color:${ink}`;
  }

  const sorted = (count, key, descending) => {
    const order = Array.from({ length: count }, (_, place) => place).sort((one, other) => page.compare(key(one), key(other)));
    return descending ? order.reverse() : order;
  };

  page.figures.matrix = (node, figure) => {
    let layer = figure.frames ? figure.layers.length - 1 : 0;
    let intervals = figure.layers.some((each) => each.low !== null) && figure.rows.length * figure.columns.length <= 80;
    let [byRow, byColumn] = [null, null]; // [place or "name" or "weight", descending]
    const sheet = page.element("div", { class: "scroll whole", tabindex: 0, role: "region", "aria-label": figure.title });
    const controls = page.element("div", { class: "controls" });

    const weights = (side) => (figure[`${side}_weights`] === null ? null : figure[`${side}_weights`][layer]);
    const value = (row, column) => figure.layers[layer].values[row][column];

    function orders() {
      const { rows, columns } = figure;
      const rowKey = (row) => (byColumn[0] === "name" ? rows[row] : byColumn[0] === "weight" ? weights("row")[row] : value(row, byColumn[0]));
      const columnKey = (column) => value(byRow[0], column);
      return [
        byColumn === null ? rows.map((_, place) => place) : sorted(rows.length, rowKey, byColumn[1]),
        byRow === null ? columns.map((_, place) => place) : sorted(columns.length, columnKey, byRow[1]),
      ].map((order, side) => order.filter((place) => present(side === 0 ? "row" : "column", place)));
    }

    /** Players that are not there yet in this frame have no value at all. */
    function present(side, place) {
      if (!figure.frames) return true;
      const { values } = figure.layers[layer];
      return side === "row" ? values[place].some((each) => each !== null) : values.some((row) => row[place] !== null);
    }

    const toggled = (before, place) => [place, before !== null && before[0] === place ? !before[1] : true];
    const direction = (order, place) => (order !== null && order[0] === place ? (order[1] ? "descending" : "ascending") : null);

    function head(text, weight, order, place, click, scope) {
      const button = page.element("button", { type: "button", title: `Sort by ${text}`, click }, ...page.folded(text));
      const share = weight === null || weight === undefined ? null : page.element("div", { class: "weight" }, `${figure.weighted} ${page.number(weight, 2)}`);
      return page.element("th", { scope, "aria-sort": direction(order, place) }, button, share);
    }

    function cell(shares, row, column) {
      const { low, high } = figure.layers[layer];
      const found = value(row, column);
      if (found === null) return page.element("td", {}, "–");
      const bounds = low === null || low[row][column] === null ? null : `${page.number(low[row][column], 2)} to ${page.number(high[row][column], 2)}`;
      const title = `${figure.rows[row]}, ${figure.columns[column]}: ${page.number(found)}${bounds ? ` [${bounds}]` : ""}`;
      return page.element("td", { style: style(shares(found)), title }, page.number(found), intervals && bounds ? page.element("small", {}, bounds) : null);
    }

    function draw() {
      const [rows, columns] = orders();
      const shares = strength(figure.layers[layer]);
      const redraw = (change) => () => {
        change();
        draw();
      };
      const [rowWeights, columnWeights] = [weights("row"), weights("column")];
      const corner = page.element("th", { scope: "col" },
        page.element("button", { type: "button", title: "Sort by name", click: redraw(() => (byColumn = ["name", direction(byColumn, "name") === "ascending"])) }, figure.corner),
        rowWeights === null ? null : page.element("div", {}, page.element("button", { type: "button", class: "weight", click: redraw(() => (byColumn = toggled(byColumn, "weight"))) }, `sort by ${figure.weighted}`)));
      const heads = columns.map((column) => head(figure.columns[column], columnWeights && columnWeights[column], byColumn, column, redraw(() => (byColumn = toggled(byColumn, column))), "col"));
      const body = rows.map((row) =>
        page.element("tr", {},
          head(figure.rows[row], rowWeights && rowWeights[row], byRow, row, redraw(() => (byRow = toggled(byRow, row))), "row"),
          ...columns.map((column) => cell(shares, row, column))));
      sheet.replaceChildren(page.element("table", { class: columns.length > MANY ? "heat many" : "heat" }, page.element("caption", {}, figure.layers[layer].name), page.element("thead", {}, page.element("tr", {}, corner, ...heads)), page.element("tbody", {}, ...body)));
    }

    if (figure.layers.length > 1) {
      controls.append(page.choice(figure.frames ? "Round" : "Figure", figure.layers.map((each) => each.name), layer, (chosen) => {
        layer = chosen;
        draw();
      }));
    }
    if (figure.layers.some((each) => each.low !== null)) {
      const box = page.element("input", { type: "checkbox", checked: intervals, change: () => {
        intervals = box.checked;
        draw();
      } });
      controls.append(page.element("label", {}, box, "95 % intervals"));
    }
    controls.append(page.element("button", { type: "button", click: () => {
      [byRow, byColumn] = [null, null];
      draw();
    } }, "As given"));
    node.append(controls, sheet);
    draw();
    page.onTheme(draw);
    return () => ({
      columns: ["row", "column", ...figure.layers.flatMap((each) => (each.low === null ? [each.name] : [each.name, `${each.name}, from`, `${each.name}, to`]))],
      rows: figure.rows.flatMap((row, i) =>
        figure.columns.map((column, j) => [row, column, ...figure.layers.flatMap((each) => (each.low === null ? [each.values[i][j]] : [each.values[i][j], each.low[i][j], each.high[i][j]]))])),
    });
  };
})();
