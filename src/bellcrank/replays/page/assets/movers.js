// ---- what moves: each function here returns one that puts its part where it is between two frames

const MANY = 8;  // arrows or axes: more of them hide the robot, and are shown when asked for

/** Positions go straight between frames, orientations turn evenly. */
function bodyMover(THREE, { places, turns }, bodies) {
  return (frame, part) => {
    const last = (frame + 1) * bodies.length * 3 < places.length ? 1 : 0;  // a film of one frame has no next
    for (let k = 0; k < bodies.length; k++) {
      const a = frame * bodies.length + k;
      const b = a + last * bodies.length;
      const { position, quaternion } = bodies[k];
      position.set(...[0, 1, 2].map((i) => places[3 * a + i] + part * (places[3 * b + i] - places[3 * a + i])));
      THREE.Quaternion.slerpFlat(turn, 0, turns, 4 * a, turns, 4 * b, part);
      quaternion.fromArray(turn).normalize();
    }
  };
}
const turn = [0, 0, 0, 1];

/** Three numbers of frame `frame`, `part` of the way to the next; rows hold `width` numbers. */
function mixed(values, width, at, frame, part) {
  const a = frame * width + at;
  const b = a + width < values.length ? a + width : a;
  return [0, 1, 2].map((i) => values[a + i] + part * (values[b + i] - values[a + i]));
}

function addTrace(THREE, world, layers, { name, pieces }, colour, size) {
  const group = new THREE.Group();
  const lines = pieces.map(({ time, points }) => {
    const count = time.length;
    const packed = new Float32Array(4 * count);
    for (let i = 0; i < count; i++) packed.set([points[3 * i], points[3 * i + 1], points[3 * i + 2], time[i] - time[0]], 4 * i);
    const line = makeLine(THREE, packed, { colour, width: 2.6, size });
    group.add(line);
    return [line, time];
  });
  world.add(group);
  layers.push({ group: "Traces", name, colour, objects: [group], on: true });
  return (frame, part, t) => {
    for (const [line, time] of lines) {
      line.visible = t > time[0];
      if (line.visible) line.upTo(indexAt(time, t), t - time[0]);
    }
  };
}

function addSpring(THREE, world, layers, film, { name, ends }) {
  let total = 0;
  for (let i = 0; i < ends.length; i += 6) total += Math.hypot(ends[i + 3] - ends[i], ends[i + 4] - ends[i + 1], ends[i + 5] - ends[i + 2]);
  const mean = total / (ends.length / 6) || 1;
  const shape = coil(THREE, mean, Math.min(0.12 * mean, 0.035 * film.extent), 12);
  const spring = new THREE.Mesh(shape, new THREE.MeshLambertMaterial({ color: 0x8592a0 }));
  const up = new THREE.Vector3(...UP);
  const along = new THREE.Vector3();
  const group = new THREE.Group().add(spring);
  world.add(group);
  layers.push({ group: "Springs", name, colour: "#8592a0", objects: [group], on: true });
  return (frame, part) => {
    const start = mixed(ends, 6, 0, frame, part);
    along.fromArray(mixed(ends, 6, 3, frame, part)).sub(spring.position.fromArray(start));
    const length = along.length();
    spring.visible = length > 1e-9;
    if (!spring.visible) return;
    spring.quaternion.setFromUnitVectors(up, along.divideScalar(length));
    spring.scale.set(1, length / mean, 1);
  };
}

/** A thin rod between two points. */
function addRod(THREE, world, layers, stock, film, { name, ends }) {
  const [cylinder] = stock.geometry({ kind: "cylinder", size: [1, 1] });
  const rod = new THREE.Mesh(cylinder, stock.material(ROD));
  const along = new THREE.Vector3();
  const axis = new THREE.Vector3(0, 0, 1);
  const group = new THREE.Group().add(rod);
  world.add(group);
  layers.push({ group: "Rods", name, colour: "#4a5560", objects: [group], on: true });
  return (frame, part) => {
    const start = mixed(ends, 6, 0, frame, part);
    along.fromArray(mixed(ends, 6, 3, frame, part)).sub(rod.position.fromArray(start));
    const length = along.length();
    rod.visible = length > 1e-9;
    if (!rod.visible) return;
    rod.position.addScaledVector(along, 0.5);
    rod.quaternion.setFromUnitVectors(axis, along.divideScalar(length));
    const radius = Math.min(0.008 * film.size, 0.05 * length);
    rod.scale.set(radius, radius, length);
  };
}
const ROD = [0.29, 0.33, 0.38, 1];  // red, green, blue, opacity

function addArrow(THREE, world, layers, stock, film, data, number) {
  const scale = film.scales[data.scale];
  const longest = Math.max(...film.scales.map(({ usual, length, decade, peak }) => arrowLength({ usual, length, decade }, peak)));
  const colour = PALETTE[number % 6 === 0 ? 0 : number % 6];
  const arrow = makeArrow(THREE, stock, data, colour, longest || 1);
  const group = new THREE.Group().add(arrow);
  world.add(group);
  layers.push({ group: "Arrows", name: `${data.name} [${unitShown(scale.unit)}]`, colour, objects: [group], on: film.arrows.length <= MANY });
  return (frame, part, t) => {
    const [row, share] = between(data.time, t);  // an arrow has times of its own: a force may jump while nothing moves
    const [x, y, z] = mixed(data.vectors, 3, 0, row, share);
    const magnitude = Math.hypot(x, y, z);
    arrow.visible = magnitude > 1e-9 * scale.peak && Number.isFinite(magnitude);
    if (!arrow.visible) return;
    arrow.position.fromArray(mixed(data.points, 3, 0, row, share));
    arrow.shape(x, y, z, magnitude, arrowLength(scale, magnitude));
  };
}

/** Axes, and spirals for torsion springs, drawn over the bodies they lie in: one line of segments for all of a kind. */
function addAxes(THREE, world, bodies, layers, film, size) {
  const half = 0.08 * film.size;
  const stick = [[0, 0, -half], [0, 0, half]];
  const kinds = [
    { name: "axes", colour: "#E69F00", parts: film.axes.map((axis) => [axis, stick]) },
    { name: "torsion springs", colour: "#CC79A7", parts: film.axes.filter(({ spring }) => spring).map((axis) => [axis, spiral(0.6 * half)]) },
  ];
  const along = new THREE.Vector3(0, 0, 1);
  const place = new THREE.Vector3();
  return kinds.filter(({ parts }) => parts.length).map(({ name, colour, parts }) => {
    const corners = parts.flatMap(([{ body, point, direction }, points]) => {
      const turned = new THREE.Quaternion().setFromUnitVectors(along, new THREE.Vector3(...direction).normalize());
      const placed = points.map((each) => new THREE.Vector3(...each).applyQuaternion(turned).add(new THREE.Vector3(...point)));
      return placed.slice(1).flatMap((end, k) => [[bodies[body], placed[k]], [bodies[body], end]]);
    });
    const packed = new Float32Array(4 * corners.length);
    const line = makeLine(THREE, packed, { colour, width: 1.5, size, pairs: true, onTop: true });
    world.add(line);
    layers.push({ group: "Joints", name, colour, objects: [line], on: parts.length <= MANY });
    return () => {
      if (!line.visible) return;
      corners.forEach(([{ position, quaternion }, point], i) => place.copy(point).applyQuaternion(quaternion).add(position).toArray(packed, 4 * i));
      line.changed();
    };
  });
}
