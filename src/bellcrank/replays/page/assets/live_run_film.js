// ---- the film of a run that the page has computed: poses, traces, charts with the run of the file behind them, events, facts

/** A function that makes everything else on the page follow the state. */
function makeRunFollower({ film, player, view, set, panel, charts, state }) {
  const { live } = state;
  const facts = byId("facts");
  const original = {
    motion: { time: film.time, positions: film.positions, quaternions: film.quaternions, traces: film.traces.map(({ segments }) => segments),
      springs: film.springs.map(({ ends }) => ends), rods: film.rods.map(({ ends }) => ends), stretch: stretchOf(live, state.result) },
    events: [...film.events], range: [...charts.range], facts: [...facts.children], bad: facts.classList.contains("bad"),
    charts: charts.charts.map(({ chart }) => ({ time: chart.time, columns: chart.lines.map(({ values }) => values) })),
  };
  const hidden = [];  // layers of arrows, which are those of the run of the file
  view?.showMotion(original.motion);  // lengths that parameters set are not those of the shapes
  return () => {
    const found = state.result;
    const changed = state.changed.length > 0;
    document.body.classList.toggle("changed", changed);
    film.events.splice(0, film.events.length, ...(changed ? eventsOf(live, found) : original.events));
    const motion = changed ? motionOf(live, found) : original.motion;
    showArrows(changed);
    if (view) {
      view.showGhost(changed ? original.motion : null);
      view.showMotion(motion);
    } else Object.assign(film, { time: motion.time });
    charts.range.splice(0, 2, original.range[0], changed ? Math.max(original.range[1], found.end) : original.range[1]);
    charts.charts.forEach((drawn, k) => {
      const before = original.charts[k];
      drawn.title.textContent = drawn.chart.title.replace(/\(drift [^)]*\)/, (text) => (changed ? `(drift ${found.drift.toExponential(1)})` : text));
      if (!changed) return drawn.replace(before.time, before.columns);
      const columns = live.charts[k].map((place) => shownColumn(found, live.shown, place));
      const both = { lines: [...columns.map((samples) => ({ time: found.time, samples })), ...before.columns.map((samples) => ({ time: before.time, samples }))] };
      alignTimes(both);
      const values = both.lines.map((line) => endedAt(line, both.time));
      return drawn.replace(both.time, values.slice(0, columns.length), values.slice(columns.length));
    });
    player.setEnds(film.time[0], film.time.at(-1));
    charts.showAll();
    showEvents();
    view?.refresh();
    charts.follow();
    showFacts(changed, found);
  };

  function showArrows(changed) {
    if (!view) return;
    if (changed && !hidden.length) {
      for (const layer of view.layers) if (layer.group === "Arrows" && layer.on) hidden.push(layer);
      for (const layer of hidden) set(layer, false);
    } else if (!changed) {
      for (const layer of hidden.splice(0)) set(layer, true);
    }
  }

  function showEvents() {
    const section = makeEvents(film, player);
    const there = panel.querySelector(".events");
    if (there) there.replaceChildren(...section.children);
    else if (film.events.length) panel.querySelector(".notes").before(section);
  }

  function showFacts(changed, found) {
    if (!changed) {
      facts.replaceChildren(...original.facts);
      facts.classList.toggle("bad", original.bad);
      return;
    }
    const pair = ([name, value]) => element("div", {}, element("dt", { textContent: name }), element("dd", { textContent: value }));
    const [text, good] = endOf(live, found);
    const kept = original.facts.filter((each) => ["solver", "bellcrank"].includes(each.firstChild.textContent));
    facts.replaceChildren(pair(["changed values", text]), ...figuresOf(live, found).map(pair), ...kept);
    facts.classList.toggle("bad", !good);
  }
}

/** The values of a line, which has none after its own end. */
function endedAt(line, times) {
  const end = line.time.at(-1);
  return times.at(-1) <= end ? line.values : line.values.map((value, i) => (times[i] > end ? NaN : value));
}

const eventsOf = (live, found) => {
  const events = [...found.eventTime].map((time, k) => {
    const [name, stops] = live.events[found.eventIndex[k]];
    return { time, text: stops ? `${name}, which ended the run` : name };
  });
  const [text, good] = endOf(live, found);
  return good ? events : [...events, { time: found.end, text }];
};

/** The maps of the shapes of bodies whose points follow parameters, as `showMotion` of the view takes them. */
const stretchOf = ({ stretch }, { shown }) => stretch.map(([body, place]) => [body, [...shown.subarray(place, place + 9)]]);

/** What the view needs: poses of the bodies, and points of traces, springs and rods. */
function motionOf(live, found) {
  const { rows, shown, time } = found;
  const { bodies, shown: width } = live;
  const points = (place, count) => {
    const made = new Float32Array(count * rows);
    for (let i = 0; i < rows; i++) made.set(shown.subarray(width * i + place, width * i + place + count), count * i);
    return made;
  };
  return { time, ...posesOf(shown, rows, width, bodies), traces: live.traces.map((place) => [{ time, points: points(place, 3) }]),
    springs: live.springs.map((place) => points(place, 6)), rods: live.rods.map((place) => points(place, 6)), stretch: stretchOf(live, found) };
}
