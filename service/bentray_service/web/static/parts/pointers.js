// Mouse, pen and fingers on an element: presses, drags by one pointer, pinches by two.

// Points are [x, y] in pixels from the corner of the element. press(point, event) for a first pointer, then drag(point, before) for each of
// its moves and release(point); pinch(factor, middle) for the moves of two, after press(null); hover(point) for any move, null for none.
// cancel() where the browser takes the pointer away.
export function watchPointers(element, { press = () => {}, drag, pinch = () => {}, hover = () => {}, release = () => {}, cancel = () => {} }) {
  const pressed = new Map();

  const pointOf = ({ clientX, clientY }) => {
    const { left, top } = element.getBoundingClientRect();
    return [clientX - left, clientY - top];
  };

  function between() {
    const [[x0, y0], [x1, y1]] = [...pressed.values()];
    return { apart: Math.hypot(x0 - x1, y0 - y1), middle: [(x0 + x1) / 2, (y0 + y1) / 2] };
  }

  function move(event) {
    const [point, last] = [pointOf(event), pressed.get(event.pointerId)];
    if (last && pressed.size === 2) {
      const before = between().apart;
      pressed.set(event.pointerId, point);
      const { apart, middle } = between();
      if (before > 0) pinch(apart / before, middle);
      return;
    }
    hover(point);
    if (!last) return;
    pressed.set(event.pointerId, point);
    if (pressed.size === 1) drag(point, last);
  }

  element.addEventListener("pointerdown", (event) => {
    if (event.button > 0) return;
    element.setPointerCapture(event.pointerId);
    pressed.set(event.pointerId, pointOf(event));
    press(pressed.size === 1 ? pointOf(event) : null);
  });
  element.addEventListener("pointermove", move);
  element.addEventListener("pointerup", (event) => pressed.delete(event.pointerId) && release(pointOf(event)));
  element.addEventListener("pointercancel", (event) => {
    pressed.delete(event.pointerId);
    cancel();
  });
  element.addEventListener("pointerleave", () => hover(null));
}
