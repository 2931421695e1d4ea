// ---- the still of a report: the view at a characteristic time, for the printed page

/** Draws it once, after everything else, and restores the time of the player. */
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
