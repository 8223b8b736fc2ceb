// One game: prepares its series, and puts track, panels, events and transport together around one present epoch.
"use strict";

(() => {
  /** How each kind of event is marked: by a shape, as a character where canvases are drawn, and by the dashes of its line. */
  page.eventKinds = {
    onset: { shape: "diamond", glyph: "◆", dash: [] },
    "end of the attack": { shape: "square", glyph: "■", dash: [10, 4] },
    alarm: { shape: "triangle", glyph: "▲", dash: [6, 3] },
    exclusion: { shape: "cross", glyph: "✕", dash: [2, 3] },
    backtrack: { shape: "back", glyph: "◀", dash: [8, 3, 2, 3] },
    "re-use": { shape: "circle", glyph: "●", dash: [4, 4] },
    reset: { shape: "down", glyph: "▼", dash: [1, 3] },
    "corridor left": { shape: "down", glyph: "▽", dash: [12, 3] },
    "back in the corridor": { shape: "circle", glyph: "○", dash: [3, 6] },
    divergence: { shape: "cross", glyph: "✕", dash: [] },
  };
  const CHIPS = 14;
  const AXES = ["east", "north", "up"];

  const horizontal = (one, other) => one.east.map((x, k) => Math.hypot(x - other.east[k], one.north[k] - other.north[k]));

  /** The game with what its figures derive from the series in the page. */
  function prepared(given) {
    const game = { ...given, time: given.time_s };
    const last = game.time[game.time.length - 1];
    const half = (game.time[1] - game.time[0] || 1) / 2;
    game.span = [game.time[0] - half, last + half];
    game.error = horizontal(game.estimated_m, game.true_m);
    game.errorUp = game.estimated_m.up.map((z, k) => Math.abs(z - game.true_m.up[k]));
    game.offset = horizontal(game.spoofed_m, game.true_m);
    game.innovation = Object.fromEntries(AXES.map((axis) => [axis, game.innovation_m[axis].map((value, k) => value / game.innovation_sigma_m[axis][k])]));
    game.ratios = game.statistics.map((part) => {
      const values = part.values.map((value) => (value === "inf" ? null : value / part.threshold));
      return { name: part.name, values, shown: part.values.map((value) => (value === "inf" ? "inf" : value / part.threshold)) };
    });
    game.alarm = game.time.map((_, k) => game.statistics.some((part) => part.values[k] === "inf" || part.values[k] > part.threshold));
    game.firsts = Object.keys(page.eventKinds).map((kind) => game.events.find((event) => event.kind === kind)).filter(Boolean);
    return game;
  }

  /** Buttons that go to the events. Where there are many, only the first of each kind has one. */
  function eventButtons(state) {
    const { game } = state;
    const shown = game.events.length > CHIPS ? [...game.firsts].sort((one, other) => one.epoch - other.epoch) : game.events;
    const count = (kind) => game.events.filter((event) => event.kind === kind).length;
    const list = page.element("ul", { class: "events", "aria-label": "Events" });
    const draw = () =>
      list.replaceChildren(
        ...shown.map((event) => {
          const sample = page.svg("svg", { width: 14, height: 14, "aria-hidden": "true" }, page.mark(page.eventKinds[event.kind].shape, 7, 7, 4, page.colour("event")));
          const more = shown !== game.events && count(event.kind) > 1 ? `first ${event.kind} of ${count(event.kind)}` : event.kind;
          const text = `${more}, ${page.number(game.time[event.epoch], 6)} s${event.detail ? `: ${event.detail}` : ""}`;
          return page.element("li", {}, page.element("button", { type: "button", click: () => state.go(event.epoch) }, sample, text));
        }),
      );
    state.panels.push({ draw, move() {}, node: null });
    return list;
  }

  /** What holds at the present epoch, in words. */
  function readout(state) {
    const { game } = state;
    const names = ["Error", "Offset of the fix", "Fix", "Alarm"];
    const cells = names.map(() => page.element("dd"));
    const decided = (k) => {
      const parts = [game.used[k] ? "used" : "excluded"];
      if (game.backtracked[k]) parts.push(`${game.backtracked[k]} before it taken back`);
      if (game.reset[k]) parts.push("filter reset to it");
      if (game.satellites_left_out[k]) parts.push(`${game.satellites_left_out[k]} satellites left out`);
      return parts.join(", ");
    };
    const alarming = (k) => game.statistics.filter((part) => part.values[k] === "inf" || part.values[k] > part.threshold).map((part) => part.name);
    const move = (k) => {
      cells[0].textContent = `${page.number(game.error[k])} m horizontal, ${page.number(game.errorUp[k])} m vertical`;
      cells[1].textContent = game.attacked[k] ? `${page.number(game.offset[k])} m horizontal` : "none: no attack";
      cells[2].textContent = decided(k);
      cells[3].textContent = alarming(k).join(", ") || "none";
    };
    state.panels.push({ draw() {}, move, node: null });
    return page.element("dl", { class: "readout" }, ...names.flatMap((name, place) => [page.element("dt", {}, name), cells[place]]));
  }

  function table(game) {
    const series = [["epoch", game.time.map((_, k) => k)], ["time_s", game.time]];
    for (const kind of ["true", "estimated", "spoofed"]) AXES.forEach((axis) => series.push([`${kind}_${axis}_m`, game[`${kind}_m`][axis]]));
    series.push(["attacked", game.attacked], ["error_m", game.error_m], ...(game.departure ? [["deviation_m", game.departure.deviation_m]] : []), ["sigma_horizontal_m", game.sigma_m.horizontal], ["sigma_up_m", game.sigma_m.up]);
    AXES.forEach((axis) => series.push([`innovation_${axis}_m`, game.innovation_m[axis]], [`innovation_sigma_${axis}_m`, game.innovation_sigma_m[axis]]));
    game.statistics.forEach((part) => series.push([`statistic of ${part.name}`, part.values], [`threshold of ${part.name}`, game.time.map(() => part.threshold)]));
    game.protection_levels.forEach((level) => series.push([`protection level ${level.direction} of ${level.name}, m`, level.values_m]));
    for (const name of ["used", "backtracked", "reset", "satellites_left_out"]) series.push([name, game[name]]);
    series.push(["events", game.time.map((_, k) => game.events.filter((event) => event.epoch === k).map((event) => event.kind).join("; "))]);
    return { columns: series.map(([name]) => name), rows: game.time.map((_, k) => series.map(([, values]) => values[k])) };
  }

  page.figures.game = (node, figure) => {
    const game = prepared(figure.game);
    const state = { game, index: 0, panels: [] };
    state.go = (index) => {
      state.index = Math.min(Math.max(index, 0), game.time.length - 1);
      state.panels.forEach((panel) => panel.move(state.index));
      node.dataset.epoch = state.index;
    };
    const track = page.track(state);
    track.append(readout(state));
    const panels = [...page.gamePanels(state), page.decisionsPanel(state)].map((options) => page.panel(state, options));
    const grid = page.element("div", { class: "game-grid" }, track, page.element("div", {}, ...panels));
    node.append(eventButtons(state), grid, page.transport(state, node));
    state.panels.forEach((panel) => panel.draw());
    state.go(game.time.length - 1); // all of it is seen at first; play begins anew
    state.panels.filter((panel) => panel.node).forEach((panel) => page.onResize(panel.node, panel.draw));
    page.onTheme(() => state.panels.forEach((panel) => panel.draw()));
    return () => table(game);
  };
})();
