// ---- the still of a report: the view at its most telling time, which stands for it on paper

/** Draws it once, when all else is there, and leaves the player at its time. */
function drawStill(figure) {
  const b = window.bellcrank;
  const before = b.time;
  b.seek(Number(figure.dataset.time));
  figure.querySelector("img").src = b.capture(true);
  b.seek(before);
  figure.hidden = false;
}

if (byId("still")) {
  window.bellcrank.ready = window.bellcrank.ready.then(() => { if (byId("pane").firstChild) drawStill(byId("still")); });
}
