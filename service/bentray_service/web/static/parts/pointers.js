// Mouse, pen and fingers on an element: presses, drags by one pointer, pinches by two; and keys.
import { useRef } from "./view.js";

// Handlers for an element. Points are [x, y] in pixels from its corner. press(point) for a first pointer, then drag(point, before) for each of
// its moves and release(point); pinch(factor, middle) for the moves of two, after press(null); hover(point) for any move, null for none.
// cancel() where the browser takes the pointer away.
export function usePointers({ press, drag, pinch, hover = () => {}, release = () => {}, cancel = () => {} }) {
  const pressed = useRef(new Map()).current;
  const pointOf = ({ clientX, clientY, currentTarget }) => {
    const { left, top } = currentTarget.getBoundingClientRect();
    return [clientX - left, clientY - top];
  };
  const between = () => {
    const [[x0, y0], [x1, y1]] = pressed.values();
    return { apart: Math.hypot(x0 - x1, y0 - y1), middle: [(x0 + x1) / 2, (y0 + y1) / 2] };
  };
  return {
    onPointerDown(event) {
      if (event.button > 0) return;
      event.currentTarget.setPointerCapture(event.pointerId);
      pressed.set(event.pointerId, pointOf(event));
      press(pressed.size === 1 ? pointOf(event) : null);
    },
    onPointerMove(event) {
      const [point, last] = [pointOf(event), pressed.get(event.pointerId)];
      const before = pressed.size === 2 && last ? between().apart : 0;
      if (last) pressed.set(event.pointerId, point);
      if (before > 0) return pinch(between().apart / before, between().middle);
      hover(point);
      if (last && pressed.size === 1) drag(point, last);
    },
    onPointerUp: (event) => pressed.delete(event.pointerId) && release(pointOf(event)),
    onPointerCancel({ pointerId }) {
      pressed.delete(pointerId);
      cancel();
    },
    onPointerLeave: () => hover(null),
  };
}

// A handler of keys without Ctrl, Alt and Meta. actionsOf(event): functions by the names of keys.
export const keyHandler = (actionsOf) => (event) => {
  const action = event.ctrlKey || event.altKey || event.metaKey ? null : actionsOf(event)[event.key];
  if (!action) return;
  event.preventDefault();
  action();
};
