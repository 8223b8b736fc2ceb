// The numbers of a figure as CSV and as a table. A table is {name, columns, rows}.
"use strict";

(() => {
  /** A cell of a CSV file; text that a spreadsheet would take for a formula is marked as text. */
  function cell(value) {
    if (value === null || value === undefined) return "";
    if (typeof value === "number") return String(value);
    let text = String(value);
    if (/^[=+@\-\t\r]/.test(text) && Number.isNaN(Number(text))) text = `'${text}`;
    return /[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  }

  page.csv = (table) => [table.columns, ...table.rows].map((row) => row.map(cell).join(",")).join("\n") + "\n";

  function save(table) {
    const address = URL.createObjectURL(new Blob([page.csv(table)], { type: "text/csv" }));
    const link = page.element("a", { href: address, download: `${table.name}.csv` });
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  }

  /** Buttons below a figure; the table is made when it is first opened, and not where the figure is one. */
  page.tools = (node, title, table, isTable) => {
    const name = title.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "").slice(0, 60) || "figure";
    const label = `Numbers of “${title}” as CSV`;
    const button = page.element("button", { type: "button", class: "csv", "aria-label": label, click: () => save({ name, ...table() }) }, "Numbers as CSV");
    node.append(button);
    if (isTable) return;
    const details = page.element("details", {}, page.element("summary", {}, "Numbers as a table"));
    details.addEventListener("toggle", () => {
      if (details.open && details.children.length === 1) details.append(page.sortedTable(table(), title));
    });
    node.append(details);
  };
})();
