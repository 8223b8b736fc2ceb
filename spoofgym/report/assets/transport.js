// The scrubber, play and pause, and the keys that move a game; whatever moves it goes through state.go.
"use strict";

(() => {
  const WHOLE_GAME = 15000; // milliseconds in which a game is played at normal speed
  const SPEEDS = [0.5, 1, 2, 4];

  page.transport = (state, figure) => {
    const { game } = state;
    const last = game.time.length - 1;
    let timer = null;
    let speed = 1;
    const slider = page.element("input", { type: "range", min: 0, max: last, step: 1, value: 0, "aria-label": "Epoch of the game", input: () => state.go(Number(slider.value)) });
    state.focus = () => slider.focus({ preventScroll: true });
    const told = page.element("output");
    const play = page.element("button", { type: "button", class: "play", click: () => (timer === null ? start() : stop()) }, "Play");
    const step = (label, text, move) => page.element("button", { type: "button", "aria-label": label, title: label, click: move }, text);
    const speeds = page.choice("Speed", SPEEDS.map((each) => `${each} ×`), 1, (chosen) => {
      speed = SPEEDS[chosen];
      if (timer !== null) {
        stop();
        start();
      }
    });
    const jump = (direction) => {
      const epochs = game.events.map((event) => event.epoch);
      const found = direction > 0 ? epochs.find((epoch) => epoch > state.index) : epochs.filter((epoch) => epoch < state.index).pop();
      if (found !== undefined) state.go(found);
    };

    function start() {
      if (state.index === last) state.go(0);
      play.textContent = "Pause";
      told.setAttribute("aria-live", "off"); // a screen reader could not follow
      timer = setInterval(() => {
        if (state.index >= last) stop();
        else state.go(state.index + 1);
      }, WHOLE_GAME / last / speed);
    }

    function stop() {
      clearInterval(timer);
      timer = null;
      play.textContent = "Play";
      told.removeAttribute("aria-live");
    }

    figure.addEventListener("keydown", (event) => {
      if (event.altKey || event.ctrlKey || event.metaKey) return;
      const tag = event.target.tagName;
      const moves = { ArrowLeft: -1, ArrowRight: 1, PageDown: -10, PageUp: 10, Home: -last, End: last };
      if (event.key === " " && !["BUTTON", "SELECT", "SUMMARY"].includes(tag)) play.click();
      else if (event.key === "[") jump(-1);
      else if (event.key === "]") jump(1);
      else if (event.key in moves && !["INPUT", "SELECT"].includes(tag) && !event.target.closest(".scroll")) state.go(state.index + moves[event.key]);
      else return;
      event.preventDefault();
    });

    state.panels.push({
      draw() {},
      move(index) {
        slider.value = index;
        const text = `${page.number(game.time[index], 6)} s, epoch ${index} of ${last}`;
        slider.setAttribute("aria-valuetext", text);
        told.textContent = text;
      },
      node: null,
    });
    const back = step("To the event before", "◀ event", () => jump(-1));
    const on = step("To the next event", "event ▶", () => jump(1));
    return page.element("div", { class: "transport" },
      page.element("div", { class: "row" }, play, slider),
      page.element("div", { class: "row" }, told, back, on, speeds),
      page.element("p", { class: "hint" }, "Keys: space plays and pauses, ← → one epoch, Page Up and Page Down ten, Home and End, [ and ] from event to event."));
  };
})();
