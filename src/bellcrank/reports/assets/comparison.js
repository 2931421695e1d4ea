// ---- two pairs side by side

/** The comparison of the pairs that are picked in the table of an axis. */
function showComparison(box, { name, picked }) {
  const heading = element("h2", { textContent: `Comparison for ${name}` });
  if (picked.length < 2) {
    box.replaceChildren(heading, element("p", { className: "hint", textContent: "Mark two pairs in the first column of the table to compare them here." }));
    return;
  }
  const [first, second] = picked;
  const rows = pairFigures(first).map(([title, value], k) => [title, value, pairFigures(second)[k][1]]);
  const table = element("table", { className: "compared" },
    element("thead", {}, element("tr", {}, element("td", {}), ...picked.map((each) => element("th", { scope: "col", textContent: each.name })))),
    element("tbody", {}, ...rows.map(([title, ...values]) => element("tr", { className: values[0] === values[1] ? "" : "differs" },
      element("th", { scope: "row", textContent: title }), ...values.map((value) => element("td", { textContent: value }))))));
  const sides = element("div", { className: "sides" });
  box.replaceChildren(heading, element("div", { className: "wide" }, table), sides);
  const width = Math.max(Math.min((sides.clientWidth - 24) / (sides.clientWidth > 720 ? 2 : 1), 620), 280);
  sides.append(...picked.map((each) => pairView(each, width, { figures: false })));
}
