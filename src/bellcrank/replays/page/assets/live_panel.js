// ---- the controls of a live page: the verdict, fields and sliders, a table of joints, and the bar of changes

const MOST_SENTENCES = 6;  // of a verdict

/** The section at the top of the panel, and the bar above the page; both follow the state. */
function makeLivePanel(panel, state) {
  const { live } = state;
  const section = element("section", { id: "live-panel", ariaLabel: "Change values" });
  // Keys and clicks here are not those of the player.
  for (const kind of ["keydown", "click"]) section.addEventListener(kind, (event) => event.stopPropagation());
  const agrees = state.agreement <= AGREES;
  const badge = element("button", { className: "badge", ariaExpanded: "false",
    textContent: agrees ? `recomputed here: agrees to ${state.agreement.toExponential(0)}` : "replays only" });
  const details = element("p", { className: "about", hidden: true, textContent: agrees
    ? `On opening, this page computed the sizing again: peak and RMS torques, speeds and shares of limits differ from those of bellcrank by at most ${state.agreement.toExponential(1)}. Not recomputed: ${live.not_recomputed.join(", ")}.`
    : `On opening, this page computed the sizing again, and its figures differ from those of bellcrank by ${state.agreement.toExponential(1)}. Therefore it only replays.` });
  badge.classList.toggle("bad", !agrees);
  badge.onclick = () => {
    details.hidden = !details.hidden;
    badge.ariaExpanded = String(!details.hidden);
  };
  section.append(element("header", {}, element("h2", { textContent: "What if?" }), badge), details);
  if (!agrees) return { section, bar: null };

  const word = element("b", {});
  const sentences = element("ul", {});
  const open = element("p", { className: "about" });
  const verdict = element("div", { className: "live-verdict", role: "status" }, word, sentences, open);
  const message = element("p", { className: "live-message", role: "alert", hidden: true });
  const fields = live.settings.map((setting, k) => makeField(state, setting, k));
  const groups = element("div", { className: "groups" }, ...[...new Set(live.settings.map(({ group }) => group))].map((group, number) =>
    element("details", { open: /^payload|^speed/.test(group) || number === 0 }, element("summary", { textContent: group }),
      ...fields.filter(({ setting }) => setting.group === group).map(({ row }) => row))));
  const rows = live.joints.map(({ name }) => ({ name, cells: [0, 1, 2, 3, 4].map(() => element("td", {})), use: element("td", { className: "use" }) }));
  const table = element("table", {}, element("thead", {}, element("tr", {}, ...["joint", "largest share of a limit", "peak", "RMS", "speed", "motor peak", "motor RMS"]
    .map((textContent) => element("th", { textContent })))), element("tbody", {}, ...rows.map(({ name, cells, use }) =>
    element("tr", {}, element("th", { className: "name", textContent: name, title: name }), use, ...cells))));
  section.append(verdict, message, groups, element("div", { className: "wide" }, table));
  section.append(element("p", { className: "about", textContent: "Torques of motors contain the safety factor. While values are changed, the arrows of torques in the view are hidden, because they are those of the sizing." }));

  const bar = makeChangeBar(state, fields);
  const show = () => {
    const found = verdictOf(state);
    word.textContent = found.word;
    verdict.className = `live-verdict ${found.good ? "good" : found.good === null ? "partial" : "bad"}`;
    const more = found.sentences.length - MOST_SENTENCES;
    const texts = more > 0 ? [...found.sentences.slice(0, MOST_SENTENCES), `and ${more} more`] : found.sentences;
    sentences.replaceChildren(...texts.map((textContent) => element("li", { textContent })));
    open.hidden = !found.open.length;
    open.textContent = `Not recomputed: ${found.open.join("; ")}.`;
    message.hidden = !state.message;
    message.textContent = state.message;
    for (const field of fields) field.show();
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
    bar.show();
  };
  return { section, bar: bar.box, show };
}

