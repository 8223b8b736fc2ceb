// The one name that the scripts of this page share. A figure is drawn by page.figures[type](place, figure), which
// returns its table of numbers.
"use strict";

window.page = {
  figures: {},

  /** An HTML element. Attributes that are functions become listeners; children that are text stay text. */
  element(name, attributes = {}, ...children) {
    const node = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (value === null || value === undefined || value === false) continue;
      if (typeof value === "function") node.addEventListener(key, value);
      else node.setAttribute(key, value === true ? "" : String(value));
    }
    node.append(...children.filter((child) => child !== null && child !== undefined));
    return node;
  },

  /** A name that may be folded after its punctuation, and nowhere else. */
  folded(name) {
    const parts = String(name).split(/(?<=[:,/+>_-])/);
    return parts.flatMap((part, place) => (place ? [page.element("wbr"), part] : [part]));
  },

  /** The width of an element in whole pixels. */
  width(node) {
    return Math.max(240, Math.floor(node.getBoundingClientRect().width));
  },

  /** Calls a function when the width of an element changes. */
  onResize(node, redraw) {
    let before = page.width(node);
    let waiting = false;
    new ResizeObserver(() => {
      if (waiting || page.width(node) === before) return;
      waiting = true;
      requestAnimationFrame(() => {
        waiting = false;
        before = page.width(node);
        redraw();
      });
    }).observe(node);
  },

  /** A choice among names; change is called with the index. */
  choice(label, names, chosen, change) {
    const select = page.element("select", { change: () => change(select.selectedIndex) });
    names.forEach((name, index) => select.append(page.element("option", { selected: index === chosen }, name)));
    return page.element("label", {}, label, select);
  },
};
