// ---- the 3-D view: its contents, and its state at a time

const FIELD = 40;  // degrees of the view's height
const ASPECT = 4 / 3;  // of the view for which the film's camera was chosen

/**
 * The view in `pane`, or null if the browser has no WebGL. meshcat's viewer owns the scene, the camera and the
 * controls; this page sets the time, so the viewer neither animates by itself nor connects to a server.
 */
function makeView(pane, film) {
  const canvas = document.createElement("canvas");
  const context = ["webgl2", "webgl"].map((kind) => canvas.getContext(kind, { alpha: true, antialias: true, powerPreference: "high-performance" }))
    .find(Boolean);
  if (!context) return null;
  const { THREE, Viewer } = MeshCat;
  const renderer = new THREE.WebGLRenderer({ canvas, context });
  const backdrop = document.createElement("canvas");
  pane.append(backdrop, canvas);
  canvas.tabIndex = -1;
  const viewer = new Viewer(pane, false, renderer);
  viewer.gui.domElement.remove();  // the viewer's own menu
  for (const path of ["Lights", "Grid", "Axes"]) viewer.delete_path([path]);
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  renderer.shadowMap.enabled = false;
  renderer.debug.checkShaderErrors = false;  // the check waits for the shader compiler

  const world = new THREE.Group();
  viewer.set_object(["film"], world);
  const size = { value: new THREE.Vector2(1, 1) };  // of the pane in pixels, for all lines
  const cache = makeGeometryCache(THREE, film);
  const camera = makeCamera(THREE, viewer, film);
  addLights(THREE, world, film);
  const ground = new THREE.Group();
  world.add(ground);

  const bodies = film.bodies.map(({ shapes }) => {
    const body = new THREE.Group();
    const form = new THREE.Group();  // the shapes, which another design may stretch
    form.matrixAutoUpdate = false;
    body.add(form);
    for (const shape of shapes) {
      const [geometry, scale] = cache.geometry(shape);
      const solid = new THREE.Mesh(geometry, cache.material(shape.colour));
      solid.position.fromArray(shape.pose);
      solid.quaternion.fromArray(shape.pose, 3);
      solid.scale.fromArray(scale);
      form.add(solid);
    }
    world.add(body);
    return body;
  });
  const layers = film.layers.map(({ group, name, bodies: members }) => ({
    group, name, colour: "transparent", objects: members.map((k) => bodies[k]), on: true,
  }));
  const ghost = film.live?.kind === "run" || film.live?.postures ? addGhost(THREE, world, layers, bodies, film.live.kind) : null;
  const cameraFollow = makeCameraFollow(THREE, viewer, camera, film, bodies, ground, layers);
  const updaters = [
    bodyUpdater(THREE, film, bodies),
    cameraFollow.move,
    ...ghost ? [ghost.move] : [],
    ...film.traces.map((trace, k) => addTrace(THREE, world, layers, trace, paletteColour(k + 1), size)),
    ...film.springs.map((spring) => addSpring(THREE, world, layers, film, spring)),
    ...film.rods.map((rod) => addRod(THREE, world, layers, cache, film, rod)),
    ...film.arrows.map((arrow, k) => addArrow(THREE, world, layers, cache, film, arrow, k)),
    ...addAxes(THREE, world, bodies, layers, film, size),
    ...addLimitedAxes(THREE, world, bodies, layers, film, size),
  ];

  // Sky and ground take half of the time of a frame. While the camera rests they are an image behind the canvas.
  let sky = null;
  const seenFrom = new THREE.Matrix4();
  let backdropValid = false;  // whether the image behind belongs to the current camera
  const withBackdrop = (on) => {
    ground.visible = on;
    viewer.scene.background = on ? sky : null;
  };
  const drawBackdrop = () => {
    const visible = world.children.filter((child) => child.visible && child !== ground);
    for (const child of visible) child.visible = false;
    withBackdrop(true);
    viewer.render();
    Object.assign(backdrop, { width: canvas.width, height: canvas.height });
    backdrop.getContext("2d").drawImage(canvas, 0, 0);
    for (const child of visible) child.visible = true;
    backdropValid = true;
  };
  const invalidateBackdrop = () => {
    backdropValid = false;
    seenFrom.elements.fill(0);
  };
  const render = () => {
    viewer.controls.update();
    camera.updateMatrixWorld();
    const moved = !seenFrom.equals(camera.matrixWorld);
    seenFrom.copy(camera.matrixWorld);
    if (moved && (film.ground || !backdropValid)) {  // without ground the sky is the same for every camera
      backdropValid = false;
      withBackdrop(true);
      viewer.render();
      viewer.set_dirty();  // once more, when the camera rests
      return;
    }
    if (!backdropValid) drawBackdrop();
    withBackdrop(false);
    viewer.render();
  };

  let now = film.time[0];
  let wanted = false;
  const view = {
    layers,
    bodies,
    /** Show time t, in the next frame of the browser. */
    showTime(t) {
      now = t;
      const [frame, part] = interpolationAt(film.time, t);
      for (const update of updaters) update(frame, part, t);
      viewer.set_dirty();
    },
    draw: render,
    /** Draw, and wait until the image is complete, to measure the time of a frame. */
    drawFully() {
      render();
      context.readPixels(0, 0, 1, 1, context.RGBA, context.UNSIGNED_BYTE, new Uint8Array(4));
    },
    capture(paper) {
      withBackdrop(true);
      if (paper) viewer.scene.background = new THREE.Color("white");
      viewer.controls.update();
      const image = viewer.capture_image();
      viewer.set_dirty();
      return image;
    },
    project(point) {
      viewer.scene.updateMatrixWorld();
      camera.updateMatrixWorld();
      const seen = new THREE.Vector3(...point).applyMatrix4(world.matrixWorld).project(camera);
      return [(seen.x + 1) / 2 * size.value.x, (1 - seen.y) / 2 * size.value.y];
    },
    resetCamera() {
      cameraFollow.reset();
      invalidateBackdrop();
      viewer.set_dirty();
    },
    /** Show another motion of the bodies too, translucent; null for none. */
    showGhost(motion) {
      ghost.show(motion);
      if (motion) stretchForms(ghost.copies, motion.stretch);
      view.refresh();
    },
    pane,
    /** The translucent body at a pixel of the pane, and the point there in the viewer's frame; null where there is none. */
    ghostAt(x, y) {
      if (!ghost.visible) return null;
      viewer.scene.updateMatrixWorld();
      camera.updateMatrixWorld();
      const ray = new THREE.Raycaster();
      ray.setFromCamera(new THREE.Vector2(2 * x / size.value.x - 1, 1 - 2 * y / size.value.y), camera);
      const [hit] = ray.intersectObjects(ghost.copies, true);
      if (!hit) return null;
      let part = hit.object;
      while (!ghost.copies.includes(part)) part = part.parent;
      return { body: ghost.copies.indexOf(part), point: hit.point };
    },
    /** A translucent body where it is now. */
    ghostBody(number) {
      ghost.copies[number].updateWorldMatrix(true, false);
      return ghost.copies[number];
    },
    /** The pixel of a point in the viewer's frame. */
    pixelOf(point) {
      const seen = point.clone().project(camera);
      return [(seen.x + 1) / 2 * size.value.x, (1 - seen.y) / 2 * size.value.y];
    },
    /** Keep the camera where it is, whatever the pointer does. */
    holdCamera(on) {
      viewer.controls.enabled = !on;
    },
    gridStep: () => cameraFollow.gridStep,
    refresh() {
      view.showTime(now);
    },
    /**
     * Show another motion of the same bodies: times, positions and quaternions as in a film; segments of each trace and
     * ends of springs and rods; and `stretch`, pairs of a body and the nine numbers, row by row, that its shapes are
     * multiplied by.
     */
    showMotion({ time, positions, quaternions, traces, springs, rods, stretch }) {
      Object.assign(film, { time, positions, quaternions });
      traces.forEach((segments, k) => { film.traces[k].segments = segments; });
      springs.forEach((ends, k) => { film.springs[k].ends = ends; });
      rods.forEach((ends, k) => { film.rods[k].ends = ends; });
      stretchForms(bodies, stretch);
      view.refresh();
    },
  };

  viewer.set_dirty = () => {
    viewer.needs_render = true;
    if (wanted) return;
    wanted = true;
    requestAnimationFrame(() => {
      wanted = false;
      if (viewer.needs_render) render();
    });
  };
  // The viewer calls this when the window is loaded or resized, and would take the window's height; ours is the pane's.
  viewer.set_3d_pane_size = () => {
    const width = Math.max(pane.clientWidth, 1);
    const height = Math.max(pane.clientHeight, 1);
    if (size.value.x === width && size.value.y === height) return;
    size.value.set(width, height);
    camera.aspect = width / height;
    // A narrower pane shows the same width, and more above and below.
    camera.fov = 2 * Math.atan(Math.tan(FIELD * Math.PI / 360) * Math.max(ASPECT / camera.aspect, 1)) * 180 / Math.PI;
    renderer.setSize(width, height);
    invalidateBackdrop();
    render();
  };
  const paintSky = () => {
    const [top, bottom] = darkScheme.matches ? [[30, 37, 47], [14, 18, 24]] : [[246, 248, 251], [219, 226, 234]];
    viewer.set_property(["Background"], "top_color", top.map((x) => x / 255));
    viewer.set_property(["Background"], "bottom_color", bottom.map((x) => x / 255));
    sky = viewer.scene.background;
    invalidateBackdrop();
    viewer.set_dirty();
  };
  darkScheme.addEventListener("change", paintSky);
  view.showTime(now);
  paintSky();
  viewer.set_3d_pane_size();
  new ResizeObserver(() => viewer.set_3d_pane_size()).observe(pane);
  return view;
}

