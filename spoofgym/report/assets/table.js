// A table as it is.
"use strict";

page.figures.table = (node, figure) => {
  node.append(page.sortedTable(figure, figure.title));
  return () => ({ columns: figure.columns, rows: figure.rows });
};
