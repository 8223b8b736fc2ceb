// Light and dark: as the system says, or as the reader chooses; figures are drawn anew where their colours change.
"use strict";

(() => {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const listeners = [];
  const select = document.getElementById("theme");

  function kept() {
    try {
      return localStorage.getItem("spoofgym-theme") || "system";
    } catch {
      return "system"; // a page from disk may have no storage
    }
  }

  function apply() {
    const theme = select.value === "system" ? (dark.matches ? "dark" : "light") : select.value;
    if (document.documentElement.dataset.theme === theme) return;
    document.documentElement.dataset.theme = theme;
    listeners.forEach((listener) => listener());
  }

  select.value = kept();
  select.addEventListener("change", () => {
    try {
      localStorage.setItem("spoofgym-theme", select.value);
    } catch {
      // the choice then lasts as long as the page is open
    }
    apply();
  });
  dark.addEventListener("change", apply);
  apply();

  /** A colour of the present theme by its name in page.css. */
  page.colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  /** Calls a function whenever the theme has changed. */
  page.onTheme = (listener) => listeners.push(listener);
  /** Colours and dashes of a series by its place: no two of the first seven look alike in either. */
  page.seriesColour = (place) => page.colour(`c${(place % 7) + 1}`);
  page.dashes = [[], [7, 3], [2, 3], [9, 3, 2, 3], [4, 2], [12, 4], [1, 2]];
  page.seriesDash = (place) => page.dashes[place % page.dashes.length];
  /** Whether motion is to be kept small. */
  page.still = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
})();
