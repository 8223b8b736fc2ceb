// What happened to every fix, a row for each kind, on the axis of the panels above.
"use strict";

(() => {
  /** Rows from the top: a name, the epochs at which it holds, and the colour. */
  function rows(game) {
    const flags = (series) => series.map(Boolean);
    const found = [
      { name: "attack", flags: flags(game.attacked), colour: "spoofed" },
      { name: "alarm", flags: game.alarm, colour: "c5" },
      { name: "excluded", flags: game.used.map((used) => !used), colour: "c4" },
      { name: "used", flags: flags(game.used), colour: "good" },
    ];
    if (game.backtracked.some(Boolean)) found.push({ name: "back", depths: game.backtracked, colour: "ink" });
    if (game.reset.some(Boolean)) found.push({ name: "reset", flags: flags(game.reset), colour: "c3" });
    if (game.satellites_left_out.some(Boolean)) found.push({ name: "left out", flags: flags(game.satellites_left_out), colour: "c4" });
    return found;
  }

  function drawRow(plot, game, row, place, count) {
    const { ctx } = plot;
    const across = (time) => Math.min(Math.max(plot.valToPos(time, "x", true), plot.bbox.left), plot.bbox.left + plot.bbox.width);
    const middle = plot.valToPos(count - place - 0.5, "y", true);
    const height = (plot.bbox.height / count) * 0.62;
    const half = (game.time[1] - game.time[0] || 1) / 2;
    ctx.fillStyle = ctx.strokeStyle = page.colour(row.colour);
    if (row.flags) {
      for (const [first, last] of page.stretches(row.flags)) {
        const [from, to] = [across(game.time[first] - half), across(game.time[last] + half)];
        ctx.fillRect(from, middle - height / 2, Math.max(to - from, 1.5 * devicePixelRatio), height);
      }
      return;
    }
    row.depths.forEach((depth, index) => {
      if (!depth) return;
      const [from, to] = [across(game.time[index]), across(game.time[Math.max(index - depth, 0)])];
      const size = 4 * devicePixelRatio;
      ctx.lineWidth = 1.5 * devicePixelRatio;
      ctx.beginPath();
      ctx.moveTo(from, middle);
      ctx.lineTo(to, middle);
      ctx.moveTo(to + size, middle - size);
      ctx.lineTo(to, middle);
      ctx.lineTo(to + size, middle + size);
      ctx.stroke();
      ctx.fillRect(from - devicePixelRatio, middle - height / 2, 2 * devicePixelRatio, height);
    });
  }

  page.decisionsPanel = (state) => {
    const { game } = state;
    const all = rows(game);
    const count = all.length;
    return {
      title: "What was done with the fixes",
      series: () => [{ values: game.time.map(() => null), colour: "transparent" }],
      scale: () => ({ range: [0, count] }),
      splits: () => all.map((_, place) => count - place - 0.5),
      values: () => all.map((row) => row.name),
      draw: (plot) => {
        plot.ctx.save();
        all.forEach((row, place) => drawRow(plot, game, row, place, count));
        plot.ctx.restore();
      },
      height: 24 * count + 56,
      last: true,
    };
  };
})();
