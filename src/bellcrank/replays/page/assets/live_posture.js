// ---- a posture in which the joints of a sizing rest: torques that hold it, and their shares of limits

/** Sliders of joints, and the table of what each needs at rest there; the view shows the posture, translucent. */
function makePosture(owner, functions, view, film) {
  const { live } = owner;
  const posture = functions.view("posture");
  const start = functions.view("posture").slice();
  const first = functions.motions[0].begins;
  live.all_joints.forEach((_, k) => { posture[k] = start[k] = Math.min(Math.max(first[k], live.postures[k][0]), live.postures[k][1]); });
  const rows = live.joints.map(({ name }) => ({ name, torque: element("td", {}), use: element("td", { className: "use" }) }));
  const table = element("table", {}, element("thead", {}, element("tr", {}, ...["joint", "largest share of a limit", "torque at rest"].map((textContent) => element("th", { textContent })))),
    element("tbody", {}, ...rows.map(({ name, torque, use }) => element("tr", {}, element("th", { textContent: name, title: name }), use, torque))));
  const message = element("p", { className: "posture-message", role: "alert", hidden: true });
  const fields = live.all_joints.map((name, k) => {
    const [low, high, unit] = live.postures[k];
    return makeField(state(k, name, unit), { group: "posture", name, unit, range: [low, high] }, 0);
  });
  const box = element("details", { className: "posture" }, element("summary", { textContent: "posture: torques at rest" }), message,
    ...fields.map(({ row }) => row), element("div", { className: "wide" }, table),
    element("p", { className: "about", textContent: "Torques that hold the robot still in this posture, and shares of limits where it is held indefinitely. Friction, which may help to hold it, does not count." +
      (view ? " Drag a link of the translucent robot to turn its joint." : "") }));

  /** What a field needs of a state: one value, here that of a joint. */
  function state(k, name, unit) {
    return {
      get values() { return [posture[k]]; },
      get stored() { return [start[k]]; },
      tell: say,
      set([[, value]]) {
        const [low, high] = live.postures[k];
        if (value < low || value > high) return say(`posture, ${name}: ${value} ${unit} is out of the joint's range, expected ${formatNumber(low)} to ${formatNumber(high)} ${unit}`);
        posture[k] = value;
        say("");
        return show();
      },
    };
  }
  function say(text) {
    message.hidden = !text;
    message.textContent = text;
    for (const field of fields) field.show();
  }
  function show() {
    for (const field of fields) field.show();
    view?.showGhost(box.open ? { time: [0], ...poses() } : null);
    if (!box.open) return;
    const { torques, uses } = held();
    rows.forEach(({ torque, use }, k) => {
      const value = Math.abs(torques[k]) < NOISE * largest(torques) ? 0 : torques[k];
      torque.textContent = `${formatNumber(value)} ${live.joints[k].torque_unit}`;
      use.replaceChildren(...useBar(largestUse({ live, values: owner.values, result: { uses } }, k)));
    });
  }
  function poses() {
    functions.shapesAtPosture();
    const shown = functions.view("shapes");
    return { ...posesOf(shown, 1, 0, live.shapes.bodies), stretch: live.shapes.stretch.map(([body, place]) => [body, [...shown.subarray(place, place + 9)]]) };
  }
  /** Torques of the joints at rest, and the uses of limits of a cycle that only rests there. */
  function held() {
    functions.view("settings").set(owner.values);
    functions.atPosture();
    functions.view("most").set(functions.view("sizes"));
    functions.view("mean").set(functions.view("rates"));
    functions.verdict();
    return { torques: functions.view("shown").slice(0, live.joints.length), uses: functions.view("uses").map((use) => (use < NOISE ? 0 : use)) };
  }
  const button = byId("jog-button");
  button.hidden = !view;
  button.onclick = () => { box.open = !box.open; };
  box.addEventListener("toggle", () => {
    button.ariaPressed = String(box.open);
    show();
  });
  const made = { box, show, held, poses, set: (pairs) => { for (const [k, value] of pairs) state(k, live.all_joints[k], live.postures[k][2]).set([[0, value]]); }, get values() { return [...posture.subarray(0, live.all_joints.length)]; } };
  if (view) makeDrag({ live, film, posture: made, view });
  return made;
}
