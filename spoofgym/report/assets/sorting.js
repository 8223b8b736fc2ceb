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

  const LONG = 40; // letters of a text that is folded

  const look = (value) => (typeof value !== "string" ? null : value.length > LONG ? "text long" : "text");

  const UNITS = { m: "m", s: "s", mps: "m/s" };
  const WORDS = { ci95: "95 %", arl0: "ARL₀", rmse: "RMSE", p95: "95 %" };

  /** The name of a column in words: `mean_error_m` is "mean error, m". What is no name of a value stays as it is. */
  page.inWords = (name) => {
    if (!/^[a-z0-9_ ]+$/.test(name)) return name;
    const [value, end] = name.match(/^(.*?)( from| to)?$/).slice(1);
    const parts = value.split("_");
    const unit = parts.length > 1 ? UNITS[parts[parts.length - 1]] : undefined;
    const words = (unit ? parts.slice(0, -1) : parts).map((part) => WORDS[part] || part).join(" ");
    return `${words}${end || ""}${unit ? `, ${unit}` : ""}`;
  };

  page.sortedTable = (table, label) => {
    const body = page.element("tbody");
    const heads = table.columns.map((column, place) => {
      const button = page.element("button", { type: "button", click: () => sort(place) }, page.inWords(column));
      return page.element("th", { scope: "col", class: table.rows.some((row) => typeof row[place] === "string" && row[place] !== "inf") ? "text" : null }, button);
    });
    const fill = (rows) =>
      body.replaceChildren(
        ...rows.map((row) =>
          page.element("tr", {}, ...row.map((value) => page.element("td", { class: look(value) }, written(value)))),
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
    const grid = page.element("table", { class: "sorted" }, page.element("thead", {}, page.element("tr", {}, ...heads)), body);
    return page.element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": `Table: ${label}` }, grid);
  };
})();