/** Multiply the shapes of bodies by maps, pairs of a body and nine numbers, row by row; those of others by 1. */
function stretchForms(bodies, stretch) {
  for (const body of bodies) body.children[0].matrix.identity();
  for (const [k, [a, b, c, d, e, f, g, h, i]] of stretch) bodies[k].children[0].matrix.set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1);
  for (const body of bodies) body.children[0].matrixWorldNeedsUpdate = true;
}

/** The film's camera, with mouse controls. In the viewer's frame y is up, in the film's z. */
function makeCamera(THREE, viewer, { camera: { position, target, up }, extent }) {
  const turned = ([x, y, z]) => new THREE.Vector3(x, z, -y);
  const distance = turned(position).distanceTo(turned(target));
  const camera = new THREE.PerspectiveCamera(FIELD, 1, Math.min(distance, extent) / 100, 40 * (distance + extent));
  camera.up.copy(turned(up)).normalize();
  camera.position.copy(turned(position));
  viewer.controls.dispose();  // of the camera that is replaced
  viewer.set_camera(camera);
  viewer.set_object(["Cameras", "default", "rotated"], camera);
  viewer.controls.target.copy(turned(target));
  viewer.controls.minDistance = distance / 50;
  viewer.controls.maxDistance = 10 * distance;
  viewer.controls.update();
  viewer.controls.saveState();
  return camera;
}

