// Turns and zooms a view by mouse, touch and keyboard.
import { watchPointers } from "../parts/pointers.js";

const DEGREES_PER_PIXEL = 0.5;
const KEY_DEGREES = 5;
const KEY_ZOOM = 1.15;

// On a focusable element. turn(right, up) is called with degrees, zoom(factor) with a factor, and reset() for Home. grab(point) is called for
// a press first: it returns what follows the moves of the pointer, at points of the element, where it takes the pointer for itself.
export function orbit(stage, { turn, zoom, reset, grab }) {
  let follow = null;
  watchPointers(stage, {
    press(point) {
      follow = point && grab(point);
    },
    drag(point, before) {
      if (follow) follow(point);
      else turn(-DEGREES_PER_PIXEL * (point[0] - before[0]), DEGREES_PER_PIXEL * (point[1] - before[1]));
    },
    pinch: zoom,
  });

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
