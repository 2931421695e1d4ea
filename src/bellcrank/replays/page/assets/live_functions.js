// ---- the functions of a sizing as WebAssembly: sizing/live/live_sizing.py says what they return

const STACK = 1 << 20;  // bytes of scratch memory, below everything else

/** The functions, and the motions in their memory; live_film.py says in which order they stand in the page. */
async function loadFunctions(live) {
  const bytes = await window.bellcrank.inflated("live");
  let read = 0;
  const [sampleCode, verdictCode, shapesCode, closeCode] = live.modules.map((length) => bytes.slice(read, read += length));
  const numbers = decodePlanes(bytes.subarray(read));
  const [degrees, width] = [live.all_joints.length, 3 * live.coordinates];
  const [shown, sizes, rates, figures, uses] = live.sizes;
  const vectors = { place: 2, still: degrees, speed: 1, settings: live.settings.length, shown, sizes, rates, most: sizes, mean: rates, figures, uses, exceeded: uses, posture: width,
    shapes: live.shapes_size, closed: live.closed, next: live.closed, about: 4, follows: live.closed, between: live.settings.length };
  const room = 8 * (numbers.length + 64 + Object.values(vectors).reduce((sum, size) => sum + size + 1, 0));
  const memory = new WebAssembly.Memory({ initial: Math.ceil((STACK + room) / 65536) });
  const [words, doubles] = [new Uint32Array(memory.buffer), new Float64Array(memory.buffer)];
  let free = STACK / 8 + 64;  // the first 64 places hold addresses
  const take = (size) => (free += size) - size;
  const places = Object.fromEntries(Object.entries(vectors).map(([name, size]) => [name, take(size)]));
  const view = (name) => doubles.subarray(places[name], places[name] + vectors[name]);

  let at = 0;
  const motions = live.motions.map((motion) => {
    const next = (count) => numbers.subarray(at, at += count);
    const { quintics } = motion;
    const [time, length, columns, cuts] = [quintics, quintics, 2 * width * quintics, 3 * motion.pieces].map(next);
    const signs = next(degrees * motion.pieces);
    const rests = next(width * motion.rests);
    const states = take(2 * width * quintics);
    for (let i = 0; i < quintics; i++) for (let j = 0; j < 2 * width; j++) doubles[states + 2 * width * i + j] = columns[quintics * j + i];
    const pieces = Array.from({ length: motion.pieces }, (_, k) => ({ quintic: cuts[3 * k], low: cuts[3 * k + 1], high: cuts[3 * k + 2] }));
    const sides = take(signs.length);
    doubles.set(signs, sides);
    const still = take(rests.length);
    doubles.set(rests, still);
    return { ...motion, begins: doubles.slice(states, states + degrees), loads: live.joints.length, time, length, pieces, states, sides, still };
  });

  const env = { ...Object.fromEntries(Object.getOwnPropertyNames(Math).map((name) => [name, Math[name]])), fmod: (a, b) => a % b,
    __linear_memory: memory, __stack_pointer: new WebAssembly.Global({ value: "i32", mutable: true }, STACK) };
  const evaluate = async (code, inputs, outputs, table) => {
    const { instance } = await WebAssembly.instantiate(code, { env });
    [...inputs, ...outputs].forEach((name, k) => { words[table + k] = 8 * (places[name] ?? 0); });
    return () => {
      if (instance.exports.evaluate(4 * table, 4 * (table + inputs.length))) throw new Error("the compiled functions failed");
    };
  };
  const table = STACK / 4;
  const closing = live.closed ? ["closed"] : [];
  const sample = await evaluate(sampleCode, ["begin", "end", "place", "still", "speed", "settings", ...closing], ["shown", "sizes", "rates"], table);
  const verdict = await evaluate(verdictCode, ["most", "mean", "settings"], ["figures", "uses", "exceeded"], table + 16);
  const shapes = shapesCode.length ? await evaluate(shapesCode, ["begin", "end", "place", "settings", ...closing], ["shapes"], table + 32) : null;
  const step = closeCode.length ? await evaluate(closeCode, ["begin", "end", "place", "between", "closed"], ["next", "about", "follows"], table + 48) : null;
  const stored = Float64Array.from(live.settings, ({ value }) => value);
  const close = step && makeClosing(step, { ...Object.fromEntries(["settings", "between", "closed", "next", "about"].map((name) => [name, view(name)])), posture: view("follows") }, stored, live.closing);
  const [place, speed] = [view("place"), view("speed")];
  /** Put a place in a motion, a share s of a quintic that lasts some time, where the functions read it. */
  const goTo = (begin, end, s, length) => {
    for (const at of [table, table + 32, table + 48]) [words[at], words[at + 1]] = [8 * begin, 8 * end];
    [place[0], place[1]] = [s, length];
    if (close && !close()) throw new RangeError("the linkage cannot be assembled all along the motions, or comes to a dead point");
  };
  const evaluateAt = (begin, end, s, length, side, factor) => {
    goTo(begin, end, s, length);
    words[table + 3] = 8 * side;
    speed[0] = factor;
    sample();
  };
  const quinticOf = (motion, quintic) => motion.states + 2 * width * quintic;
  return {
    motions, view, verdict,
    /** Results at a share s of the quintic of a piece of a motion, whose speed is multiplied by a factor. */
    at(motion, piece, s, factor) {
      const { quintic } = motion.pieces[piece];
      const begin = quinticOf(motion, quintic);
      evaluateAt(begin, begin + width, s, motion.length[quintic], motion.sides + degrees * piece, factor);
    },
    /** What the view shows at a time of a motion. */
    shapesAt(motion, time) {
      const quintic = indexAt(motion.time, time);
      const begin = quinticOf(motion, quintic);
      const length = motion.length[quintic];
      goTo(begin, begin + width, Math.min(Math.max((time - motion.time[quintic]) / length, 0), 1), length);
      shapes();
    },
    /** What the view shows in the posture that `view("posture")` begins with. */
    shapesAtPosture() {
      goTo(places.posture, places.posture, 0, 1);
      shapes();
    },
    /** Results at rest in the posture that `view("posture")` begins with; its speeds and accelerations are 0. */
    atPosture: () => evaluateAt(places.posture, places.posture, 0, 1, places.still, 1),
    /** Results where a motion rests before or after it. */
    atRest: (motion, k, factor) => evaluateAt(motion.still + width * k, motion.still + width * k, 0, 1, places.still, factor),
  };
}