/** A sky light, a key light from the upper left of the camera, and a weak fill light from the right, without shadows. */
function addLights(THREE, world, { camera: { position, target, up } }) {
  const high = new THREE.Vector3(...up).normalize();
  const ahead = new THREE.Vector3(...position).sub(new THREE.Vector3(...target)).normalize();
  const right = new THREE.Vector3().crossVectors(high, ahead).normalize();
  const sky = new THREE.HemisphereLight(0xffffff, 0xb0b3ba, 0.7);
  sky.position.copy(high);
  const key = new THREE.DirectionalLight(0xffffff, 0.48);
  key.position.copy(high).addScaledVector(ahead, 0.55).addScaledVector(right, -0.75);
  const fill = new THREE.DirectionalLight(0xffffff, 0.2);
  fill.position.copy(ahead).addScaledVector(right, 1.2).addScaledVector(high, 0.2);
  world.add(sky, key, fill);
}

/** The width of the squares of the ground's grid (m). */
const gridStep = (extent) => roundBelow(0.4 * extent);

/** A disk with a grid that fades out towards its rim; `placeBelow` centres it below a point. */
function makeGround(THREE, ground, extent) {
  const normal = new THREE.Vector3(...ground.normal).normalize();
  const plane = new THREE.Group();
  plane.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
  const step = gridStep(extent);
  const back = plane.quaternion.clone().invert();
  plane.placeBelow = (point) => {
    const inPlane = point.clone().applyQuaternion(back);
    for (const k of ["x", "y"]) inPlane[k] = Math.round(inPlane[k] / step) * step;  // grid lines pass through the origin
    inPlane.z = ground.height;
    plane.position.copy(inPlane.applyQuaternion(plane.quaternion));
  };
  const reach = Math.ceil(3.2 * extent / step) * step;
  const grey = new THREE.Color(0x7c8896);
  const fade = (x, y) => Math.max(0, 1 - Math.hypot(x, y) / reach) ** 1.5;

  const disk = new THREE.CircleGeometry(reach, 48);
  const shade = new Float32Array(4 * disk.attributes.position.count);
  for (let i = 0; i < shade.length; i += 4) shade.set([grey.r, grey.g, grey.b, i === 0 ? 0.2 : 0], i);
  disk.setAttribute("color", new THREE.BufferAttribute(shade, 4));
  // Drawn first and without depth, so that what is below it stays visible. Custom blending without `transparent` puts
  // it first.
  const look = { vertexColors: true, depthWrite: false, depthTest: false, blending: THREE.CustomBlending, blendSrcAlpha: THREE.OneFactor };
  const floor = new THREE.Mesh(disk, new THREE.MeshBasicMaterial({ ...look, side: THREE.DoubleSide }));

  const points = [];
  const colours = [];
  const put = (x, y) => {
    points.push(x, y, 0);
    colours.push(grey.r, grey.g, grey.b, 0.75 * fade(x, y));
  };
  const cells = Math.round(reach / step);
  for (let i = -cells; i <= cells; i++) {
    for (let j = -cells; j < cells; j++) {
      const [u, v, w] = [i * step, j * step, (j + 1) * step];
      if (fade(u, v) === 0 && fade(u, w) === 0) continue;
      put(u, v); put(u, w);
      put(v, u); put(w, u);
    }
  }
  const grid = new THREE.BufferGeometry();
  grid.setAttribute("position", new THREE.BufferAttribute(new Float32Array(points), 3));
  grid.setAttribute("color", new THREE.BufferAttribute(new Float32Array(colours), 4));
  plane.add(floor, new THREE.LineSegments(grid, new THREE.LineBasicMaterial(look)));
  floor.renderOrder = -2;
  plane.children[1].renderOrder = -1;
  return plane;
}
