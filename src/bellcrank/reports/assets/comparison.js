// ---- two pairs side by side

const ALIKE = 4;  // ratio of reaches up to which two planes have the same axes

/** The reaches of the planes of two pairs: the same where they are alike. */
function commonReaches(details) {
  const [first, second] = details.map(planeReach);
  const common = first.map((a, k) => (Math.max(a, second[k]) <= ALIKE * Math.min(a, second[k]) ? Math.max(a, second[k]) : null));
  return [first, second].map((reach) => reach.map((own, k) => common[k] ?? own));
}

/** The comparison of the pairs that are picked in the table of an axis. */
function showComparison(box, { name, picked }) {
  const heading = element("h2", { textContent: `Comparison for ${name}` });
  if (picked.length < 2) {
    box.replaceChildren(heading, element("p", { className: "hint", textContent: "Mark two pairs in the first column of the table to compare them here." }));
    return;
  }
  const [first, second] = picked;
  const others = new Map(pairFigures(second));
  const titles = new Set([...pairFigures(first), ...others].map(([title]) => title));
  const own = new Map(pairFigures(first));
  const rows = [...titles].map((title) => [title, own.get(title) ?? "none", others.get(title) ?? "none"]);
  const table = element("table", { className: "compared" },
    element("thead", {}, element("tr", {}, element("td", {}), ...picked.map((each) => element("th", { scope: "col", textContent: each.name })))),
    element("tbody", {}, ...rows.map(([title, ...values]) => element("tr", { className: values[0] === values[1] ? "" : "differs" },
      element("th", { scope: "row", textContent: title }), ...values.map((value) => element("td", { textContent: value }))))));
  const reaches = commonReaches(picked.map((each) => each.detail()));
  const sides = element("div", { className: "sides" });
  box.replaceChildren(heading, element("div", { className: "wide" }, table), sides);
  const width = Math.max(Math.min((sides.clientWidth - 24) / (sides.clientWidth > 720 ? 2 : 1), 620), 280);
  sides.append(...picked.map((each, k) => pairView(each, width, { figures: false, reach: reaches[k] })));
}
