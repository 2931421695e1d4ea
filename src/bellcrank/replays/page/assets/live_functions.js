// ---- the functions of a sizing as WebAssembly: sizing/live_sizing.py says what they return

const STACK = 1 << 20;  // bytes of scratch memory, below everything else

/** The functions, and the motions in their memory; live_film.py says in which order they stand in the page. */
async function loadFunctions(live) {
  const bytes = await window.bellcrank.inflated("live");
  const [first, second] = live.modules;
  const numbers = decodePlanes(bytes.subarray(first + second));
  const width = 3 * live.all_joints.length;
  const [shown, sizes, rates, figures, uses] = live.sizes;
  const vectors = { place: 2, still: live.all_joints.length, speed: 1, settings: live.settings.length, shown, sizes, rates, most: sizes, mean: rates, figures, uses, exceeded: uses };
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
    const signs = next(live.all_joints.length * motion.pieces);
    const rests = next(width * motion.rests);
    const states = take(2 * width * quintics);
    for (let i = 0; i < quintics; i++) for (let j = 0; j < 2 * width; j++) doubles[states + 2 * width * i + j] = columns[quintics * j + i];
    const pieces = Array.from({ length: motion.pieces }, (_, k) => ({ quintic: cuts[3 * k], low: cuts[3 * k + 1], high: cuts[3 * k + 2] }));
    const sides = take(signs.length);
    doubles.set(signs, sides);
    const still = take(rests.length);
    doubles.set(rests, still);
    return { ...motion, loads: live.joints.length, time, length, pieces, states, sides, still };
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
  const sample = await evaluate(bytes.slice(0, first), ["begin", "end", "place", "still", "speed", "settings"], ["shown", "sizes", "rates"], table);
  const verdict = await evaluate(bytes.slice(first, first + second), ["most", "mean", "settings"], ["figures", "uses", "exceeded"], table + 32);
  const [place, speed] = [view("place"), view("speed")];
  const evaluateAt = (begin, end, s, length, side, factor) => {
    [words[table], words[table + 1], words[table + 3]] = [8 * begin, 8 * end, 8 * side];
    [place[0], place[1], speed[0]] = [s, length, factor];
    sample();
  };
  return {
    motions, view, verdict,
    /** Results at a share s of the quintic of a piece of a motion, whose speed is multiplied by a factor. */
    at(motion, piece, s, factor) {
      const { quintic } = motion.pieces[piece];
      const begin = motion.states + 2 * width * quintic;
      evaluateAt(begin, begin + width, s, motion.length[quintic], motion.sides + live.all_joints.length * piece, factor);
    },
    /** Results where a motion rests before or after it. */
    atRest: (motion, k, factor) => evaluateAt(motion.still + width * k, motion.still + width * k, 0, 1, places.still, factor),
  };
}
