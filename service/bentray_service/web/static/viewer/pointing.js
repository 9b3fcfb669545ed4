// Mouse, pen, touch and keys on the canvas of a plane, as actions on the state of the view.
import { clampZoom } from "./state.js";

const WHEEL = 1.0015;
const STEP = 1.25;
// A press that moves less is a click, pixels.
const STILL = 4;
// Of the window: by a pixel of dragging, and by a key.
const [DRAG_SHARE, KEY_SHARE] = [1 / 300, 0.05];

// act: { current } with state, view ({ centre, zoom }), window ([low, high]), cursor, setView(centre, zoom), setWindow(low, high),
// hover(place or null), setCursor(x, y), moveCursor(da, db), moveSlice(by), draw(place), automatic(), reset().
export function watch(canvas, image, act) {
  const pressed = new Map();
  let drag = null;
  let pinch = null;
  let anchor = null;

  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };

  // Zoom so that the point under (px, py) stays.
  function zoomAt(px, py, factor) {
    const [x, y] = image.toPlane(px, py);
    const zoom = clampZoom(act.current.view.zoom * factor);
    const share = act.current.view.zoom / zoom;
    act.current.setView([x + (image.centre[0] - x) * share, y + (image.centre[1] - y) * share], zoom);
  }

  function begin(event) {
    if (event.button > 0) return;
    canvas.setPointerCapture(event.pointerId);
    pressed.set(event.pointerId, place(event));
    if (pressed.size === 2) {
      const [one, other] = [...pressed.values()];
      pinch = { apart: Math.hypot(one[0] - other[0], one[1] - other[1]) };
      drag = null;
      return;
    }
    const [px, py] = place(event);
    drag = { px, py, moved: false, at: image.toPlane(px, py), centre: image.centre, window: act.current.window, scale: image.scale };
  }

  function move(event) {
    const [px, py] = place(event);
    if (pressed.has(event.pointerId)) pressed.set(event.pointerId, [px, py]);
    if (pinch && pressed.size === 2) {
      const [one, other] = [...pressed.values()];
      const apart = Math.hypot(one[0] - other[0], one[1] - other[1]);
      zoomAt((one[0] + other[0]) / 2, (one[1] + other[1]) / 2, apart / pinch.apart);
      pinch.apart = apart;
      return;
    }
    act.current.hover([px, py]);
    if (!drag) return;
    const [dx, dy] = [px - drag.px, py - drag.py];
    drag.moved ||= Math.hypot(dx, dy) > STILL;
    if (!drag.moved) return;
    const { tool } = act.current.state;
    if (tool === "pan") {
      act.current.setView([drag.centre[0] - dx / drag.scale, drag.centre[1] + dy / drag.scale], act.current.view.zoom);
    } else if (tool === "window") {
      const [low, high] = drag.window;
      const level = (low + high) / 2 - dy * DRAG_SHARE * (high - low);
      const half = ((high - low) / 2) * Math.exp(dx * DRAG_SHARE * 2);
      act.current.setWindow(level - half, level + half);
    } else {
      act.current.draw([...drag.at, ...image.toPlane(px, py)]);
    }
  }

  function end(event) {
    pressed.delete(event.pointerId);
    if (pressed.size < 2) pinch = null;
    if (!drag) return;
    if (!drag.moved) act.current.setCursor(...drag.at);
    else if (!["pan", "window"].includes(act.current.state.tool)) act.current.draw([...drag.at, ...image.toPlane(...place(event))]);
    drag = null;
  }

  function key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const { clientWidth: width, clientHeight: height } = canvas;
    const shift = (by, spread) => {
      const [low, high] = act.current.window;
      const half = ((high - low) / 2) * spread;
      const level = (low + high) / 2 + by * (high - low);
      act.current.setWindow(level - half, level + half);
    };
    const drawing = !["pan", "window"].includes(act.current.state.tool);
    const actions = {
      "+": () => zoomAt(width / 2, height / 2, STEP),
      "=": () => zoomAt(width / 2, height / 2, STEP),
      "-": () => zoomAt(width / 2, height / 2, 1 / STEP),
      0: () => act.current.reset(),
      a: () => act.current.automatic(),
      ",": () => shift(-KEY_SHARE, 1),
      ".": () => shift(KEY_SHARE, 1),
      "[": () => shift(0, 1 - 2 * KEY_SHARE),
      "]": () => shift(0, 1 + 2 * KEY_SHARE),
      PageUp: () => act.current.moveSlice(1),
      PageDown: () => act.current.moveSlice(-1),
    };
    if (arrows[event.key]) {
      const [da, db] = arrows[event.key];
      if (event.shiftKey) {
        const [x, y] = image.centre;
        act.current.setView([x + (0.1 * da * width) / image.scale, y + (0.1 * db * height) / image.scale], act.current.view.zoom);
      } else {
        act.current.moveCursor(da, db);
        if (anchor && drawing) act.current.draw([...anchor, ...act.current.cursor]);
      }
    } else if (event.key === "Enter" && drawing) {
      if (anchor) act.current.draw([...anchor, ...act.current.cursor]);
      anchor = anchor ? null : act.current.cursor;
    } else if (event.key === "Escape" && anchor) {
      anchor = null;
    } else if (actions[event.key]) {
      actions[event.key]();
    } else {
      return;
    }
    event.preventDefault();
  }

  canvas.addEventListener("pointerdown", begin);
  canvas.addEventListener("pointermove", move);
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", (event) => {
    pressed.delete(event.pointerId);
    drag = pinch = null;
  });
  canvas.addEventListener("pointerleave", () => act.current.hover(null));
  canvas.addEventListener("keydown", key);
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      zoomAt(...place(event), WHEEL ** -event.deltaY);
    },
    { passive: false },
  );
}
