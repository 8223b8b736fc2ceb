// Draws all figures of the page. A figure that fails says so in its place, and the others are drawn.
"use strict";

(() => {
  const figures = JSON.parse(document.getElementById("data").textContent);
  figures.forEach((figure, place) => {
    const node = document.getElementById(`figure-${place}`);
    try {
      const table = page.figures[figure.type](node.querySelector(".drawing"), figure);
      page.tools(node.querySelector(".tools"), figure.title, table, figure.type === "table");
      node.dataset.drawn = "yes";
    } catch (error) {
      node.querySelector(".drawing").append(page.element("p", { class: "notice" }, `This figure could not be drawn: ${error.message}`));
      console.error(error);
    }
  });
})();
