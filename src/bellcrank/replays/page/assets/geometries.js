// ---- geometries: shared ones, and the parts of arrows and springs

const CREASE = Math.cos(40 * Math.PI / 180);  // faces that meet at a smaller angle form one smooth surface

/** A smooth surface with creases: a vertex is duplicated where the faces around it differ by more than CREASE. */
function creasedGeometry(THREE, { vertices, faces }) {
  const corners = faces.length;
  const normals = new Float32Array(corners);  // of each face, with the length of twice its area
  const lengths = new Float32Array(corners / 3);
  for (let f = 0; f < corners; f += 3) {
    const [a, b, c] = [3 * faces[f], 3 * faces[f + 1], 3 * faces[f + 2]];
    const [ux, uy, uz] = [vertices[b] - vertices[a], vertices[b + 1] - vertices[a + 1], vertices[b + 2] - vertices[a + 2]];
    const [vx, vy, vz] = [vertices[c] - vertices[a], vertices[c + 1] - vertices[a + 1], vertices[c + 2] - vertices[a + 2]];
    normals[f] = uy * vz - uz * vy;
    normals[f + 1] = uz * vx - ux * vz;
    normals[f + 2] = ux * vy - uy * vx;
    lengths[f / 3] = Math.hypot(normals[f], normals[f + 1], normals[f + 2]);
  }
  // For each vertex: a linked list of the corners made from it so far, each with the face that made it.
  const newest = new Int32Array(vertices.length / 3).fill(-1);
  const older = new Int32Array(corners);
  const maker = new Int32Array(corners);
  const source = new Int32Array(corners);
  const sums = new Float32Array(3 * corners);
  const index = new Uint32Array(corners);
  let made = 0;
  for (let corner = 0; corner < corners; corner++) {
    const f = corner - corner % 3;
    const vertex = faces[corner];
    let found = newest[vertex];
    while (found >= 0) {
      const g = maker[found];
      const dot = normals[f] * normals[g] + normals[f + 1] * normals[g + 1] + normals[f + 2] * normals[g + 2];
      if (dot >= CREASE * lengths[f / 3] * lengths[g / 3]) break;
      found = older[found];
    }
    if (found < 0) {
      found = made++;
      older[found] = newest[vertex];
      newest[vertex] = found;
      maker[found] = f;
      source[found] = vertex;
    }
    for (let k = 0; k < 3; k++) sums[3 * found + k] += normals[f + k];
    index[corner] = found;
  }
  const positions = new Float32Array(3 * made);
  for (let i = 0; i < made; i++) {
    const length = Math.hypot(sums[3 * i], sums[3 * i + 1], sums[3 * i + 2]) || 1;
    for (let k = 0; k < 3; k++) {
      positions[3 * i + k] = vertices[3 * source[i] + k];
      sums[3 * i + k] /= length;
    }
  }
  return indexedGeometry(THREE, positions, sums.slice(0, 3 * made), index, made);
}

function indexedGeometry(THREE, positions, normals, index, count) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
  geometry.setIndex(new THREE.BufferAttribute(count < 65536 ? Uint16Array.from(index) : index, 1));
  return geometry;
}

/** Several geometries as one, drawn in one call. */
function mergedGeometry(THREE, ...parts) {
  const positions = [];
  const normals = [];
  const index = [];
  for (const part of parts) {
    const first = positions.length / 3;
    positions.push(...part.attributes.position.array);
    normals.push(...part.attributes.normal.array);
    index.push(...Array.from(part.index.array, (i) => i + first));
  }
  return indexedGeometry(THREE, new Float32Array(positions), new Float32Array(normals), new Uint32Array(index), positions.length / 3);
}

/** Geometries and materials, each made once; with finer curves if there are few shapes. */
function makeGeometryCache(THREE, { meshes, bodies }) {
  const few = bodies.reduce((count, { shapes }) => count + shapes.length, 0) < 100;
  const known = new Map();
  const once = (key, make) => {
    if (!known.has(key)) known.set(key, make());
    return known.get(key);
  };
  return {
    once,
    /** The geometry of a shape, and the scale that brings it to size. */
    geometry({ kind, size, mesh }) {
      if (kind === "mesh") return [once(`mesh ${mesh}`, () => creasedGeometry(THREE, meshes[mesh])), size];
      if (kind === "box") return [once("box", () => new THREE.BoxGeometry()), size];
      if (kind === "sphere") return [once("sphere", () => new THREE.SphereGeometry(1, ...few ? [28, 18] : [14, 9])), [size[0], size[0], size[0]]];
      // three.js cylinders are along y, ours along z
      return [once("cylinder", () => new THREE.CylinderGeometry(1, 1, 1, few ? 40 : 16).rotateX(Math.PI / 2)), [size[0], size[0], size[1]]];
    },
    material([red, green, blue, opacity]) {
      return once(`colour ${red} ${green} ${blue} ${opacity}`, () => new THREE.MeshLambertMaterial({
        color: new THREE.Color(red, green, blue), opacity, transparent: opacity < 1, depthWrite: opacity > 0.99,
      }));
    },
  };
}

/** A coil along y from 0 to `length`, with straight ends. */
function coil(THREE, length, radius, turns) {
  const straightEnd = 0.08;
  class Helix extends THREE.Curve {
    getPoint(part, target = new THREE.Vector3()) {
      const along = Math.min(Math.max((part - straightEnd) / (1 - 2 * straightEnd), 0), 1);
      const out = radius * Math.min(1, 12 * Math.min(along, 1 - along));
      const angle = 2 * Math.PI * turns * along;
      return target.set(out * Math.cos(angle), length * part, out * Math.sin(angle));
    }
  }
  return new THREE.TubeGeometry(new Helix(), turns * 12, 0.13 * radius, 5);
}

/** A flat spiral around z, as points, for a torsion spring. */
function spiral(radius) {
  return Array.from({ length: 73 }, (_, i) => {
    const angle = 2 * Math.PI * 2.75 * i / 72;
    const out = radius * (0.22 + 0.78 * i / 72);
    return [out * Math.cos(angle), out * Math.sin(angle), 0];
  });
}
