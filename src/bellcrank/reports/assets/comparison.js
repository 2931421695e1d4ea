// ---- two pairs side by side

const ALIKE = 4;  // ratio of reaches up to which two planes have the same axes

/** The reaches of the planes of two pairs: the same where they are alike. */
function commonReaches(details) {
  const [first, second] = details.map(planeReach);
  const common = first.map((a, k) => (Math.max(a, second[k]) <= ALIKE * Math.min(a, second[k]) ? Math.max(a, second[k]) : null));
  return [first, second].map((reach) => reach.map((own, k) => common[k] ?? own));
}

/** (name, value) of all that two pairs are compared by: their figures, and the use of each criterion that is judged. */
const comparedFigures = (pair) => [...pairFigures(pair),
  ...pair.criteria.filter(({ verdict }) => verdict !== "note").map((each) => [each.name, useText(each)]), ...pairOrigins(pair)];

/** The comparison of the pairs that are picked for an axis; `of` says of which selection each is, where they are of two. */
function showComparison(box, { name, picked, of = [] }) {
  const heading = element("h2", { textContent: `Comparison for ${name}` });
  if (picked.length < 2) {
    box.replaceChildren(heading, element("p", { className: "hint", textContent: "Mark two pairs in the first column of the table to compare them here." }));
    return;
  }
  const figures = picked.map((each) => new Map(each ? comparedFigures(each) : []));
  const cell = (value, differs) => element("td", {}, differs ? element("mark", { textContent: value }) : value);
  const rows = [...new Set(figures.flatMap((each) => [...each.keys()]))].map((title) => {
    const values = figures.map((each) => each.get(title) ?? "none");
    return element("tr", {}, element("th", { scope: "row", textContent: title }), ...values.map((value) => cell(value, values[0] !== values[1])));
  });
  const table = element("table", { className: "compared" },
    element("thead", {}, element("tr", {}, element("td", {}), ...picked.map((each, k) => element("th", { scope: "col" },
      ...of.length ? [element("b", { textContent: of[k] }), element("br", {})] : [], each?.name ?? "nothing fits")))),
    element("tbody", {}, ...rows));
  const pairs = picked.filter(Boolean);
  const reaches = pairs.length < 2 ? [null] : commonReaches(pairs.map((each) => each.detail()));
  const sides = element("div", { className: "sides" });
  box.replaceChildren(heading, element("div", {}, table), sides);
  const width = Math.max(Math.min((sides.clientWidth - 24) / (sides.clientWidth > 720 ? 2 : 1), 620), 280);
  sides.append(...pairs.map((each, k) => pairView(each, width, { figures: false, reach: reaches[k], of: of[picked.indexOf(each)] })));
}

/** The page of two selections: for each joint, what each of them chose for it. */
async function compareSelections() {
  const box = byId("comparison");
  const of = [box.dataset.first, box.dataset.second];
  const both = await Promise.all(["selection", "other-selection"].map(readSelection));
  const names = [...new Set(both.flatMap(({ axes }) => axes.map(({ name }) => name)))];
  const axes = names.map((name, number) => {
    const picked = both.map((one) => one.axes.find((axis) => axis.name === name)?.candidates[0] ?? null);
    const worst = picked.includes(null) ? null : Math.max(...picked.map(({ tier }) => Object.keys(SIGNS).indexOf(tier)));
    return { name, number, picked, of, tier: worst === null ? "fails" : Object.keys(SIGNS)[worst] };
  });
  let axis = null;
  const tabs = makeAxisTabs(axes, (chosen) => {
    axis = chosen;
    showComparison(box, axis);
  });
  box.before(element("section", { className: "selection tabs-of-both" }, element("h2", { textContent: "Joint by joint" }), tabs.bar));
  tabs.select(0);
  byId("paper-pairs").replaceChildren(...axes.map((each) => {
    const section = element("section", {});
    showComparison(section, each);
    return section;
  }));
  window.bellcrank.selections = both;  // for tests
  let width = box.clientWidth;
  new ResizeObserver(() => {
    if (box.clientWidth === width || !box.clientWidth) return;  // in print it has no width
    width = box.clientWidth;
    showComparison(box, axis);
  }).observe(document.body);
}
