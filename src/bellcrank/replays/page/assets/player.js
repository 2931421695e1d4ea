// ---- the player: the current time and its controls

const SPEEDS = [0.1, 0.2, 0.5, 1, 2, 5, 10];
const LONGEST_STEP = 0.1;  // s of wall-clock time: a tab that was hidden does not jump when it is visible again

/** The film's time, and playing it; listeners are called with each new time. */
function makePlayer(film) {
  const listeners = [];
  const ends = [];
  const frameTimes = [];
  let before = null;  // time stamp of the last frame
  let held = 0;
  const player = {
    start: film.time[0], end: film.time.at(-1), time: film.time[0], playing: false, speed: 1, loop: false, frameTimes,
    listen(listener) { listeners.push(listener); },
    /** Call a function now, and whenever the film lasts longer or shorter. */
    onEnds(listener) {
      ends.push(listener);
      listener();
    },
    setEnds(start, end) {
      Object.assign(player, { start, end });
      for (const listener of ends) listener();
      player.seek(player.time);
    },
    notify() { for (const listener of listeners) listener(player.time); },
    seek(t) {
      if (!Number.isFinite(t)) return;
      player.time = Math.min(Math.max(t, player.start), player.end);
      player.notify();
    },
    play() {
      if (player.playing || player.start === player.end) return;
      if (player.time >= player.end) player.time = player.start;
      player.playing = true;
      before = null;
      player.notify();
      requestAnimationFrame(advance);
    },
    pause() {
      player.playing = false;
      player.notify();
    },
    toggle() { if (player.playing) player.pause(); else player.play(); },
    /** Move by a number of frames. */
    step(count) {
      player.pause();
      const times = film.time;  // another motion may have replaced it
      const at = indexAt(times, player.time);
      // A step back from between two frames goes to the one before.
      const next = count < 0 && player.time > times[at] ? at + count + 1 : at + count;
      player.seek(times[Math.min(Math.max(next, 0), times.length - 1)]);
    },
    setSpeed(speed) {
      player.speed = Math.min(Math.max(speed, SPEEDS[0]), SPEEDS.at(-1)) || 1;
      player.notify();
    },
    faster(up) {
      const next = up ? SPEEDS.find((s) => s > player.speed * 1.001) : SPEEDS.findLast((s) => s < player.speed * 0.999);
      player.setSpeed(next ?? player.speed);
    },
    setLoop(loop) {
      player.loop = Boolean(loop);
      player.notify();
    },
    /** While the user drags the time, it does not advance by itself. */
    hold() { held++; },
    release() { held = Math.max(held - 1, 0); },
  };

  function advance(stamp) {
    if (!player.playing) return;
    const passed = before === null ? 0 : (stamp - before) / 1000;
    if (before !== null) frameTimes.push(stamp - before);
    if (frameTimes.length > 600) frameTimes.shift();
    before = stamp;
    if (!held) {
      const { start, end } = player;
      let t = player.time + Math.min(passed, LONGEST_STEP) * player.speed;
      if (t >= end) {
        if (player.loop) t = start + (t - end) % (end - start);
        else { t = end; player.playing = false; }
      }
      player.time = t;
    }
    player.notify();
    requestAnimationFrame(advance);
  }
  return player;
}

/** Buttons, time line and keys. */
function makeControls(player, film, resetCamera) {
  const { start, end } = player;
  const still = start === end;
  const digits = end - start < 1 ? 4 : end - start < 100 ? 3 : 2;
  const [scrub, speed, loop, clock, play, tip] = ["scrub", "speed", "loop", "clock", "play", "tip"].map(byId);
  const [clockNow, total] = [element("span"), element("small")];
  clock.append(clockNow, total);
  player.onEnds(() => {
    total.textContent = ` / ${formatNumber(player.end, 5)} s`;
    clockNow.style.cssText = `display: inline-block; text-align: right; min-width: ${player.end.toFixed(digits).length}ch`;
    Object.assign(scrub, { min: player.start, max: still ? player.start + 1 : player.end, disabled: still });
  });
  speed.append(...SPEEDS.map((s) => element("option", { value: s, textContent: `${s}×` })));
  for (const button of [play, byId("back"), byId("forth"), speed, loop]) button.disabled = still;

  player.listen((t) => {
    scrub.value = t;
    scrub.setAttribute("aria-valuetext", `${t.toFixed(digits)} s`);
    clockNow.textContent = t.toFixed(digits);
    const label = player.playing ? "Pause" : "Play";
    if (play.ariaLabel !== label) {
      play.ariaLabel = label;
      byId("play-icon").setAttribute("d", player.playing ? "M7 5h3.500v14H7zM13.500 5H17v14h-3.500z" : "M8 5.500v13l11-6.500z");
    }
    const known = SPEEDS.includes(player.speed);
    speed.value = known ? player.speed : "";
    loop.setAttribute("aria-pressed", player.loop);
  });
  play.onclick = player.toggle;
  byId("back").onclick = () => player.step(-1);
  byId("forth").onclick = () => player.step(1);
  loop.onclick = () => player.setLoop(!player.loop);
  speed.onchange = () => player.setSpeed(Number(speed.value));
  scrub.oninput = () => player.seek(Number(scrub.value));
  scrub.addEventListener("pointerdown", player.hold);
  for (const end of ["pointerup", "pointercancel"]) scrub.addEventListener(end, player.release);
  // A button that was clicked does not capture the space key.
  document.addEventListener("click", (event) => {
    if (event.detail > 0 && event.target.closest?.("button, input, select")) document.activeElement?.blur?.();
  });
  makeTimeline(player, film, scrub, tip, digits);
  addKeys(player, resetCamera);
}

