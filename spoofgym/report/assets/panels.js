// Which panels a game has: error and protection levels, innovation, statistics over their thresholds.
"use strict";

(() => {
  const finite = (values) => values.map((value) => (value === "inf" || value === null ? null : value));
  const largest = (lists) => Math.max(0, ...lists.flat().filter((value) => value !== null && Number.isFinite(value)));

  /** The error of the real-time output beside what is known of it. */
  function errorPanel(state) {
    const { game } = state;
    const levels = game.protection_levels;
    const lines = () => [
      { name: "horizontal error, m", values: game.error, colour: page.colour("estimated"), width: 2.5 },
      { name: "vertical error", values: game.errorUp, colour: page.colour("c4"), dash: [7, 3] },
      ...(game.departure ? [{ name: "vehicle off its path, m", values: game.departure.deviation_m, colour: page.colour("c3"), dash: [3, 2] }] : []),
      { name: "offset of the fix", values: game.offset, colour: page.colour("spoofed"), dash: [2, 3] },
      { name: "sigma that the filter predicts", values: game.sigma_m.horizontal, colour: page.colour("c7"), dash: [9, 3, 2, 3], width: 1.5 },
      ...levels.map((level, place) => ({
        name: `protection level, ${level.direction} (${level.name})`,
        values: finite(level.values_m),
        shown: level.values_m,
        colour: page.seriesColour([2, 4, 5][place % 3]),
        dash: [[4, 2], [12, 4], [1, 2]][place % 3],
      })),
      ...limits.map(([name, limit]) => ({ name, values: game.time.map(() => limit), colour: page.colour("bad"), dash: [10, 3], width: 1 })),
    ];
    let top = 1.08 * Math.max(largest([game.error, game.errorUp, game.departure ? game.departure.deviation_m : [], ...levels.map((level) => level.values_m)]), 1.3 * largest([game.sigma_m.horizontal]), 1);
    const named = new Map(levels.map((level) => [`alert limit, ${level.direction}`, level.alert_limit_m]));
    const limits = [...named].filter(([, limit]) => limit < 2 * top);
    if (limits.length) top = Math.max(top, ...limits.map(([, limit]) => 1.05 * limit));
    return { title: "Error of the real-time output", series: lines, scale: () => ({ range: [0, top] }), height: 210 };
  }

  function innovationPanel(state) {
    const { innovation } = state.game;
    const axes = ["east", "north", "up"];
    const size = Math.max(3.5, 1.05 * largest(axes.map((axis) => innovation[axis].map(Math.abs))));
    return {
      title: "Innovation of the position over its sigma",
      series: () => axes.map((axis, place) => ({ name: axis, values: innovation[axis], colour: page.seriesColour(place), dash: page.seriesDash(place), width: 1.5 })),
      scale: () => ({ range: [-size, size] }),
      rules: [{ value: 0, colour: "rule", dash: [] }],
      height: 150,
    };
  }

  function statisticsPanel(state) {
    const { game } = state;
    const most = largest(game.ratios.map((part) => part.values));
    const logarithmic = most > 5;
    const shown = (values) => values.map((value) => (value === null ? null : logarithmic ? Math.max(value, 0.01) : value));
    return {
      title: "Statistics over their thresholds: above 1 is an alarm",
      series: () =>
        game.ratios.map((part, place) => ({ name: part.name, values: shown(part.values), shown: part.shown, colour: page.seriesColour(place), dash: page.seriesDash(place) })),
      scale: () => (logarithmic ? { distr: 3, range: [0.01, 1.5 * most] } : { range: [0, 1.1 * Math.max(most, 1.2)] }),
      values: logarithmic ? (_, marks) => marks.map((mark) => (mark !== null && Number.isInteger(Math.round(Math.log10(mark) * 1e6) / 1e6) ? page.number(mark) : "")) : null,
      rules: [{ value: 1, colour: "bad", dash: [6, 3] }],
      height: 190,
    };
  }

  page.gamePanels = (state) => [errorPanel(state), innovationPanel(state), ...(state.game.ratios.length ? [statisticsPanel(state)] : [])];
})();
