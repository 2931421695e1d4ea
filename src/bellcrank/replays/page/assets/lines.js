// ---- lines with a width in pixels, drawn up to a time

const LINE_VERTEX = `
attribute vec4 start, end;  // x, y, z and time
uniform vec2 size;
uniform float width;
varying float time;
void main() {
  vec4 a = projectionMatrix * modelViewMatrix * vec4(start.xyz, 1.0);
  vec4 b = projectionMatrix * modelViewMatrix * vec4(end.xyz, 1.0);
  float near = 1e-4, ta = start.w, tb = end.w;
  if (a.w < near && b.w > near) { float k = (near - a.w) / (b.w - a.w); a = mix(a, b, k); ta = mix(ta, tb, k); }
  if (b.w < near && a.w > near) { float k = (near - b.w) / (a.w - b.w); b = mix(b, a, k); tb = mix(tb, ta, k); }
  vec2 along = (b.xy / b.w - a.xy / a.w) * size;
  along = length(along) > 1e-6 ? normalize(along) : vec2(1.0, 0.0);
  vec4 here = position.x < 0.5 ? a : b;
  here.xy += vec2(-along.y, along.x) * position.y * width / size * here.w;
  time = position.x < 0.5 ? ta : tb;
  gl_Position = here;
}`;
const LINE_FRAGMENT = `
uniform vec3 colour;
uniform float now;
varying float time;
void main() {
  if (time > now) discard;
  gl_FragColor = vec4(colour, 1.0);
}`;

/**
 * A line through points (x, y, z, time), drawn exactly up to a time: the shader discards what is later. Each segment is
 * a strip that faces the camera, and each of its four corners has both ends as attributes. (Instanced segments would be
 * simpler, and ten times slower in software rendering.) With `pairs` every two points are a separate segment.
 */
function makeLine(THREE, points, { colour, width, size, pairs = false, onTop = false }) {
  const stride = pairs ? 8 : 4;
  const count = (points.length - 8) / stride + 1;
  const ends = new Float32Array(32 * count);
  const corners = new Float32Array(12 * count);
  const index = new Uint32Array(6 * count);
  const spread = () => {
    for (let i = 0; i < count; i++) {
      const segment = points.subarray(stride * i, stride * i + 8);
      for (let corner = 0; corner < 4; corner++) ends.set(segment, 32 * i + 8 * corner);
    }
  };
  for (let i = 0; i < count; i++) {
    corners.set([0, -1, 0, 1, -1, 0, 0, 1, 0, 1, 1, 0], 12 * i);
    index.set([0, 1, 2, 2, 1, 3].map((corner) => 4 * i + corner), 6 * i);
  }
  spread();
  const geometry = new THREE.BufferGeometry();
  const buffer = new THREE.InterleavedBuffer(ends, 8);
  geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
  geometry.setAttribute("start", new THREE.InterleavedBufferAttribute(buffer, 4, 0));
  geometry.setAttribute("end", new THREE.InterleavedBufferAttribute(buffer, 4, 4));
  geometry.setIndex(new THREE.BufferAttribute(index, 1));
  const material = new THREE.ShaderMaterial({
    vertexShader: LINE_VERTEX,
    fragmentShader: LINE_FRAGMENT,
    uniforms: { colour: { value: new THREE.Color(colour) }, now: { value: Infinity }, width: { value: width }, size },
    side: THREE.DoubleSide,
    transparent: onTop,  // drawn after everything else
    depthTest: !onTop,
  });
  const line = new THREE.Mesh(geometry, material);
  line.frustumCulled = false;  // the bounding box is that of the corners, not of the points
  line.renderOrder = onTop ? 2 : 0;
  line.upTo = (last, t) => {
    geometry.setDrawRange(0, 6 * Math.min(last + 1, count));
    material.uniforms.now.value = t;
  };
  line.changed = () => {
    spread();
    buffer.needsUpdate = true;
  };
  return line;
}
