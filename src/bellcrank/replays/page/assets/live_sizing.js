// ---- a page that computes a sizing: its film follows the settings: times, charts, torque-speed planes and facts

const liveKind = {
  noun: "sizing",
  agrees: 1e-6,  // relative: the judge takes inertias at samples of its grid, and a page between them too
  open: /^motor|^parameters|^payload|^speed/,  // groups of settings that are open at first
  async load(live) {
    const functions = await loadFunctions(live);
    Object.assign(live, { loaded: functions.motions, functions });
    return (values) => compute(live, functions, values);
  },
  agreement: agreementOf,
  about: ({ agreement, live }, agrees) => (agrees
    ? `On opening, this page computed the sizing again: peak and RMS torques, speeds and shares of limits differ from those of bellcrank by at most ${agreement.toExponential(1)}. Not recomputed: ${live.not_recomputed.join(", ")}.`
    : `On opening, this page computed the sizing again, and its figures differ from those of bellcrank by ${agreement.toExponential(1)}. Therefore it only replays.`),
  summary: makeJudgement,
  follower: makeFollowers,
  facade: (state) => ({
    get limits() { return usesOf(state).map(([joint, name, place]) => [state.live.joints[joint].name, name, place]); },
    get result() { return { figures: [...state.result.figures], uses: [...state.result.uses], exceeded: [...state.result.exceeded] }; },
    get verdict() { return verdictOf(state); },
    /** Set positions of joints at rest, pairs of a number of a joint and a value, and what holds them there. */
    rest(pairs) {
      const { set, held, poses } = state.live.posture;
      set(pairs);
      const { torques, uses } = held();
      return { values: state.live.posture.values, torques: [...torques], uses: [...uses], positions: [...poses().positions] };
    },
    get samples() { return state.result.motions.map(({ samples }) => samples.length); },
  }),
};

