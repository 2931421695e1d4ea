// ---- numbers: what block.py packed, unpacked

/** An array of the block, row after row: undo the byte planes, the folded sign and the differences along columns. */
function unpacked(bytes, { at, rows, columns, order, step, from: begin = 0 }, Kind = Float32Array) {
  const size = rows * columns;
  const words = new Int32Array(size);
  for (let column = 0, from = at; column < columns; column++) {
    let word = 0;
    let slope = 0;
    for (let to = column; to < size; to += columns, from++) {
      const folded = bytes[from] | bytes[from + size] << 8 | bytes[from + 2 * size] << 16 | bytes[from + 3 * size] << 24;
      const difference = folded >>> 1 ^ -(folded & 1);
      slope = order === 2 ? slope + difference | 0 : difference;
      words[to] = word = word + slope | 0;
    }
  }
  if (step === 0) return new Float32Array(words.buffer);  // the words are the bits of float32
  const values = new Kind(size);
  for (let i = 0; i < size; i++) values[i] = begin + words[i] * step;
  return values;
}

/** The index of the last of increasing `times` that is not after t; 0 before the first. */
function indexAt(times, t) {
  let low = 0;
  let high = times.length - 1;
  while (low < high) {
    const middle = low + high + 1 >> 1;
    if (times[middle] <= t) low = middle; else high = middle - 1;
  }
  return low;
}

/** The frame before t, and how far on towards the next it is, 0 to 1. */
function between(times, t) {
  const index = Math.min(indexAt(times, t), Math.max(times.length - 2, 0));
  const span = times[index + 1] - times[index];
  return [index, span > 0 ? Math.min(Math.max((t - times[index]) / span, 0), 1) : 0];
}

/** The film with every array it refers to in place. */
async function readFilm() {
  const film = JSON.parse(document.getElementById("film").textContent);
  const bytes = await window.bellcrank.inflated("block");
  const read = (reference, Kind) => unpacked(bytes, reference, Kind);
  film.time = read(film.time, Float64Array);
  film.places = read(film.places);
  film.turns = read(film.turns);
  for (const mesh of film.meshes) {
    mesh.vertices = read(mesh.vertices);
    mesh.faces = read(mesh.faces, Int32Array);
  }
  for (const { pieces } of film.traces) {
    for (const piece of pieces) {
      piece.time = read(piece.time, Float64Array);
      piece.points = read(piece.points);
    }
  }
  for (const arrow of film.arrows) {
    arrow.points = read(arrow.points);
    arrow.vectors = read(arrow.vectors);
  }
  for (const spring of film.springs) spring.ends = read(spring.ends);
  for (const chart of film.charts) {
    chart.time = read(chart.time, Float64Array);
    for (const line of chart.lines) line.values = read(line.values);
  }
  for (const plane of film.planes) {
    plane.time = read(plane.time, Float64Array);
    plane.x = read(plane.x);
    plane.y = read(plane.y);
    for (const limit of plane.limits) limit.points = read(limit.points);
  }
  return film;
}
