// ---- joints are moved by dragging links of the posture in the view

const [FOLLOWS, DRAG_STEPS, LONGEST_TURN] = [0.25, 12, 0.4];  // pixels; steps of Gauss and Newton; rad or m a step
const SMALL_TURN = 1e-4;  // rad or m, for derivatives

/**
 * While a posture is shown, a drag that begins on one of its links moves the joint of that link, so that the point that
 * was picked stays below the pointer as closely as the joint can bring it. Other drags turn the camera, as ever.
 */
function makeDrag({ live, film, posture, view }) {
  const { Vector3 } = MeshCat.THREE;
  const { pane } = view;
  let held = null;  // the joint, the pointer, and the point in the frame of the link

  const place = (event) => {
    const { left, top } = pane.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  };
  /** The joint whose link is at a pixel, and the point there; null where there is none. */
  const linkAt = (pixel) => {
    const found = posture.box.open ? view.ghostAt(...pixel) : null;
    const joint = found ? live.dragged[found.body] : -1;
    return joint < 0 ? null : { joint, body: found.body, local: view.ghostBody(found.body).worldToLocal(found.point.clone()) };
  };
  /** Where a point of a link is, in the frame of the viewer, after its joint has moved by a step. */
  const moved = ({ joint, body, local }) => {
    const axis = film.axes.find(({ name }) => name === live.all_joints[joint]);
    const carrier = view.ghostBody(axis.body);
    const origin = carrier.localToWorld(new Vector3(...axis.point));
    const direction = new Vector3(...axis.direction).transformDirection(carrier.matrixWorld);
    const point = view.ghostBody(body).localToWorld(local.clone());
    return live.postures[joint][2] === "m" ? (step) => point.clone().addScaledVector(direction, step)
      : (step) => point.clone().sub(origin).applyAxisAngle(direction, step).add(origin);
  };
  /** The step of a joint that brings its point as near to a pixel as it can come; by Gauss and Newton's method. */
  const stepTowards = (goal, at) => {
    const missing = (step) => view.pixelOf(at(step)).map((x, k) => goal[k] - x);
    let step = 0;
    let left = missing(0);
    for (let turn = 0; turn < DRAG_STEPS && Math.hypot(...left) > FOLLOWS; turn++) {
      const slope = missing(step + SMALL_TURN).map((x, k) => (left[k] - x) / SMALL_TURN);
      const square = slope[0] ** 2 + slope[1] ** 2;
      if (!(square > 1)) break;  // the point hardly moves on the screen: it is on the axis, or moves towards the viewer
      let change = Math.min(Math.max((slope[0] * left[0] + slope[1] * left[1]) / square, -LONGEST_TURN), LONGEST_TURN);
      let next = missing(step + change);
      while (Math.hypot(...next) > Math.hypot(...left) && Math.abs(change) > SMALL_TURN) next = missing(step + (change /= 2));
      if (!(Math.hypot(...next) < Math.hypot(...left))) break;
      step += change;
      left = next;
    }
    return step;
  };
  const follow = (pixel) => {
    const [low, high] = live.postures[held.joint];
    const value = Number((posture.values[held.joint] + stepTowards(pixel, moved(held))).toPrecision(5));
    if (Number.isFinite(value)) posture.set([[held.joint, Math.min(Math.max(value, low), high)]]);
  };
  const release = (event) => {
    if (held?.pointer !== event.pointerId) return;
    held = null;
    view.holdCamera(false);
    pane.classList.remove("grabbed");
  };
  pane.addEventListener("pointerdown", (event) => {
    if (held || event.button !== 0 || !event.isPrimary) return;
    const link = linkAt(place(event));
    if (!link) return;
    held = { ...link, pointer: event.pointerId };
    event.stopPropagation();
    view.holdCamera(true);
    pane.setPointerCapture(event.pointerId);
    pane.classList.add("grabbed");
  }, true);
  pane.addEventListener("pointermove", (event) => {
    if (held?.pointer === event.pointerId) follow(place(event));
    else if (!event.buttons && event.pointerType === "mouse") pane.classList.toggle("grabs", linkAt(place(event)) !== null);
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) pane.addEventListener(name, release);
}
