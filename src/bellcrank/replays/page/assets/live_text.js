// ---- the changes as text: a command, YAML, and the fragment of the address

/** A number as YAML reads it as a number: with a point before an exponent. */
const yamlNumber = (value) => String(value).replace(/^(-?\d+)e/, "$1.0e");

const plainKey = /^[A-Za-z_][\w.]*$/;
const quoteKey = (key) => (plainKey.test(key) ? key : JSON.stringify(key));

/** [path, value as YAML] of each override that the changes make; null where a change has none. */
function overridesOf({ live, values, changed: all }) {
  const changed = all.filter((k) => !live.settings[k].options);
  if (changed.some((k) => !live.settings[k].path)) return null;
  const paths = [...new Set(changed.map((k) => live.settings[k].path))];
  return paths.map((path) => {
    const own = [...live.settings.entries()].filter(([, setting]) => setting.path === path);
    if (own.length === 1 && !own[0][1].entry) return [path, yamlNumber(values[own[0][0]])];
    if (path === "simulate.stabilisation") return [path, `{kind: baumgarte, ${own.map(([k, { name }]) => `${name}: ${yamlNumber(values[k])}`).join(", ")}}`];
    if (path !== "friction") return [path, `[${own.map(([k]) => yamlNumber(values[k])).join(", ")}]`];
    const joints = new Map();
    for (const [k, { entry }] of own) {
      const [, name, kind] = /^(.*)\/(\w+)$/s.exec(entry);
      joints.set(name, [...joints.get(name) ?? [], `${kind}: ${yamlNumber(values[k])}`]);
    }
    return [path, `{${[...joints].map(([name, each]) => `${quoteKey(name)}: {${each.join(", ")}}`).join(", ")}}`];
  });
}

/** The ids of the motor and gear of each joint of a selection. */
function keptPairs({ live, values }) {
  return Object.fromEntries((live.choices?.joints ?? []).map(({ pairs, setting }, k) => [live.joints[k].name, pairs[setting === null ? 0 : values[setting]]]));
}

const shellWord = (text) => (/^[\w@%+:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);

/** The command that gives the same answer; a text that says why there is none. */
function commandOf(state) {
  const { command } = state.live;
  const overrides = overridesOf(state);
  if (!command || !overrides) return { error: "No command line gives these values: not everything comes from a configuration." };
  const all = [...command.overrides.map(([path, value]) => [path, JSON.stringify(value)]), ...overrides];
  if ([...all.map(([path]) => path), ...Object.keys(keptPairs(state))].some((path) => /[=\n]/.test(path))) return { error: "No command line gives these values: a name contains “=” or a line break." };
  const words = [...command.words, ...Object.entries(keptPairs(state)).flatMap(([joint, pair]) => ["--keep", `${joint}=${pair}`]), ...all.flatMap(([path, value]) => ["--set", `${path}=${value}`])];
  return { text: words.map(shellWord).join(" ") };
}

/** The changes as YAML: a mapping of paths, which `overrides` in Python takes. */
function yamlOf(state) {
  const overrides = overridesOf(state);
  if (!overrides) return { error: "What is changed does not come from a configuration alone." };
  if (state.live.choices) {
    const kept = Object.entries(keptPairs(state)).map(([joint, pair]) => `  ${quoteKey(joint)}: ${/^\w[\w.+-]*$/.test(pair) ? pair : JSON.stringify(pair)}`);
    return { text: ["keep:", ...kept, ...overrides.length ? ["overrides:"] : [], ...overrides.map(([path, value]) => `  ${quoteKey(path)}: ${value}`)].join("\n") };
  }
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
async function takeFromAddress(state) {
  const refused = [];
  const pairs = [];
  for (const text of new URLSearchParams(location.hash.slice(1)).getAll("set")) {
    const [, key, value] = /^(.*)=([^=]*)$/s.exec(text) ?? [null, text, ""];
    const k = state.live.settings.findIndex((setting, i) => keyOf(setting, i) === key);
    const read = k < 0 ? `the address sets “${key.slice(0, 60)}”, which this page does not have` : readField(value, { ...state.live.settings[k], now: state.values[k] });
    if (typeof read === "string") refused.push(read); else pairs.push([k, read]);
  }
  if (pairs.length) await state.set(pairs, false);
  if (refused.length) state.tell([state.message, ...refused].filter(Boolean).join("; "));
}
