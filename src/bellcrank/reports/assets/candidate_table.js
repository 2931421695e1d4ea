// ---- the table of an axis's candidates: sorted by a press on a header, filtered, and walked with the arrow keys

const FIRST_ROWS = 100;
const PRINTED = 10;  // rows on paper

const COLUMNS = [
  { key: "motor", label: "motor", value: ({ motor }) => motor.title, second: ({ motor }) => motor.id },
  { key: "gear", label: "gear", value: ({ gear }) => gear.title, second: ({ gear }) => (gear.direct ? "" : gear.id) },
  { key: "tier", label: "tier", value: ({ tier }) => Object.keys(SIGNS).indexOf(tier), cell: ({ tier }) => tierBadge(tier) },
  { key: "binding", label: "binding criterion", value: ({ binding }) => binding },
  { key: "use", label: "largest utilisation", unit: "%", number: true, value: ({ use }) => use, show: inPercent },
  { key: "mass", label: "mass", unit: "kg", number: true, value: ({ mass }) => mass },
  { key: "cost", label: "cost", number: true, value: ({ cost }) => cost, suffix: ({ motor }) => motor.currency },
  { key: "loss", label: "loss", unit: "W", number: true, value: ({ loss }) => loss },
  { key: "fit", label: "fit", value: ({ fit }) => fit },
];

/** Candidates in the order of a column; unknown values come last in both directions. */
function sortedBy(candidates, { value }, descending) {
  const sign = descending ? -1 : 1;
  return [...candidates].sort((a, b) => {
    const [x, y] = [value(a), value(b)];
    if (x === null || y === null) return (x === null) - (y === null) || a.rank - b.rank;
    return sign * (typeof x === "string" ? x.localeCompare(y, "en", { numeric: true }) : x - y) || a.rank - b.rank;
  });
}

/** Whether a candidate is shown under a filter. */
function passes({ motor, gear, tier, binding, fit }, { text, tier: wanted, maker, shown }) {
  const all = [motor.title, motor.id, gear.title, gear.id, tier, binding, fit].join(" ").toLowerCase();
  return text.toLowerCase().split(/\s+/).every((word) => all.includes(word))
    && (!wanted || tier === wanted) && (!shown || tier === "all criteria shown")
    && (!maker || motor.maker === maker || gear.maker === maker);
}

function makeFilters(changed) {
  const filter = { text: "", tier: "", maker: "", shown: false };
  const set = (key, value) => {
    filter[key] = value;
    changed();
  };
  const option = (value, text = value) => element("option", { value, textContent: text });
  const text = element("input", { type: "search", placeholder: "filter", ariaLabel: "Filter by text", oninput: () => set("text", text.value.trim()) });
  const tier = element("select", { ariaLabel: "Tier", onchange: () => set("tier", tier.value) }, option("", "all tiers"), ...Object.keys(SIGNS).map((each) => option(each)));
  const maker = element("select", { ariaLabel: "Maker", onchange: () => set("maker", maker.value) });
  const shown = element("input", { type: "checkbox", onchange: () => set("shown", shown.checked) });
  const count = element("output", {});
  const box = element("div", { className: "filters" }, text, tier, maker,
    element("label", {}, shown, "only all criteria shown"), count);
  const makersOf = (candidates) => {
    const makers = new Set(candidates.flatMap(({ motor, gear }) => [motor.maker, gear.maker]).filter(Boolean));
    maker.replaceChildren(option("", "all makers"), ...[...makers].sort((a, b) => a.localeCompare(b)).map((each) => option(each)));
    if (!makers.has(filter.maker)) filter.maker = "";
    maker.value = filter.maker;
  };
  return { box, filter, count, makersOf };
}

/** The first candidates of an axis for the printed page. */
function printedTable({ name, candidates }) {
  const text = (column, candidate) => {
    const value = column.value(candidate);
    if (column.key === "tier") return candidate.tier;
    return value === null ? "unknown" : column.number ? `${(column.show ?? ((v) => formatNumber(v, 3)))(value)} ${column.suffix?.(candidate) ?? ""}` : value;
  };
  const heads = COLUMNS.map(({ label, unit, number }) => element("th", { className: number ? "" : "text", textContent: unit ? `${label} [${unit}]` : label }));
  const count = candidates.length > PRINTED ? `${name}, the first ${PRINTED} of ${candidates.length}` : name;
  return element("table", {}, element("caption", { textContent: count }),
    element("thead", {}, element("tr", {}, ...heads)),
    element("tbody", {}, ...candidates.slice(0, PRINTED).map((candidate) => element("tr", {},
      ...COLUMNS.map((column) => element("td", { className: column.number ? "" : "text", textContent: text(column, candidate) }))))));
}

