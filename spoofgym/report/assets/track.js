// The ground track: where the vehicle is, where the filter believes it to be, and where the spoofer puts it.
"use strict";

(() => {
  const SHARE = 0.2; // deviations are magnified up to this share of the track's extent,
  const LEAST = 30; // though not as if they were smaller than this, m: noise stays small
  const FACTORS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
  const MARGIN = 28;
  const LAYERS = [
    { key: "true", name: "true position", shape: "circle", dash: [] },
    { key: "estimated", name: "estimated", shape: "triangle", dash: [7, 3] },
    { key: "spoofed", name: "where the signals say", shape: "cross", dash: [2, 3] },
  ];

  const extent = (points) => {
    const found = [Infinity, Infinity, -Infinity, -Infinity];
    for (const [x, y] of points) {
      found[0] = Math.min(found[0], x);
      found[1] = Math.min(found[1], y);
      found[2] = Math.max(found[2], x);
      found[3] = Math.max(found[3], y);
    }
    return found;
  };
  const size = ([left, bottom, right, top]) => Math.max(right - left, top - bottom, 1);

  /** Points of a layer, deviations from the true track drawn larger by a factor. */
  function magnified(game, key, factor) {
    const [east, north] = [game[`${key}_m`].east, game[`${key}_m`].north];
    const true_ = game.true_m;
    return east.map((x, k) => [true_.east[k] + factor * (x - true_.east[k]), true_.north[k] + factor * (north[k] - true_.north[k])]);
  }

  /** Points of a layer as seen from the vehicle. */
  const relative = (game, key) => game.true_m.east.map((x, k) => [game[`${key}_m`].east[k] - x, game[`${key}_m`].north[k] - game.true_m.north[k]]);

  /** The round factor by which deviations of this game are drawn larger on the whole track. */
  function factorOf(game) {
    const largest = Math.max(LEAST, ...game.error, ...game.offset);
    const wanted = (SHARE * size(extent(magnified(game, "true", 1)))) / largest;
    return FACTORS.filter((factor) => factor <= wanted).pop() || 1;
  }

  function frame(box, width, height) {
    const [left, bottom, right, top] = box;
    const scale = Math.min((width - 2 * MARGIN) / Math.max(right - left, 1e-6), (height - 2 * MARGIN - 16) / Math.max(top - bottom, 1e-6), (Math.min(width, height) - 2 * MARGIN) / 2);
    const middle = [(left + right) / 2, (bottom + top) / 2];
    const place = ([x, y]) => [width / 2 + scale * (x - middle[0]), (height - 16) / 2 - scale * (y - middle[1])];
    return { place, scale };
  }

  function scaleBar(scale, width, height) {
    const length = page.roundStep((0.18 * width) / scale);
    const end = 14 + length * scale;
    const y = height - 14;
    const text = length >= 1000 ? `${page.number(length / 1000)} km` : `${page.number(length)} m`;
    return page.svg("g", { stroke: page.colour("ink"), "stroke-width": 2 },
      page.svg("path", { d: `M14 ${y - 5}V${y}H${end}V${y - 5}`, fill: "none" }),
      page.svg("text", { x: end + 7, y: y + 1, stroke: "none" }, text));
  }

  const northArrow = (width) =>
    page.svg("g", { transform: `translate(${width - 22} 36)` },
      page.svg("path", { d: "M0 -18L6 2L0 -2L-6 2Z", fill: page.colour("ink") }),
      page.svg("text", { x: 0, y: 17, "text-anchor": "middle" }, "N"));

  /** Circles around the vehicle, a round distance apart. */
  function rings(place, scale, reach) {
    const step = page.roundStep(reach / 2.5);
    const [x, y] = place([0, 0]);
    const found = page.svg("g", {});
    for (let radius = step; radius <= reach * 1.01; radius += step) {
      found.append(page.svg("circle", { cx: x, cy: y, r: radius * scale, fill: "none", class: "grid" }));
      found.append(page.svg("text", { x: x + 3, y: y - radius * scale - 3, class: "muted" }, `${page.number(radius)} m`));
    }
    return found;
  }

  page.track = (state) => {
    const { game } = state;
    const factor = factorOf(game);
    const modes = [
      ...(factor > 1 ? [{ name: `whole track, deviations × ${factor}`, factor }] : []),
      { name: "whole track, true to scale", factor: 1 },
      { name: "seen from the vehicle", factor: 0 },
    ];
    let mode = modes[0];
    let parts = [];
    const sheet = page.element("div", { class: "drawing-track" });
    const legend = page.element("div");
    const choice = page.choice("View", modes.map((each) => each.name), 0, (chosen) => {
      mode = modes[chosen];
      draw();
    });
    const controls = page.element("div", { class: "controls" }, choice);
    const node = page.element("div", { class: "game-track", role: "group", "aria-label": "Ground track" }, controls, sheet, legend);

    function draw() {
      const width = page.width(sheet) - 2;
      const height = Math.round(Math.min(Math.max(0.95 * width, 260), 400));
      const points = LAYERS.map(({ key }) => (mode.factor ? magnified(game, key, mode.factor) : relative(game, key)));
      const reach = Math.max(10, ...game.error, ...game.offset);
      const box = mode.factor ? extent(points.flat()) : [-reach, -reach, reach, reach];
      const { place, scale } = frame(box, width, height);
      const drawing = page.drawing(width, height, `Ground track, ${mode.name}`);
      if (mode.factor) drawing.append(page.svg("path", { d: page.path(points[0].map(place)), class: "axis" }));
      else drawing.append(rings(place, scale, reach));
      parts = LAYERS.map((layer, index) => {
        const colour = page.colour(layer.key);
        const line = page.svg("path", { fill: "none", stroke: colour, "stroke-width": 2, "stroke-dasharray": layer.dash.join(" "), "stroke-linejoin": "round" });
        const mark = page.mark(layer.shape, 0, 0, layer.key === "true" ? 5 : 6, colour);
        drawing.append(line);
        return { line, mark, places: points[index].map(place) };
      });
      if (mode.factor) {
        for (const event of game.firsts) {
          const [x, y] = parts[0].places[event.epoch];
          const mark = page.mark(page.eventKinds[event.kind].shape, x, y, 4, page.colour("event"));
          mark.append(page.svg("title", {}, `${event.kind} at ${page.number(game.time[event.epoch], 6)} s`));
          drawing.append(mark);
        }
      }
      drawing.append(...parts.map((part) => part.mark), scaleBar(scale, width, height), northArrow(width));
      sheet.replaceChildren(drawing);
      legend.replaceChildren(page.legend(LAYERS.map((layer) => ({ name: layer.name, colour: page.colour(layer.key), dash: layer.dash }))));
      move(state.index);
    }

    function move(index) {
      for (const part of parts) {
        part.line.setAttribute("d", page.path(part.places.slice(0, index + 1)));
        const [x, y] = part.places[index];
        part.mark.setAttribute("transform", `translate(${x.toFixed(1)} ${y.toFixed(1)})`);
      }
    }

    state.panels.push({ draw, move, node: sheet });
    return node;
  };
})();
