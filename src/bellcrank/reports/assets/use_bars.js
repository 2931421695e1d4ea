// ---- a bar of utilisation for each criterion

const LIMIT = 80;  // % of a bar's width where the limit is
const WORDS = { exceeded: "▲ over", unknown: "unknown", note: "note" };

/** A utilisation in %, which says on which side of the limit it is where rounding would hide that. */
function inPercent(use) {
  const text = formatNumber(100 * use, use < 0.0995 ? 2 : 3);
  return text !== "100" || use === 1 ? text : use > 1 ? "> 100" : "< 100";
}

const percent = (use) => (use === null ? "unknown" : `${inPercent(use)} %`);

/** The use of a criterion, with its verdict where it is not inside. */
const useText = ({ use, verdict }) => (verdict === "inside" || use === null || verdict === "note" ? WORDS[verdict] ?? percent(use)
  : verdict === "unknown" ? `unknown (${percent(use)})` : `${percent(use)} ${WORDS.exceeded}`);

/** The criteria of a pair or of the system; the first, which binds, shows its load and limit, the others where they are pressed or all with `open`. */
function useBars(criteria, open = false) {
  const list = element("ol", { className: "uses" });
  const order = { exceeded: 0, inside: 1, unknown: 2, note: 3 };
  const sorted = [...criteria].sort((a, b) => order[a.verdict] - order[b.verdict] || (b.use ?? 0) - (a.use ?? 0));
  for (const [k, criterion] of sorted.entries()) {
    const { name, use, verdict, text } = criterion;
    const shown = open || k === 0;
    const fill = element("i", { className: "fill" });
    if (verdict !== "note") fill.style.width = use === null ? "100%" : `${Math.min(Math.max(use, 0) * LIMIT, 100)}%`;
    const bar = element("span", { className: "bar-track", ariaHidden: "true" }, fill);
    const sentence = element("span", { className: "sentence", textContent: text, hidden: !shown });
    const button = element("button", { className: "use", type: "button", ariaExpanded: String(shown) },
      element("span", { className: "criterion", textContent: name }), bar, element("span", { className: "value", textContent: useText(criterion) }));
    button.onclick = () => {
      sentence.hidden = !sentence.hidden;
      button.ariaExpanded = String(!sentence.hidden);
    };
    list.append(element("li", { className: verdict }, button, sentence));
  }
  return list;
}