function useBar(found) {
  if (!found) return [element("span", { textContent: "–" })];
  const [name, use] = found;
  const fill = element("i", { className: use > 1 ? "bad" : "" });
  fill.style.width = `${Math.min(100 * use, 100)}%`;
  return [element("span", { className: "use-bar" }, fill), element("span", { textContent: `${formatNumber(100 * use, 3)} % ${name}` })];
}

/** A row with a name, a slider, a field and a unit. */
function makeField(state, setting, k) {
  const label = `${setting.group}: ${setting.name}`;
  const [low, high] = setting.range;
  const slider = element("input", { type: "range", min: low, max: high, step: "any", ariaLabel: `${label}, slider` });
  const field = element("input", { type: "text", inputMode: "decimal", autocomplete: "off", spellcheck: false, ariaLabel: label, className: "number" });
  const row = element("label", { className: "field" }, element("span", { className: "name", textContent: setting.name, title: setting.name }), slider, field,
    element("span", { className: "unit", textContent: setting.unit || "×" }));
  let pending = null;  // moves between two frames of the screen are one
  let dragged = false;  // a drag is one change to undo
  slider.addEventListener("input", () => {
    const value = Number(Number(slider.value).toPrecision(4));
    if (pending === null) requestAnimationFrame(() => {
      const read = readField(String(pending), { ...setting, now: state.values[k] });
      pending = null;
      if (typeof read === "string") { state.tell(read); return; }
      state.set([[k, read]], !dragged);
      dragged = true;
    });
    pending = value;
  });
  slider.addEventListener("change", () => { dragged = false; });
  const take = () => {
    if (field.value === String(state.values[k])) return;
    const read = readField(field.value, { ...setting, now: state.values[k] });
    if (typeof read === "string") state.tell(read); else state.set([[k, read]]);
  };
  field.addEventListener("change", take);
  field.addEventListener("keydown", ({ key }) => { if (key === "Escape") field.value = String(state.values[k]); });
  return {
    setting, row,
    show() {
      if (document.activeElement !== slider) slider.value = state.values[k];
      field.value = String(state.values[k]);
      row.classList.toggle("changed", state.values[k] !== state.stored[k]);
    },
  };
}

/** The bar of changed values, each with its old one; it is printed too. */
function makeChangeBar(state) {
  const chips = element("span", { className: "chips" });
  const text = element("textarea", { readOnly: true, rows: 4, ariaLabel: "Text to copy", hidden: true });
  const offer = (found) => {
    text.hidden = false;
    text.value = found.text ?? found.error;
    text.select();
    if (found.text) navigator.clipboard?.writeText(found.text).catch(() => {});
  };
  const button = (textContent, title, onclick) => element("button", { textContent, title, onclick });
  const undo = button("Undo", "Undo the last change", () => state.undo());
  const box = element("section", { id: "live-bar", ariaLabel: "Changed values", hidden: true }, element("b", { textContent: "Changed" }), chips,
    element("span", { className: "acts" }, undo, button("Reset", "All values as in the sizing", () => state.reset()),
      button("Copy command", "The command that gives the same answer", () => offer(commandOf(state))),
      button("Copy YAML", "The changes as a mapping of paths", () => offer(yamlOf(state)))), text);
  if (document.body.classList.contains("report")) {
    box.append(element("p", { textContent: "The verdict, tables and pictures of this report are those of the sizing, without these changes." }));
  }
  for (const kind of ["keydown", "click"]) box.addEventListener(kind, (event) => event.stopPropagation());
  return {
    box,
    show() {
      const { changed, live, values, stored } = state;
      box.hidden = !changed.length && !state.canUndo;
      undo.disabled = !state.canUndo;
      text.hidden = true;
      chips.replaceChildren(...changed.map((k) => {
        const { group, name, unit } = live.settings[k];
        const chip = element("button", { title: "Set back", onclick: () => state.set([[k, stored[k]]]) });
        chip.append(`${group}, ${name}: `, element("del", { textContent: formatNumber(stored[k], 6) }), ` ${formatNumber(values[k], 6)} ${unit || "×"}`);
        return chip;
      }));
    },
  };
}
