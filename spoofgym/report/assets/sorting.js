// Tables whose columns sort their rows, with the keyboard, too.
"use strict";

(() => {
  /** Numbers by size, text by the alphabet, what is missing last. */
  page.compare = (one, other) => {
    const missing = (value) => value === null || value === undefined || value === "";
    if (missing(one) || missing(other)) return Number(missing(one)) - Number(missing(other));
    const [a, b] = [one, other].map((value) => (value === "inf" ? Infinity : value));
    return typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
  };

  function written(value) {
    if (typeof value === "number") return page.number(value, 5);
    if (value === true || value === false) return value ? "yes" : "no";
    return value === null || value === undefined ? "–" : String(value);
  }

  page.sortedTable = (table, label) => {
    const body = page.element("tbody");
    const heads = table.columns.map((column, place) => {
      const button = page.element("button", { type: "button", click: () => sort(place) }, column);
      return page.element("th", { scope: "col", class: table.rows.some((row) => typeof row[place] === "string" && row[place] !== "inf") ? "text" : null }, button);
    });
    const fill = (rows) =>
      body.replaceChildren(
        ...rows.map((row) =>
          page.element("tr", {}, ...row.map((value) => page.element("td", { class: typeof value === "string" ? "text" : null }, written(value)))),
        ),
      );

    function sort(place) {
      const direction = heads[place].getAttribute("aria-sort") === "ascending" ? "descending" : "ascending";
      heads.forEach((head) => head.removeAttribute("aria-sort"));
      heads[place].setAttribute("aria-sort", direction);
      const sorted = [...table.rows].sort((one, other) => page.compare(one[place], other[place]));
      fill(direction === "ascending" ? sorted : sorted.reverse());
    }

    fill(table.rows);
    const grid = page.element("table", {}, page.element("thead", {}, page.element("tr", {}, ...heads)), body);
    return page.element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": `Table: ${label}` }, grid);
  };
})();
