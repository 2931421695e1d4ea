// ---- the parts of the page of a selection

/** The tabs of the axes; arrow keys walk them. */
function makeAxisTabs(axes, choose) {
  const tabs = axes.map((axis) => {
    const tier = axis.tier ?? axis.candidates[axis.chosen]?.tier;
    const sign = element("i", { className: `tier ${(tier ?? "fails").replaceAll(" ", "-")}`, ariaHidden: "true", textContent: SIGNS[tier ?? "fails"] });
    const tab = element("button", { type: "button", role: "tab", title: tier ?? "nothing in the catalogue drives it" },
      sign, element("span", { className: "name", textContent: axis.name }));
    tab.onclick = () => select(axis.number);
    return tab;
  });
  const select = (number) => {
    tabs.forEach((tab, k) => {
      tab.ariaSelected = String(k === number);
      tab.tabIndex = k === number ? 0 : -1;
    });
    choose(axes[number]);
  };
  const bar = element("div", { role: "tablist", className: "axis-tabs", ariaLabel: "Joints" }, ...tabs);
  bar.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    const next = (tabs.indexOf(document.activeElement) + step + tabs.length) % tabs.length;
    tabs[next].focus();
    select(next);
  });
  return { bar, select };
}

/** How many pairs of an axis are in each tier, and what to do where nothing fits. */
function axisSummary({ counts, candidates, advice, unknownMasses, mount, kept }) {
  const total = counts.reduce((sum, [, count]) => sum + count, 0);
  const text = counts.map(([tier, count]) => `${count.toLocaleString("en")} ${TIER_WORDS[tier]}`).join(", ");
  const shown = candidates.length < total ? ` The best ${candidates.length.toLocaleString("en")} are listed.` : "";
  const unknown = `The mass of what was chosen for ${unknownMasses.join(", ")} is not stated, so criteria that depend on the load are unknown.`;
  return [
    element("p", { textContent: `${total.toLocaleString("en")} pair${total === 1 ? "" : "s"}: ${text}.${shown} Mounted on ${mount}.${kept ? " The pair was given." : ""}` }),
    ...unknownMasses.length ? [element("p", { textContent: unknown })] : [],
    ...advice ? [element("p", { className: "advice", textContent: advice })] : [],
  ];
}
const TIER_WORDS = { "all criteria shown": "with all criteria shown", "passes what is known": "that pass what is known", fails: "that fail" };

/** The pair that is chosen for every axis, and the first candidates, for the printed page. */
function fillPaper(box, axes) {
  const pairs = axes.map((axis) => {
    const section = element("section", {}, element("h2", { textContent: `Joint ${axis.name}` }), ...axisSummary(axis));
    const best = axis.candidates[axis.chosen ?? 0];
    if (best) section.append(pairView(best, 350, { open: true }));
    return section;
  });
  box.replaceChildren(...pairs, element("section", {}, element("h2", { textContent: "Candidates" }), ...axes.map(printedTable)));
}

async function showSelection() {
  const selection = await readSelection();
  const [summary, side, comparison, pareto] = ["axis-summary", "pair", "comparison", "pareto"].map(byId);
  let current = null;
  let axis = null;
  const show = (candidate) => {
    if (candidate === current) return;
    current = candidate;
    side.replaceChildren(pairView(candidate, side.clientWidth));
  };
  const compare = (candidate, on) => {
    axis.picked = on ? [...axis.picked, candidate].slice(-2) : axis.picked.filter((each) => each !== candidate);
    showComparison(comparison, axis);
  };
  const table = makeCandidateTable({ show, compare });
  byId("candidates").append(table.box);
  for (const each of selection.axes) each.picked = each.candidates.slice(0, 2);
  const tabs = makeAxisTabs(selection.axes, (chosen) => {
    axis = chosen;
    current = null;
    summary.replaceChildren(...axisSummary(axis));
    if (!axis.candidates.length) side.replaceChildren(nothingToPlot("There is no candidate."));
    table.show(axis);
    showComparison(comparison, axis);
  });
  byId("candidates").prepend(tabs.bar);
  tabs.select(0);
  byId("system").append(selection.system.length ? useBars(selection.system, true) : nothingToPlot("No criterion of the whole robot was judged."));
  const drawPareto = () => pareto.replaceChildren(paretoChart(selection, Math.min(pareto.clientWidth, 720)));
  drawPareto();
  fillPaper(byId("paper-pairs"), selection.axes);
  window.bellcrank.selection = selection;  // for tests
  let width = document.body.clientWidth;
  new ResizeObserver(() => {
    if (document.body.clientWidth === width || !side.clientWidth) return;  // in print the chooser has no width
    width = document.body.clientWidth;
    side.replaceChildren(...current ? [pairView(current, side.clientWidth)] : []);
    showComparison(comparison, axis);
    drawPareto();
  }).observe(document.body);
}

const replayReady = window.bellcrank.ready;
window.bellcrank.ready = (byId("other-selection") ? compareSelections() : showSelection()).then(() => replayReady);
