// ---- the settings of a sizing and what follows from them; text in fields is never trusted

const MOST = 1e9;  // in SI units: larger numbers are refused
const AGREES = 1e-6;  // relative: where a load reverses close to an edge of a part, RMS torques of motors are off by some 1e-7

/** The state: values of the settings, the last results, and changes that can be undone; listeners hear of each. */
function makeLiveState(live, functions) {
  const stored = Float64Array.from(live.settings, ({ value }) => value);
  const listeners = [];
  const before = [];  // values, to undo
  const state = {
    live, stored, values: stored.slice(), result: compute(live, functions, stored), message: "",
    listen(listener) { listeners.push(listener); },
    get changed() { return live.settings.map((_, k) => k).filter((k) => state.values[k] !== stored[k]); },
    get canUndo() { return before.length > 0; },
    /** Set some values, pairs of a number of a setting and a value; false, with a message, where they are refused. */
    set(pairs, remember = true) {
      const next = state.values.slice();
      for (const [k, value] of pairs) next[k] = value;
      if (next.every((value, k) => value === state.values[k])) return tell("");
      try {
        const result = compute(live, functions, next);
        if (remember) before.push(state.values);
        Object.assign(state, { values: next, result });
        return tell("");
      } catch (error) {
        if (!(error instanceof RangeError)) throw error;
        return tell(`${pairs.map(([k, value]) => `${nameOf(live.settings[k])} ${value}`).join(", ")}: ${error.message}; the last values are kept`);
      }
    },
    undo() {
      const last = before.pop();
      if (last) state.set([...last.entries()], false);
    },
    reset: () => state.set([...stored.entries()]),
    tell,
    compute: () => compute(live, functions, state.values),
  };
  live.loaded = functions.motions;
  state.agreement = agreementOf(live, state.result);
  function tell(message) {
    state.message = message;
    for (const listener of listeners) listener();
    return !message;
  }
  return state;
}

const nameOf = ({ group, name }) => `${group}, ${name}`;

/** The number in a field; a text with the reason where it is none that the setting accepts. */
function readField(text, setting) {
  const value = text.trim() === "" ? NaN : Number(text.trim().replace(",", "."));
  const least = setting.least ?? -MOST;
  const unit = setting.unit && ` ${setting.unit}`;
  if (!Number.isFinite(value)) return `${nameOf(setting)}: “${text.slice(0, 40)}” is not a number; ${formatNumber(setting.now, 6)}${unit} is kept`;
  if (value < least || (setting.above && value <= least) || value > MOST) {
    return `${nameOf(setting)}: ${value}${unit} is out of range, expected ${setting.above ? "more than" : "at least"} ${least}${unit} and at most ${MOST}${unit}`;
  }
  return value;
}

/** All that follows from values of the settings. Throws a RangeError where it is not finite. */
function compute(live, functions, values) {
  functions.view("settings").set(values);
  const motions = functions.motions.map((motion) => {
    const factor = values[motion.speed] / live.settings[motion.speed].value;
    const along = alongMotion(functions, motion, factor);
    functions.view("most").set(along.most);
    functions.view("mean").set(along.mean);
    functions.verdict();
    const [figures, uses, exceeded] = ["figures", "uses", "exceeded"].map((name) => functions.view(name).slice());
    if (!figures.every(Number.isFinite)) throw new RangeError("the torques are not finite numbers");
    return { factor, samples: along.samples, figures, uses, exceeded };
  });
  const worst = (name) => motions[0][name].map((_, k) => Math.max(...motions.map((each) => each[name][k])));
  const [figures, exceeded] = [worst("figures"), worst("exceeded")];
  // A use that is unknown along one motion is unknown, unless a limit is exceeded along another one.
  const uses = worst("uses").map((use, k) => (exceeded[k] ? Math.max(...motions.filter((each) => each.exceeded[k]).map((each) => each.uses[k])) : use));
  return { motions, figures, uses, exceeded };
}

/** The largest relative difference from the sizing's own figures; small figures count by the largest of their kind. */
function agreementOf(live, { figures, uses }) {
  let worst = 0;
  const kinds = live.joints.length;
  const compare = (found, expected, size) => {
    if (expected !== null) worst = Math.max(worst, Math.abs(found - expected) / Math.max(Math.abs(expected), size, 1e-300));
  };
  for (let k = 0; k < figures.length; k++) {
    const kind = live.stored.figures.slice(k - k % kinds, k - k % kinds + kinds);
    compare(figures[k], live.stored.figures[k], 1e-3 * Math.max(...kind.map((value) => Math.abs(value ?? 0))));
  }
  live.stored.uses.forEach((use, k) => compare(uses[k], use, 1e-3));
  return worst;
}

