// How numbers are written.
"use strict";

/** A number with about so many significant digits; a dash where there is none. */
page.number = (value, digits = 3) => {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (value === "inf" || value === Infinity) return "∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e7 || size < 1e-4) return value.toExponential(Math.max(digits - 1, 0)).replace("e+", "e").replace("-", "−");
  const places = Math.max(digits - 1 - Math.floor(Math.log10(size)), 0);
  const text = value.toFixed(Math.min(places, 8));
  return (text.includes(".") ? text.replace(/\.?0+$/, "") : text).replace("-", "−");
};

/** A large number in few characters: 1.2 M, 30 k. */
page.compact = (value) => {
  const [unit, name] = [[1e9, " G"], [1e6, " M"], [1e3, " k"]].find(([least]) => Math.abs(value) >= 10 * least || (least > 1e3 && Math.abs(value) >= least)) || [1, ""];
  return `${page.number(value / unit)}${name}`;
};

/** A probability as percent. */
page.percent = (value) => (value === null || value === undefined ? "–" : `${page.number(100 * value)} %`);

/** A value with its interval. */
page.withInterval = (value, low, high) =>
  low === null || low === undefined || high === null || high === undefined
    ? page.number(value)
    : `${page.number(value)} [${page.number(low)}, ${page.number(high)}]`;
