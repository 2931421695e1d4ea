// ---- what runs in the worker of a page that computes a run: the engine (page_engine.cpp) and the functions of a scene

/** Answers messages in the scope of a worker. Its text becomes the worker's script, so that it names nothing outside. */
function liveWorker(scope) {
  const STACK = 1 << 20;  // bytes of scratch memory of the functions
  const FIGURES = ["refused", "place", "value", "status", "end", "accepted", "rejected", "evaluations", "stiff", "doubtful", "rows", "time", "state",
    "shown", "events", "eventTime", "eventIndex", "eventShown", "drift"];  // as page_run writes them
  let engine = null;
  let settings = 0;  // where the engine has them
  let deadline = 0;

  function load({ code, modules, description }) {
    const { exports } = new WebAssembly.Instance(new WebAssembly.Module(code), { env: { late: () => (performance.now() > deadline ? 1 : 0) } });
    exports._initialize();
    const { memory, __indirect_function_table: table } = exports;
    const env = { ...Object.fromEntries(Object.getOwnPropertyNames(Math).map((name) => [name, Math[name]])), fmod: (a, b) => a % b,
      __linear_memory: memory, __stack_pointer: new WebAssembly.Global({ value: "i32", mutable: true }, exports.page_memory(STACK) + STACK & ~63) };
    const places = modules.map((bytes) => {
      if (!bytes.length) return 0;
      const place = table.grow(1);
      table.set(place, new WebAssembly.Instance(new WebAssembly.Module(bytes), { env }).exports.evaluate);
      return place;
    });
    const kernels = exports.page_kernels();
    new Uint32Array(memory.buffer, kernels, places.length).set(places);
    const room = exports.page_room(description.length);
    new Float64Array(memory.buffer, room, description.length).set(description);
    settings = exports.page_read();
    engine = exports;
  }

  function run({ values, times, seconds }) {
    const { memory } = engine;
    const at = (place, count) => new Float64Array(memory.buffer, place, count);
    at(settings, values.length).set(values);
    const room = engine.page_times(times.length);
    at(room, times.length).set(times);
    deadline = performance.now() + 1000 * seconds;
    const begun = performance.now();
    const result = at(engine.page_run(), FIGURES.length).slice();
    const found = Object.fromEntries(FIGURES.map((name, k) => [name, result[k]]));
    found.seconds = (performance.now() - begun) / 1000;
    return found;
  }

  scope.onmessage = ({ data }) => {
    try {
      if (data.load) {
        load(data.load);
        scope.postMessage({ id: data.id, done: true });
        return;
      }
      const found = run(data.run);
      if (!found.refused) {
        const copy = (name, count) => { found[name] = new Float64Array(engine.memory.buffer, found[name], count).slice(); };
        const { size, shown } = data.run;
        copy("time", found.rows);
        copy("state", found.rows * size);
        copy("shown", found.rows * shown);
        copy("eventTime", found.events);
        copy("eventIndex", found.events);
        copy("eventShown", found.events * shown);
      }
      scope.postMessage({ id: data.id, found });
    } catch (error) {
      scope.postMessage({ id: data.id, error: String(error.message ?? error) });
    }
  };
}
