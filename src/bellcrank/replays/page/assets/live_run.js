// ---- a page that computes a run again, in a worker: starting it, asking it, and what is said of its answers

const SAMPLE_SECONDS = 10;  // the longest run, s of computing
const NOT_FINITE = 3;  // statuses of the integrator (problem.hpp)
const INTERRUPTED = 5;
const REFUSALS = [  // page_engine.cpp
  "", "a constraint is undefined at the start", "the constraints cannot be satisfied at the start near the given positions",
  "a constraint is satisfied only with its sides turned around", "the given velocities violate the constraints",
  "the page cannot tell whether the constraints depend on each other at these values; bellcrank can",
  "a rolling contact is open at the start: its plane would have to pull", "a disk lies flat at the start",
];

const liveKind = {
  noun: "run",
  agrees: 1e-4,  // of the largest values: a run amplifies rounding, and is known to 1e-3 of a range (Settings.error_bound)
  open: /^parameters|^velocities|^Baumgarte's gains( in place of none)?$/,
  load: loadRun,
  agreement: runAgreement,
  about: ({ agreement, live }, agrees) => (agrees
    ? `On opening, this page computed the run again: positions and velocities at ${live.numbers[1]} times, and the times of events, differ from those of bellcrank by at most ${agreement.toExponential(1)} of their largest values. Not recomputed: error estimate, arrows of forces, notes and warnings.`
    : `On opening, this page computed the run again, and it differs from that of bellcrank${Number.isFinite(agreement) ? ` by ${agreement.toExponential(1)} of the largest values` : " in how it ends or in its events"}. Therefore it only replays.`),
  summary: makeRunSummary,
  follower: makeRunFollower,
  facade: (state) => ({
    get result() {
      const { time, state: x, eventTime, eventIndex, status, end, drift } = state.result;
      return { time: [...time], state: [...x], events: [...eventTime].map((t, k) => [state.live.events[eventIndex[k]][0], t]), status: state.live.statuses[status][0], end, drift };
    },
    get seconds() { return state.result.seconds; },
    set patience(seconds) { state.live.patience = seconds; },
    kill: () => state.live.worker?.terminate(),
  }),
};

/** A function that computes the run of values, in a worker that starts again where it has died. */
async function loadRun(live) {
  const bytes = await window.bellcrank.inflated("live");
  let at = 0;
  const next = (count) => bytes.slice(at, at += count);
  const modules = live.modules.map(next);
  const [described, compared] = live.numbers;
  const numbers = decodePlanes(next(8 * (described + compared * (1 + live.size))));
  const code = next(bytes.length - at);
  const description = numbers.subarray(0, described);
  const checks = { time: numbers.subarray(described, described + compared), state: numbers.subarray(described + compared) };
  Object.assign(live, { checks, worker: null, patience: 2 * SAMPLE_SECONDS });
  const even = Array.from({ length: live.samples }, (_, k) => live.duration * k / (live.samples - 1));
  const times = Float64Array.from(new Set([...even, ...checks.time].sort((a, b) => a - b)));

  /** The answer of the worker to a message; rejects where it dies or does not answer. */
  const ask = (message) => new Promise((resolve, reject) => {
    const { worker } = live;
    const timer = setTimeout(() => end("does not answer"), 1000 * live.patience);
    const end = (what) => {
      clearTimeout(timer);
      worker.terminate();
      live.worker = null;
      reject(new RangeError(`the worker that computes the run ${what}`));
    };
    worker.onmessage = ({ data }) => {
      clearTimeout(timer);
      if (data.error) end(`failed (${data.error})`); else resolve(data.found);
    };
    worker.onerror = (event) => {
      event.preventDefault();
      end(`failed (${event.message ?? "unknown"})`);
    };
  });
  const start = async () => {
    const address = URL.createObjectURL(new Blob([`(${liveWorker})(self)`], { type: "text/javascript" }));
    live.worker = new Worker(address);
    const answer = ask();
    live.worker.postMessage({ load: { code, modules, description } });
    await answer;
    URL.revokeObjectURL(address);
  };
  return async (values) => {
    if (!live.worker) await start();
    const answer = ask();
    live.worker.postMessage({ run: { values, times, seconds: SAMPLE_SECONDS, size: live.size, shown: live.shown } });
    const found = await answer;
    if (found.refused) throw new RangeError(REFUSALS[found.refused]);
    if (found.status === INTERRUPTED) throw new RangeError(`the run takes more than ${SAMPLE_SECONDS} s, where it has reached ${formatNumber(found.end)} s`);
    return finiteRows(live, found);
  };
}

