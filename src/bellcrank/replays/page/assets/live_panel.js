// ---- the controls of a page that computes: fields and sliders, the badge, and the bar of changes

/**
 * The section at the top of the panel, and the bar above the page; both follow the state. `kind` says what is computed
 * (live_sizing.js, live_run.js).
 */
function makeLivePanel(panel, state, kind) {
  const { live } = state;
  const section = element("section", { id: "live-panel", ariaLabel: "Change values" });
  // Keys and clicks here are not those of the player.
  for (const kind of ["keydown", "click"]) section.addEventListener(kind, (event) => event.stopPropagation());
  const agrees = state.agreement <= kind.agrees;
  const badge = element("button", { className: "badge", ariaExpanded: "false",
    textContent: agrees ? `recomputed here: agrees to ${state.agreement.toExponential(0)}` : "replays only" });
  const details = element("p", { className: "about", hidden: true, textContent: kind.about(state, agrees) });
  badge.classList.toggle("bad", !agrees);
  badge.onclick = () => {
    details.hidden = !details.hidden;
    badge.ariaExpanded = String(!details.hidden);
  };
  section.append(element("header", {}, element("h2", { textContent: "What if?" }), badge), details);
  if (!agrees) return { section, bar: null };

  const message = element("p", { className: "live-message", role: "alert", hidden: true });
  const fields = live.settings.map((setting, k) => makeField(state, setting, k));
  const groups = element("div", { className: "groups" }, ...[...new Set(live.settings.map(({ group }) => group))].map((group, number) =>
    element("details", { open: kind.open.test(group) || number === 0 }, element("summary", { textContent: group }),
      ...fields.filter(({ setting }) => setting.group === group).map(({ row }) => row))));
  const summary = kind.summary(state);
  section.append(...summary.above, message, groups, ...summary.below);

  const bar = makeChangeBar(state, kind);
  const show = () => {
    summary.show();
    message.hidden = !state.message;
    message.textContent = state.message;
    for (const field of fields) field.show();
    bar.show();
  };
  return { section, bar: bar.box, show };
}

/** A row with a name, a slider, a field and a unit. */
function makeField(state, setting, k) {
  const label = `${setting.group}: ${setting.name}`;
  if (setting.options) return makeChooser(state, setting, k, label);
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

/** A row with a name and the options of a choice. */
function makeChooser(state, setting, k, label) {
  const chooser = element("select", { ariaLabel: label, onchange: () => state.set([[k, Number(chooser.value)]]) },
    ...setting.options.map((textContent, value) => element("option", { textContent, value })));
  const row = element("label", { className: "field chooser" }, element("span", { className: "name", textContent: setting.name, title: setting.name }), chooser);
  return {
    setting, row,
    show() {
      chooser.value = String(state.values[k]);
      row.classList.toggle("changed", state.values[k] !== state.stored[k]);
    },
  };
}

/** A value with its unit, or the option that is chosen. */
const shownValue = ({ options, unit }, value) => options?.[value] ?? `${formatNumber(value, 6)} ${unit || "×"}`;

/** The bar of changed values, each with its old one; it is printed too. */
function makeChangeBar(state, kind) {
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
    element("span", { className: "acts" }, undo, button("Reset", `All values as in the ${kind.noun}`, () => state.reset()),
      button("Copy command", "The command that gives the same answer", () => offer(commandOf(state))),
      button("Copy YAML", "The changes as a mapping of paths", () => offer(yamlOf(state)))), text);
  if (document.body.classList.contains("report")) {
    box.append(element("p", { textContent: `The verdict, tables and pictures of this report are those of the ${byId("study") ? "study" : kind.noun}, without these changes.` }));
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
        const { group, name, options } = live.settings[k];
        const chip = element("button", { title: "Set back", onclick: () => state.set([[k, stored[k]]]) });
        chip.append(`${group}, ${name}: `, element("del", { textContent: options?.[stored[k]] ?? formatNumber(stored[k], 6) }), ` ${shownValue(live.settings[k], values[k])}`);
        return chip;
      }));
    },
  };
}