/** The table; `show(candidate)` is called for the pair that is hovered, focused or tapped, `compare(picked)` for a mark. */
function makeCandidateTable({ show, compare }) {
  const state = { axis: null, column: null, descending: false, rows: FIRST_ROWS, pinned: null };
  const filters = makeFilters(() => fill());
  const body = element("tbody", {});
  const headers = COLUMNS.map((column) => {
    const text = column.unit ? `${column.label} [${column.unit}]` : column.label;
    const button = element("button", { type: "button", textContent: text, onclick: () => sort(column) });
    return element("th", { scope: "col", className: column.number ? "number" : "" }, button);
  });
  const table = element("table", { className: "candidates" }, element("caption", {}),
    element("thead", {}, element("tr", {}, element("th", { scope: "col", textContent: "compare" }), ...headers)), body);
  const more = element("button", { type: "button", className: "more-rows", onclick: () => { state.rows += FIRST_ROWS; fill(); } });
  const box = element("div", { className: "table-box" }, filters.box, element("div", { className: "table-scroll", tabIndex: -1 }, table), more);
  const byRow = new Map();

  const sort = (column) => {
    state.descending = state.column === column && !state.descending;
    state.column = column;
    fill();
  };
  const mark = (candidate) => {
    for (const [row, each] of byRow) {
      row.classList.toggle("current", each === candidate);
      row.tabIndex = each === state.pinned ? 0 : -1;
    }
  };
  const pin = (candidate) => {
    state.pinned = candidate;
    mark(candidate);
    show(candidate);
  };
  const cellOf = (column, candidate) => {
    const cell = element("td", { className: column.number ? "number" : "text" });
    cell.dataset.name = column.unit ? `${column.label} [${column.unit}]` : column.label;
    const value = column.value(candidate);
    if (column.cell) cell.append(column.cell(candidate));
    else if (value === null) cell.append(element("span", { className: "unknown-value", textContent: "unknown" }));
    else cell.append(column.number ? (column.show ?? ((v) => formatNumber(v, 3)))(value) + (column.suffix ? ` ${column.suffix(candidate)}` : "") : value || "–");
    const second = column.second?.(candidate);
    if (second && second !== value) cell.append(element("small", { textContent: second }));
    return cell;
  };
  const rowOf = (candidate) => {
    const box = element("input", { type: "checkbox", checked: state.axis.picked.includes(candidate), ariaLabel: `compare ${candidate.name}` });
    box.onchange = () => {
      compare(candidate, box.checked);
      for (const [row, each] of byRow) row.querySelector("input").checked = state.axis.picked.includes(each);
    };
    const row = element("tr", { tabIndex: -1 }, element("td", { className: "pick" }, box), ...COLUMNS.map((column) => cellOf(column, candidate)));
    row.classList.toggle("chosen", candidate.rank === state.axis.chosen);
    if (candidate.rank === state.axis.chosen) row.children[1].append(element("small", { className: "chosen-word", textContent: "chosen" }));
    byRow.set(row, candidate);
    return row;
  };
  const fill = () => {
    const { axis, column, descending } = state;
    const found = axis.candidates.filter((each) => passes(each, filters.filter));
    const ordered = column ? sortedBy(found, column, descending) : found;
    headers.forEach((header, k) => {
      header.ariaSort = COLUMNS[k] === column ? (descending ? "descending" : "ascending") : "none";
    });
    byRow.clear();
    body.replaceChildren(...ordered.slice(0, state.rows).map(rowOf));
    if (!ordered.length) body.append(element("tr", {}, element("td", { colSpan: COLUMNS.length + 1, className: "nothing", textContent: "no pair matches the filter" })));
    else if (![...byRow.values()].includes(state.pinned)) byRow.keys().next().value.tabIndex = 0;
    mark(state.pinned);
    filters.count.textContent = `${ordered.length} of ${axis.candidates.length} pair${axis.candidates.length === 1 ? "" : "s"}`;
    more.hidden = ordered.length <= state.rows;
    more.textContent = more.hidden ? "" : `show ${Math.min(FIRST_ROWS, ordered.length - state.rows)} more`;
  };

  const rowAt = (target) => byRow.get(target.closest("tr"));
  body.addEventListener("pointerover", ({ target, pointerType }) => {
    const candidate = pointerType === "mouse" && rowAt(target);
    if (!candidate) return;
    mark(candidate);
    show(candidate);
  });
  body.addEventListener("pointerleave", () => {
    mark(state.pinned);
    show(state.pinned);
  });
  body.addEventListener("click", ({ target }) => { if (rowAt(target)) pin(rowAt(target)); });
  body.addEventListener("focusin", ({ target }) => { if (target.matches("tr") && rowAt(target)) pin(rowAt(target)); });
  body.addEventListener("keydown", (event) => {
    const row = event.target.closest("tr");
    const next = { ArrowDown: row.nextElementSibling, ArrowUp: row.previousElementSibling, Home: body.firstElementChild, End: body.lastElementChild }[event.key];
    if (event.key in { ArrowDown: 0, ArrowUp: 0, Home: 0, End: 0 }) {
      event.preventDefault();
      event.stopPropagation();
      next?.focus();
    }
  });
  return {
    box,
    /** Show the candidates of an axis. */
    show(axis) {
      Object.assign(state, { axis, rows: FIRST_ROWS, pinned: axis.candidates[axis.chosen ?? 0] ?? null });
      table.caption.textContent = `Candidates for ${axis.name}`;
      filters.makersOf(axis.candidates);
      fill();
      if (state.pinned) show(state.pinned);
    },
  };
}
