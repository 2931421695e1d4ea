// ---- the values of the settings and what follows from them; text in fields is never trusted

const MOST = 1e9;  // in SI units: larger numbers are refused

/**
 * The state: values of the settings, the last result, and changes that can be undone; listeners hear of each. `compute`
 * returns the result of values or a promise of it, and throws a RangeError where there is none: the last values are kept.
 * While it is at work, only the newest of other values wait.
 */
function makeLiveState(live, compute, first) {
  const stored = Float64Array.from(live.settings, ({ value }) => value);
  const listeners = [];
  const before = [];  // values, to undo
  let wanted = stored;  // the newest values that were set
  let waiting = null;
  const state = {
    live, stored, values: stored.slice(), result: first, message: "", busy: false,
    listen(listener) { listeners.push(listener); },
    get changed() { return live.settings.map((_, k) => k).filter((k) => state.values[k] !== stored[k]); },
    get canUndo() { return before.length > 0; },
    /** Set some values, pairs of a number of a setting and a value; a promise of false, with a message, where they are refused. */
    set(pairs, remember = true) {
      const next = wanted.slice();
      for (const [k, value] of pairs) next[k] = value;
      if (next.every((value, k) => value === wanted[k])) return Promise.resolve(tell(""));
      wanted = next;
      const names = pairs.map(([k, value]) => `${nameOf(live.settings[k])} ${value}`);
      const job = { next, names, remember: remember || waiting?.remember === true };
      if (waiting) job.names = [...waiting.names, ...names];
      return new Promise((resolve) => {
        job.resolve = (done) => {
          job.replaced?.(done);
          resolve(done);
        };
        if (waiting) job.replaced = waiting.resolve;
        waiting = job;
        if (!state.busy) work();
      });
    },
    undo() {
      const last = before.pop();
      return last ? state.set([...last.entries()], false) : Promise.resolve(false);
    },
    reset: () => state.set([...stored.entries()]),
    tell,
    compute: () => compute(state.values),
  };
  async function work() {
    state.busy = true;
    while (waiting) {
      const job = waiting;
      waiting = null;
      try {
        const found = compute(job.next);
        const result = found instanceof Promise ? await found : found;
        if (job.remember) before.push(state.values);
        Object.assign(state, { values: job.next, result });
        if (!waiting) state.busy = false;
        job.resolve(tell(""));
      } catch (error) {
        if (!waiting) {
          wanted = state.values;
          state.busy = false;
        }
        job.resolve(tell(error instanceof RangeError ? `${shortList(job.names)}: ${error.message}; the last values are kept` : `This page failed: ${error.message}`));
      }
    }
  }
  function tell(message) {
    state.message = message;
    for (const listener of listeners) listener();
    return !message;
  }
  return state;
}

const nameOf = ({ group, name }) => `${group}, ${name}`;
const shortList = (texts) => (texts.length > 3 ? `${texts.slice(0, 3).join(", ")} and ${texts.length - 3} more` : texts.join(", "));

/** The number in a field; a text with the reason where it is none that the setting accepts. */
function readField(text, setting) {
  const value = text.trim() === "" ? NaN : Number(text.trim().replace(",", "."));
  if (setting.options && setting.options[value] === undefined) {
    return `${nameOf(setting)}: “${text.slice(0, 40)}” is no choice, expected a whole number from 0 to ${setting.options.length - 1}`;
  }
  const least = setting.least ?? -MOST;
  const unit = setting.unit && ` ${setting.unit}`;
  if (!Number.isFinite(value)) return `${nameOf(setting)}: “${text.slice(0, 40)}” is not a number; ${formatNumber(setting.now, 6)}${unit} is kept`;
  if (value < least || (setting.above && value <= least) || value > MOST) {
    return `${nameOf(setting)}: ${value}${unit} is out of range, expected ${setting.above ? "more than" : "at least"} ${least}${unit} and at most ${MOST}${unit}`;
  }
  return value;
}

/** 64-bit numbers whose bytes stand apart: all first bytes, then all second ones, … */
function decodePlanes(bytes) {
  const count = bytes.length / 8;
  const found = new Uint8Array(bytes.length);
  for (let k = 0; k < 8; k++) for (let i = 0; i < count; i++) found[8 * i + k] = bytes[count * k + i];
  return new Float64Array(found.buffer);
}
