// ---- the judgement of a sizing: figures, verdict and the table of joints

const MOST_SENTENCES = 6;  // of a verdict

/** All that follows from values of the settings. Throws a RangeError where it is not finite. */
function compute(live, functions, values) {
  functions.view("settings").set(values);
  const motions = functions.motions.map((motion) => {
    const factor = values[motion.speed] / live.settings[motion.speed].value;
    if (!Number.isFinite(motion.duration / factor)) throw new RangeError(`motion '${motion.name}' would never end`);
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

/** [number of a joint, limit, place among the uses or null] of the limits that the joints have with the chosen motors. */
function usesOf({ live, values }) {
  return live.uses.flatMap(([joint, name, place, listed, computed]) => {
    if (!listed) return [[joint, name, place]];
    const chosen = values[live.choices.joints[joint].setting];
    return listed.includes(chosen) ? [[joint, name, computed.includes(chosen) ? place : null]] : [];
  });
}

/** The verdict on the values: a word; whether it is good, null where that is not known; sentences; and what is not recomputed. */
function verdictOf(state) {
  const { live, changed, result } = state;
  if (!changed.length) return { ...live.stored, open: [] };
  const uses = usesOf(state);
  const beyond = uses.filter(([, , place]) => place !== null && result.exceeded[place]);
  const texts = beyond.map(([joint, name, place]) => `${live.joints[joint].name}: ${name} is exceeded` + (Number.isFinite(result.uses[place]) ? ` by ${formatNumber(100 * (result.uses[place] - 1), 3)} %` : ""));
  const sentences = [...texts, ...live.exceeded];
  const open = [...uses.filter(([, , place]) => place === null || Number.isNaN(result.uses[place])).map(([joint, name]) => `${live.joints[joint].name}: ${name}`), ...live.unjudged];
  if (sentences.length) return { word: "Exceeded", good: false, sentences, open };
  if (live.undetermined.length) return { word: "Not known", good: false, sentences: live.undetermined.map((text) => `in the sizing: ${text}`), open };
  if (!uses.some(([, , place]) => place !== null)) return { word: "Nothing to compare with", good: null, sentences: ["no limit is recomputed"], open };
  return open.length ? { word: "Inside as far as recomputed", good: null, sentences, open } : { word: "All inside", good: true, sentences, open };
}

/** The largest known use of the limits of a joint: [name, use], or null. */
function largestUse(state, joint) {
  const { result } = state;
  const own = usesOf(state).filter(([of, , place]) => of === joint && place !== null && !Number.isNaN(result.uses[place])).map(([, name, place]) => [name, result.uses[place]]);
  return own.reduce((best, each) => (best === null || each[1] > best[1] ? each : best), null);
}

/** The verdict and the table of joints, for the panel, and a function that updates them. */
function makeJudgement(state) {
  const { live } = state;
  const word = element("b", {});
  const sentences = element("ul", {});
  const open = element("p", { className: "about" });
  const verdict = element("div", { className: "live-verdict", role: "status" }, word, sentences, open);
  const rows = live.joints.map(({ name }) => ({ name, cells: [0, 1, 2, 3, 4].map(() => element("td", {})), use: element("td", { className: "use" }) }));
  const table = element("table", {}, element("thead", {}, element("tr", {}, ...["joint", "largest share of a limit", "peak", "RMS", "speed", "motor peak", "motor RMS"]
    .map((textContent) => element("th", { textContent })))), element("tbody", {}, ...rows.map(({ name, cells, use }) =>
    element("tr", {}, element("th", { className: "name", textContent: name, title: name }), use, ...cells))));
  const about = element("p", { className: "about", textContent: "Torques of motors contain the safety factor. While values are changed, the arrows of torques in the view are hidden, because they are those of the sizing. " + live.fixed.map((text) => `${text[0].toUpperCase()}${text.slice(1)}.`).join(" ") });
  return {
    above: [verdict], below: [element("div", { className: "wide" }, table), about],
    show() {
      const found = verdictOf(state);
      word.textContent = found.word;
      verdict.className = `live-verdict ${found.good ? "good" : found.good === null ? "partial" : "bad"}`;
      const more = found.sentences.length - MOST_SENTENCES;
      const texts = more > 0 ? [...found.sentences.slice(0, MOST_SENTENCES), `and ${more} more`] : found.sentences;
      sentences.replaceChildren(...texts.map((textContent) => element("li", { textContent })));
      open.hidden = !found.open.length;
      open.textContent = `Not recomputed: ${found.open.join("; ")}.`;
      const { figures } = state.result;
      rows.forEach(({ cells, use }, joint) => {
        const { torque_unit: unit, speed_unit: speed, motor, at_shaft: atShaft } = live.joints[joint];
        const units = [unit, unit, speed, "N m", "N m"];
        cells.forEach((cell, kind) => {
          const known = kind < 3 || atShaft;
          const own = figures.slice(kind * rows.length, (kind + 1) * rows.length);
          const value = own[joint] < NOISE * largest(own) ? 0 : own[joint];
          cell.textContent = known ? `${formatNumber(value)} ${units[kind]}` : motor ? "not known" : "–";
        });
        const largestOf = largestUse(state, joint);
        use.replaceChildren(...useBar(largestOf));
      });
    },
  };
}

function useBar(found) {
  if (!found) return [element("span", { textContent: "–" })];
  const [name, use] = found;
  const fill = element("i", { className: use > 1 ? "bad" : "" });
  fill.style.width = `${Math.min(100 * use, 100)}%`;
  return [element("span", { className: "use-bar" }, fill), element("span", { textContent: `${formatNumber(100 * use, 3)} % ${name}` })];
}