/** The rows before the first that is not finite. */
function finiteRows(live, found) {
  const bad = found.state.findIndex((value) => !Number.isFinite(value));
  const rows = bad < 0 ? found.rows : Math.floor(bad / live.size);
  if (rows < 2 && found.status === NOT_FINITE) throw new RangeError("the accelerations at the start are not finite");
  if (rows === found.rows) return found;
  return { ...found, rows, status: NOT_FINITE, end: found.time[rows - 1], time: found.time.slice(0, rows), state: found.state.slice(0, rows * live.size), shown: found.shown.slice(0, rows * live.shown) };
}

/** The largest difference from the rows and events of the file, by the largest value of each coordinate; infinite where it ends otherwise. */
function runAgreement({ checks, stored, size, duration }, found) {
  const { events } = stored;
  if (found.status !== stored.status || found.eventTime.length !== events.length || events.some(([index], k) => found.eventIndex[k] !== index)) return Infinity;
  let worst = Math.abs(found.end - stored.end) / duration;
  events.forEach(([, time], k) => { worst = Math.max(worst, Math.abs(found.eventTime[k] - time) / duration); });
  const count = checks.time.length;
  const sizes = Array.from({ length: size }, (_, j) => Math.max(...Array.from({ length: count }, (_, i) => Math.abs(checks.state[size * i + j]))));
  const least = 1e-3 * Math.max(...sizes);  // what is smaller counts as a part of that
  for (let i = 0; i < count; i++) {
    let row = indexAt(found.time, checks.time[i]);
    if (row + 1 < found.rows && found.time[row + 1] - checks.time[i] < checks.time[i] - found.time[row]) row++;
    for (let j = 0; j < size; j++) worst = Math.max(worst, Math.abs(found.state[size * row + j] - checks.state[size * i + j]) / Math.max(sizes[j], least, 1e-300));
  }
  return worst;
}

/** One column of what is shown. */
const shownColumn = ({ shown, rows }, width, place) => Float64Array.from({ length: rows }, (_, i) => (place < 0 ? NaN : shown[width * i + place]));

/** Why a run ended, and whether that is good. */
function endOf({ events, statuses }, found) {
  const [word, good, advice] = statuses[found.status];
  const at = ` at ${formatNumber(found.end, 7)} s`;
  return word === "event" ? [`event '${events[found.eventIndex.at(-1)]?.[0]}' ended the run${at}`, good] : [`${word}${at}: ${advice}`, good];
}

/** [name, value] of the figures of a run. */
function figuresOf(live, found) {
  const count = found.eventTime.length;
  const last = count ? `${live.events[found.eventIndex[count - 1]][0]} at ${formatNumber(found.eventTime[count - 1], 9)} s` : "none";
  return [
    ["end", `${formatNumber(found.end, 9)} s`],
    [count > 1 ? `events (${count}), the last` : "event", last],
    ["steps", `${found.accepted}, rejected ${found.rejected}`],
    ["evaluations", String(found.evaluations)],
    ["energy drift", found.drift.toExponential(1)],
    ...live.residuals.map(([unit, place]) => [`largest residual [${unit || "1"}]`, largest(shownColumn(found, live.shown, place)).toExponential(1)]),
  ];
}

/** Why the run ended, and its figures beside those of the run of the file; a function updates them. */
function makeRunSummary(state) {
  const { live } = state;
  const first = state.result;
  const word = element("b", {});
  const note = element("p", { className: "about" });
  const verdict = element("div", { className: "live-verdict", role: "status" }, word, note);
  const body = element("tbody", {});
  const table = element("table", {}, element("thead", {}, element("tr", {}, ...["", "unchanged", "now"].map((textContent) => element("th", { textContent })))), body);
  const gains = live.gains === "projection" ? " With α = β = 0 states are projected onto the constraints; other gains are Baumgarte's, without projection." : "";
  const about = element("p", { className: "about", textContent: `While values are changed, dashed lines and the translucent bodies are the run of the file, and arrows of forces are hidden.${gains} ${live.fixed.join(". ")}` });
  return {
    above: [verdict], below: [element("div", { className: "wide" }, table), about],
    show() {
      const found = state.result;
      const [text, good] = endOf(live, found);
      word.textContent = text;
      verdict.className = `live-verdict ${good ? "good" : "bad"}`;
      const notes = [];
      if (found.stiff > 0.2 * found.accepted) notes.push(`Stiffness holds ${found.stiff} steps short: bellcrank's solver Radau takes longer ones.`);
      if (found.drift > live.largest_drift) notes.push("The energy balance is violated: the run is not to be trusted.");
      if (found.doubtful) notes.push(`Events may have been missed in ${found.doubtful} steps.`);
      note.hidden = !notes.length;
      note.textContent = notes.join(" ");
      const before = figuresOf(live, first);
      body.replaceChildren(...figuresOf(live, found).map(([name, value], k) => element("tr", {}, element("th", { textContent: name }),
        element("td", { textContent: before[k][1] }), element("td", { textContent: value }))));
    },
  };
}
