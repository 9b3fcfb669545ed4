// Turns and zooms a view by mouse, touch and keyboard.

const DEGREES_PER_PIXEL = 0.5;
const KEY_DEGREES = 5;
const KEY_ZOOM = 1.15;

// On a focusable element. turn(right, up) is called with degrees, zoom(factor) with a factor, and reset() for Home. dragged,
// if given, is called for pointers first: dragged(event) returns true where it takes the pointer for itself.
export function orbit(stage, { turn, zoom, reset, dragged = () => false }) {
  const pointers = new Map();

  function distance() {
    const [one, two] = [...pointers.values()];
    return Math.hypot(one.x - two.x, one.y - two.y);
  }

  stage.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || dragged(event)) return;
    stage.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  stage.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const apart = pointers.size === 2 ? distance() : 0;
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (pointers.size === 2) {
      if (apart > 0) zoom(distance() / apart);
    } else if (pointers.size === 1) {
      turn(-DEGREES_PER_PIXEL * (event.clientX - before.x), DEGREES_PER_PIXEL * (event.clientY - before.y));
    }
  });
  for (const name of ["pointerup", "pointercancel"]) stage.addEventListener(name, (event) => pointers.delete(event.pointerId));

  stage.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = (event.shiftKey ? 3 : 1) * KEY_DEGREES;
    const actions = {
      ArrowLeft: () => turn(-step, 0),
      ArrowRight: () => turn(step, 0),
      ArrowUp: () => turn(0, step),
      ArrowDown: () => turn(0, -step),
      "+": () => zoom(KEY_ZOOM),
      "=": () => zoom(KEY_ZOOM),
      "-": () => zoom(1 / KEY_ZOOM),
      Home: reset,
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  });
  // Elsewhere the wheel scrolls the page.
  stage.addEventListener(
    "wheel",
    (event) => {
      if (document.activeElement !== stage && !event.ctrlKey) return;
      event.preventDefault();
      zoom(Math.exp(-0.0015 * event.deltaY));
    },
    { passive: false },
  );
}