/** The verdict on the values: a word; whether it is good, null where that is not known; sentences; and what is not recomputed. */
function verdictOf({ live, changed, result }) {
  if (!changed.length) return { ...live.stored, open: [] };
  const beyond = live.uses.filter(([, , place]) => place !== null && result.exceeded[place]);
  const texts = beyond.map(([joint, name, place]) => `${live.joints[joint].name}: ${name} is exceeded` + (Number.isFinite(result.uses[place]) ? ` by ${formatNumber(100 * (result.uses[place] - 1), 3)} %` : ""));
  const sentences = [...texts, ...live.exceeded];
  const open = [...live.uses.filter(([, , place]) => place === null || Number.isNaN(result.uses[place])).map(([joint, name]) => `${live.joints[joint].name}: ${name}`), ...live.unjudged];
  if (sentences.length) return { word: "Exceeded", good: false, sentences, open };
  if (live.undetermined.length) return { word: "Not known", good: false, sentences: live.undetermined.map((text) => `in the sizing: ${text}`), open };
  if (!result.uses.length) return { word: "Nothing to compare with", good: null, sentences: ["no limit is recomputed"], open };
  return open.length ? { word: "Inside as far as recomputed", good: null, sentences, open } : { word: "All inside", good: true, sentences, open };
}

/** The largest known use of the limits of a joint: [name, use], or null. */
function largestUse({ live, result }, joint) {
  const own = live.uses.filter(([of, , place]) => of === joint && place !== null && !Number.isNaN(result.uses[place])).map(([, name, place]) => [name, result.uses[place]]);
  return own.reduce((best, each) => (best === null || each[1] > best[1] ? each : best), null);
}

// ---- changes as text

/** A number as YAML reads it as a number: with a point before an exponent. */
const yamlNumber = (value) => String(value).replace(/^(-?\d+)e/, "$1.0e");

const plainKey = /^[A-Za-z_][\w.]*$/;
const quoteKey = (key) => (plainKey.test(key) ? key : JSON.stringify(key));

/** [path, value as YAML] of each override that the changes make; null where a change has none. */
function overridesOf({ live, values, changed }) {
  if (changed.some((k) => !live.settings[k].path)) return null;
  const paths = [...new Set(changed.map((k) => live.settings[k].path))];
  return paths.map((path) => {
    const own = [...live.settings.entries()].filter(([, setting]) => setting.path === path);
    if (own.length === 1 && !own[0][1].entry) return [path, yamlNumber(values[own[0][0]])];
    if (path !== "friction") return [path, `[${own.map(([k]) => yamlNumber(values[k])).join(", ")}]`];
    const joints = new Map();
    for (const [k, { entry }] of own) {
      const [, name, kind] = /^(.*)\/(\w+)$/s.exec(entry);
      joints.set(name, [...joints.get(name) ?? [], `${kind}: ${yamlNumber(values[k])}`]);
    }
    return [path, `{${[...joints].map(([name, each]) => `${quoteKey(name)}: {${each.join(", ")}}`).join(", ")}}`];
  });
}

const shellWord = (text) => (/^[\w@%+:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);

/** The command whose sizing has these values; a text that says why there is none. */
function commandOf(state) {
  const { command } = state.live;
  const overrides = overridesOf(state);
  if (!command || !overrides) return { error: "No command line gives these values: the sizing, or what is changed, does not come from a robot configuration alone." };
  const all = [...command.overrides.map(([path, value]) => [path, JSON.stringify(value)]), ...overrides];
  if (all.some(([path]) => /[=\n]/.test(path))) return { error: "No command line gives these values: a name contains “=” or a line break." };
  const words = ["bellcrank", "size", command.robot, ...command.motions.flatMap((name) => ["--motion", name]),
    ...command.payloads.flatMap((text) => ["--payload", text]), ...all.flatMap(([path, value]) => ["--set", `${path}=${value}`])];
  return { text: words.map(shellWord).join(" ") };
}

/** The changes as YAML: a mapping of paths, which `overrides` of bellcrank.size takes. */
function yamlOf(state) {
  const overrides = overridesOf(state);
  if (!overrides) return { error: "What is changed does not come from a robot configuration alone." };
  return { text: overrides.map(([path, value]) => `${quoteKey(path)}: ${value}`).join("\n") };
}

// ---- the address

const keyOf = (setting, k) => (setting.path ? setting.path + (setting.entry && `:${setting.entry}`) : `#${k}`);

/** Keep the changes in the fragment of the address, beside what else it holds. */
function keepInAddress(state) {
  const options = new URLSearchParams(location.hash.slice(1));
  options.delete("set");
  for (const k of state.changed) options.append("set", `${keyOf(state.live.settings[k], k)}=${state.values[k]}`);
  try {
    history.replaceState(null, "", `#${options}`);
  } catch { /* a page within another one has no address of its own */ }
}

/** Take the changes that the address holds; those that are not accepted are said. */
function takeFromAddress(state) {
  const refused = [];
  const pairs = [];
  for (const text of new URLSearchParams(location.hash.slice(1)).getAll("set")) {
    const [, key, value] = /^(.*)=([^=]*)$/s.exec(text) ?? [null, text, ""];
    const k = state.live.settings.findIndex((setting, i) => keyOf(setting, i) === key);
    const read = k < 0 ? `the address sets “${key.slice(0, 60)}”, which this page does not have` : readField(value, { ...state.live.settings[k], now: state.values[k] });
    if (typeof read === "string") refused.push(read); else pairs.push([k, read]);
  }
  if (pairs.length) state.set(pairs, false);
  if (refused.length) state.tell(refused.join("; "));
}
