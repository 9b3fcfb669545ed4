// Turns and zooms a view by mouse, touch and keyboard.
import { usePointers } from "../parts/pointers.js";
import { useRef } from "../parts/view.js";

const DEGREES_PER_PIXEL = 0.5;
const KEY_DEGREES = 5;
const KEY_ZOOM = 1.15;

// Handlers for a focusable element. turn(right, up) is called with degrees, zoom(factor) with a factor, and reset() for Home. grab(point) is
// called for a press first: it returns what follows the moves of the pointer, at points of the element, where it takes the pointer for itself.
export function useOrbit({ turn, zoom, reset, grab }) {
  const follow = useRef(null);
  const pointers = usePointers({
    press(point) {
      follow.current = point && grab(point);
    },
    drag(point, before) {
      if (follow.current) follow.current(point);
      else turn(-DEGREES_PER_PIXEL * (point[0] - before[0]), DEGREES_PER_PIXEL * (point[1] - before[1]));
    },
    pinch: zoom,
  });
  function onKeyDown(event) {
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
  }
  function onWheel(event) {
    // Elsewhere the wheel scrolls the page.
    if (document.activeElement !== event.currentTarget && !event.ctrlKey) return;
    event.preventDefault();
    zoom(Math.exp(-0.0015 * event.deltaY));
  }
  return { ...pointers, onKeyDown, onWheel };
}
