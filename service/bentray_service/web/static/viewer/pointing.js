// Mouse, pen, touch and keys on the canvas of a plane, as actions on the state of the view.
import { watchPointers } from "../parts/pointers.js";
import { clampZoom } from "./state.js";

const WHEEL = 1.0015;
const STEP = 1.25;
// A press that moves less is a click, pixels.
const STILL = 4;
// Of the window: by a pixel of dragging, and by a key.
const [DRAG_SHARE, KEY_SHARE] = [1 / 300, 0.05];

const draws = ({ tool }) => !["pan", "window"].includes(tool);

// act: { current } with state, view ({ centre, zoom }), window ([low, high]), cursor, setView(centre, zoom), setWindow(low, high),
// hover(point or null), setCursor(x, y), moveCursor(da, db), moveSlice(by), draw(place), automatic(), reset().
export function watch(canvas, image, act) {
  let drag = null;
  let anchor = null;

  // Zoom so that the point under (px, py) stays.
  function zoomAt(px, py, factor) {
    const [x, y] = image.toPlane(px, py);
    const zoom = clampZoom(act.current.view.zoom * factor);
    const share = act.current.view.zoom / zoom;
    act.current.setView([x + (image.centre[0] - x) * share, y + (image.centre[1] - y) * share], zoom);
  }

  // The window moved by a share of its width, and widened by a factor.
  function shift([low, high], by, spread) {
    const half = ((high - low) / 2) * spread;
    const level = (low + high) / 2 + by * (high - low);
    act.current.setWindow(level - half, level + half);
  }

  function dragTo([px, py]) {
    if (!drag) return;
    const [dx, dy] = [px - drag.point[0], py - drag.point[1]];
    drag.moved ||= Math.hypot(dx, dy) > STILL;
    if (!drag.moved) return;
    const { tool } = act.current.state;
    if (tool === "pan") act.current.setView([drag.centre[0] - dx / drag.scale, drag.centre[1] + dy / drag.scale], act.current.view.zoom);
    else if (tool === "window") shift(drag.window, -dy * DRAG_SHARE, Math.exp(dx * DRAG_SHARE * 2));
    else act.current.draw([...drag.at, ...image.toPlane(px, py)]);
  }

  watchPointers(canvas, {
    press(point) {
      drag = point && { point, moved: false, at: image.toPlane(...point), centre: image.centre, window: act.current.window, scale: image.scale };
    },
    hover: (point) => act.current.hover(point),
    drag: dragTo,
    pinch: (factor, middle) => zoomAt(...middle, factor),
    release(point) {
      if (drag && !drag.moved) act.current.setCursor(...drag.at);
      else if (draws(act.current.state)) dragTo(point);
      drag = null;
    },
    cancel() {
      drag = null;
    },
  });

  function key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const { clientWidth: width, clientHeight: height } = canvas;
    const { window } = act.current;
    const drawing = draws(act.current.state);
    const actions = {
      "+": () => zoomAt(width / 2, height / 2, STEP),
      "=": () => zoomAt(width / 2, height / 2, STEP),
      "-": () => zoomAt(width / 2, height / 2, 1 / STEP),
      0: () => act.current.reset(),
      a: () => act.current.automatic(),
      ",": () => shift(window, -KEY_SHARE, 1),
      ".": () => shift(window, KEY_SHARE, 1),
      "[": () => shift(window, 0, 1 - 2 * KEY_SHARE),
      "]": () => shift(window, 0, 1 + 2 * KEY_SHARE),
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

  canvas.addEventListener("keydown", key);
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      zoomAt(event.offsetX, event.offsetY, WHEEL ** -event.deltaY);
    },
    { passive: false },
  );
}