/** A function that makes everything else on the page follow the state. */
function makeFollowers({ film, player, view, set, panel, charts, state }) {
  const { live } = state;
  const copy = (time) => Float64Array.from(time);
  const original = {
    time: copy(film.time), events: [...film.events],
    positions: film.positions, quaternions: film.quaternions, springs: film.springs.map(({ ends }) => ends), rods: film.rods.map(({ ends }) => ends),
    traces: film.traces.map(({ segments }) => segments.map((segment) => ({ ...segment, time: copy(segment.time) }))),
    arrows: film.arrows.map(({ time }) => copy(time)),
    charts: charts.charts.map(({ chart }) => ({ time: copy(chart.time), columns: chart.lines.map(({ values }) => Float64Array.from(values)) })),
    xy: film.xy_plots.map(({ limits }) => limits.map((limit) => ({ ...limit }))),
    titles: charts.plots.filter(({ data }) => data).map(({ title }) => title.textContent),
    facts: [...byId("facts").children], bad: byId("facts").classList.contains("bad"),
  };
  const planes = charts.plots.filter(({ data }) => data);
  const hidden = [];  // layers of arrows, which are those of the stored values
  if (live.postures) {
    live.posture = makePosture(state, live.functions, view, film);
    byId("live-panel").querySelector(".groups").append(live.posture.box);
  }
  return () => {
    const times = newTimes(live, state.result);
    const map = (values) => values.map(times.at);
    let moved = { ...original, stretch: [] };
    try {
      if (state.changed.some((k) => live.moving.includes(k))) moved = movedShapes(live, original);
    } catch (error) {
      if (!(error instanceof RangeError)) throw error;
      state.tell(`the view shows the motion of the sizing, without the changes: ${error.message}`);
    }
    const motion = { ...moved, time: map(original.time), traces: moved.traces.map((segments) => segments.map((segment) => ({ ...segment, time: map(segment.time) }))) };
    film.arrows.forEach((arrow, k) => { arrow.time = map(original.arrows[k]); });
    const changed = state.changed.length > 0;
    document.body.classList.toggle("changed", changed);
    const kept = original.events.filter(({ text }) => !changed || /^motion .* begins$/s.test(text));
    film.events.splice(0, film.events.length, ...kept.map((event) => ({ ...event, time: times.at(event.time) })));
    showArrows(changed);
    charts.range.splice(0, 2, times.at(charts.storedRange[0]), times.at(charts.storedRange[1]));
    const curves = curvesOf(live, state.result, times);
    charts.charts.forEach((drawn, k) => drawn.replace(...columnsOf(drawn.chart, curves, live, map, original.charts[k])));
    planes.forEach((plane, joint) => {
      const own = live.choices?.joints[joint];
      const chosen = own?.planes.length ? own.planes[state.values[own.setting]] : null;
      const points = original.xy[joint].filter((limit) => limit.points.length === 2);
      const limits = chosen ? [...chosen.limits.map((k) => ({ name: live.choices.lines[k][0], points: Float64Array.from(live.choices.lines[k][1]) })), ...points] : original.xy[joint];
      plane.replace(planeOf(live, state.result, curves, joint, limits));
      if (chosen) plane.title.textContent = original.titles[joint].replace(/ratio [^ ]*$/, chosen.title.slice(chosen.title.lastIndexOf("ratio ")));
      const ratio = live.settings.findIndex(({ group, name }) => group === "gear ratio" && name === live.joints[joint].name);
      if (ratio >= 0) plane.title.textContent = original.titles[joint].replace(/ratio [^ ]*$/, `ratio ${formatNumber(state.values[ratio], 6)}`);
    });
    player.setEnds(motion.time[0], motion.time.at(-1));
    charts.showAll();
    const events = panel.querySelector(".events");
    events?.replaceChildren(...makeEvents(film, player).children);
    if (view) view.showMotion(motion); else film.time = motion.time;
    live.posture?.show();
    charts.follow();
    showFacts(changed);
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

  function showFacts(changed) {
    const facts = byId("facts");
    if (!changed) {
      facts.replaceChildren(...original.facts);
      facts.classList.toggle("bad", original.bad);
      return;
    }
    const { word, good, sentences, open } = verdictOf(state);
    const names = live.joints.map(({ name }) => name);
    const [n, { figures }] = [names.length, state.result];
    const pair = (name, value) => element("div", {}, element("dt", { textContent: name }), element("dd", { textContent: value }));
    const kept = original.facts.filter((each) => ["motions", "robot", "bellcrank"].includes(each.firstChild.textContent));
    facts.replaceChildren(pair("verdict for the changed values", [word, ...sentences.slice(0, 1)].join(": ")),
      ...open.length ? [pair("not recomputed", open.join("; "))] : [],
      ...names.map((name, k) => pair(name, `peak ${formatNumber(figures[k])} ${live.joints[k].torque_unit}, RMS ${formatNumber(figures[n + k])} ${live.joints[k].torque_unit}`)), ...kept);
    facts.classList.toggle("bad", good === false);
  }
}

/** What the view shows of the motions with other lengths, at the times of the film before any change of speeds. */
function movedShapes({ motions, functions, shapes: { bodies, stretch, traces, springs, rods }, shapes_size: width }, { time, traces: drawn }) {
  const shown = functions.view("shapes");
  const inFilm = (t) => {
    let k = motions.length - 1;
    while (k > 0 && t < motions[k].start) k--;
    const { start, begin, duration } = motions[k];
    functions.shapesAt(functions.motions[k], begin + Math.min(Math.max(t - start, 0), duration));
  };
  const rows = new Float64Array(width * time.length);
  time.forEach((t, i) => {
    inFilm(t);
    rows.set(shown, width * i);
  });
  const columns = (place, count) => Float32Array.from({ length: count * time.length }, (_, i) => rows[width * Math.floor(i / count) + place + i % count]);
  const points = (times, place) => {
    const found = new Float32Array(3 * times.length);
    times.forEach((t, i) => {
      inFilm(t);
      found.set(shown.subarray(place, place + 3), 3 * i);
    });
    return found;
  };
  return { ...posesOf(rows, time.length, width, bodies), traces: drawn.map((segments, k) => segments.map((segment) => ({ ...segment, points: points(segment.time, traces[k]) }))),
    springs: springs.map((place) => columns(place, 6)), rods: rods.map((place) => columns(place, 6)),
    stretch: stretch.map(([body, place]) => [body, [...rows.subarray(place, place + 9)]]) };
}

/** The film's times after a change of speeds: of a time before, and of a time in a motion. */
function newTimes(live, result) {
  let start = live.motions[0].start;
  const starts = live.motions.map((motion, k) => {
    const begin = start;
    const next = live.motions[k + 1];
    start += motion.duration / result.motions[k].factor + (next ? next.start - motion.start - motion.duration : 0);
    return begin;
  });
  const last = live.motions.length - 1;
  return {
    inMotion: (k, t) => starts[k] + (t - live.motions[k].begin) / result.motions[k].factor,
    at(t) {
      let k = last;
      while (k > 0 && t < live.motions[k].start) k--;
      const { start: before, duration } = live.motions[k];
      const inside = Math.min(Math.max(t - before, 0), duration);
      return starts[k] + inside / result.motions[k].factor + (t - before - inside);
    },
  };
}

/** What is shown over time: times, and a column of each number that `shown` has; a gap between two motions. */
function curvesOf(live, result, times) {
  const [width] = live.sizes;
  const gaps = result.motions.length - 1;
  const count = result.motions.reduce((sum, { samples }) => sum + samples.length, gaps);
  const time = new Float64Array(count);
  const columns = Array.from({ length: width }, () => new Float64Array(count));
  let at = 0;
  result.motions.forEach(({ samples }, k) => {
    const motion = live.loaded[k];
    if (k) {
      time[at] = time[at - 1];
      for (const column of columns) column[at] = NaN;
      at++;
    }
    for (const { piece, s, shown } of samples) {
      const { quintic } = motion.pieces[piece];
      time[at] = times.inMotion(k, motion.time[quintic] + s * motion.length[quintic]);
      for (let j = 0; j < width; j++) columns[j][at] = shown[j];
      at++;
    }
  });
  return { time, columns };
}

/** Times and columns of a chart: computed ones of torques, velocities, accelerations, and positions where lengths move them. */
function columnsOf(chart, curves, live, map, before) {
  const [k, n] = [live.joints.length, live.all_joints.length];
  const kinds = [/^joint torque|^joint force/, /^velocity/, /^acceleration/, ...live.closed ? [/^position/] : []];
  const kind = kinds.findIndex((title) => title.test(chart.title));
  if (kind < 0) return [map(before.time), before.columns];
  const names = kind === 0 ? live.joints.map(({ name }) => name) : live.all_joints;
  const first = [0, k, k + n, 3 * k + 2 * n][kind];
  return [curves.time, chart.lines.map(({ name }) => curves.columns[first + names.indexOf(name)] ?? new Float64Array(curves.time.length).fill(NaN))];
}

/** The curve in the torque-speed plane of a joint, and its limits with new points of the RMS torque. */
function planeOf(live, result, { time, columns }, joint, limits) {
  const [k, n] = [live.joints.length, live.all_joints.length];
  const points = limits.filter((limit) => limit.points.length === 2).length;
  let number = 0;
  const moved = limits.map((limit) => {
    if (limit.points.length !== 2) return limit;
    const motion = points === result.motions.length ? result.motions[number++] : null;
    const [torque, speed] = live.joints[joint].at_shaft ? [4, 5] : [1, 5];
    return { ...limit, points: motion ? Float64Array.of(motion.figures[speed * k + joint], motion.figures[torque * k + joint]) : Float64Array.of(NaN, NaN) };
  });
  return { time, x: columns[k + 2 * n + joint], y: columns[2 * k + 2 * n + joint], limits: moved };
}