/** The limit that is active at a time; undefined without one. */
const activeLimit = (limits, t) => limits.findLast(({ time }) => time <= t + 1e-9);

/** Marks of events on the time line, their text at the pointer, and a caption: after each event, or the active limit. */
function makeTimeline(player, { events, limits }, scrub, tip, digits) {
  const canvas = byId("ticks");
  const thumb = 8;  // half the width of the thumb: margin at both ends of the bar
  const toX = (t) => thumb + (t - player.start) / (player.end - player.start || 1) * (scrub.clientWidth - 2 * thumb);
  const draw = () => {
    const ratio = devicePixelRatio;
    const [width, height] = [scrub.clientWidth, scrub.clientHeight];
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.fillStyle = cssVariable("--rule");
    pen.fillRect(thumb, height / 2 - 2, width - 2 * thumb, 4);
    pen.fillStyle = cssVariable("--accent");
    pen.fillRect(thumb, height / 2 - 2, Math.max(toX(player.time) - thumb, 0), 4);
    pen.fillStyle = cssVariable("--event");
    for (const { time } of events) {
      const x = toX(time);
      pen.fillRect(x - 1, height / 2 - 8, 2, 16);
      pen.beginPath();
      pen.moveTo(x - 4, 3);
      pen.lineTo(x + 4, 3);
      pen.lineTo(x, 10);
      pen.fill();
    }
  };
  new ResizeObserver(draw).observe(scrub);
  darkScheme.addEventListener("change", draw);
  scrub.addEventListener("pointermove", ({ offsetX }) => {
    const { start, end } = player;
    const t = Math.min(Math.max(start + (offsetX - thumb) / (scrub.clientWidth - 2 * thumb) * (end - start), start), end);
    const near = events.filter(({ time }) => Math.abs(toX(time) - offsetX) < 7);
    const first = near.slice(0, 4).map(({ time, text }) => `${time.toFixed(digits)} s  ${text}`);
    tip.textContent = near.length ? first.join("\n") + (near.length > 4 ? `\nand ${near.length - 4} more` : "") : `${t.toFixed(digits)} s`;
    const half = tip.offsetWidth / 2;
    tip.style.left = `${Math.min(Math.max(offsetX, half), scrub.clientWidth - half)}px`;
  });
  for (const away of ["pointerleave", "pointercancel"]) scrub.addEventListener(away, () => { tip.textContent = ""; });
  const caption = byId("caption");
  player.listen((t) => {
    draw();
    const { start, end } = player;
    const lasting = Math.max(0.05 * (end - start), 1e-9);
    const past = events.filter(({ time }) => time <= t + 1e-9 && t < time + lasting);
    const limit = activeLimit(limits, t)?.text;
    const text = past.length && end > start ? past.at(-1).text : limit ? `limit: ${limit}` : "";
    if (caption.textContent !== text) caption.textContent = text;
  });
}

function addKeys(player, resetCamera) {
  const help = byId("help");
  byId("help-button").onclick = () => help.showModal();
  help.onclick = (event) => { if (event.target === help) help.close(); };
  const keys = new Map([
    [" ", player.toggle],
    ["ArrowLeft", (many) => player.step(-many)], ["ArrowRight", (many) => player.step(many)],
    [",", () => player.step(-1)], [".", () => player.step(1)], ["<", () => player.step(-10)], [">", () => player.step(10)],
    ["Home", () => player.seek(player.start)], ["End", () => player.seek(player.end)],
    ["[", () => player.faster(false)], ["-", () => player.faster(false)],
    ["]", () => player.faster(true)], ["+", () => player.faster(true)], ["=", () => player.faster(true)],
    ["l", () => player.setLoop(!player.loop)], ["r", resetCamera], ["?", () => help.showModal()],
  ]);
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || help.open) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const tag = event.target.tagName;
    if (tag === "SELECT" || (key === " " && (tag === "BUTTON" || tag === "SUMMARY" || event.target.type === "checkbox"))) return;
    const act = keys.get(key);
    if (!act) return;
    event.preventDefault();
    act(event.shiftKey ? 10 : 1);
  });
}
