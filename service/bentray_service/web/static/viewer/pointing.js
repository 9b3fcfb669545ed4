// Mouse, pen, touch and keys on the canvas of a plane, as actions on the state of the view.
import { watchPointers } from "../parts/pointers.js";
import { MEASURES } from "./measuring.js";
import { clampZoom } from "./state.js";

const WHEEL = 1.0015;
const STEP = 1.25;
// A press that moves less is a click, pixels.
const STILL = 4;
// Of the window: by a pixel of dragging, and by a key.
const [DRAG_SHARE, KEY_SHARE] = [1 / 300, 0.05];

const draws = ({ tool }) => !["pan", "window"].includes(tool);

// act: { current } with state, view ({ centre, zoom }), window ([low, high]), cursor, setView(centre, zoom), setWindow(low, high),
// hover(point or null), setCursor(x, y), moveCursor(da, db), moveSlice(by), mark(point), drag(from, to, ended), cancel(), automatic(), reset().
export class Pointing {
  constructor(canvas, image, act) {
    // drag: a press and what was shown then.
    Object.assign(this, { canvas, image, newest: act, drag: null });
    watchPointers(canvas, {
      press: (point) => {
        this.drag = point && { point, moved: false, at: image.toPlane(...point), centre: image.centre, window: this.act.window };
      },
      hover: (point) => this.act.hover(point),
      drag: (point) => this.dragTo(point),
      pinch: (factor, [px, py]) => this.zoomAt(px, py, factor),
      release: (point) => this.release(point),
      cancel: () => {
        this.drag = null;
      },
    });
    canvas.addEventListener("keydown", (event) => {
      const action = event.ctrlKey || event.altKey || event.metaKey ? null : this.actionOf(event);
      if (!action) return;
      action();
      event.preventDefault();
    });
    const zoom = (event) => {
      event.preventDefault();
      this.zoomAt(event.offsetX, event.offsetY, WHEEL ** -event.deltaY);
    };
    canvas.addEventListener("wheel", zoom, { passive: false });
  }

  get act() {
    return this.newest.current;
  }

  // Zoom so that the point under (px, py) stays.
  zoomAt(px, py, factor) {
    const { act, image: { centre } } = this;
    const [x, y] = this.image.toPlane(px, py);
    const zoom = clampZoom(act.view.zoom * factor);
    const share = act.view.zoom / zoom;
    act.setView([x + (centre[0] - x) * share, y + (centre[1] - y) * share], zoom);
  }

  // Show what is some pixels to the right of a centre, and above it.
  pan([x, y], right, up) {
    this.act.setView([x + right / this.image.scale, y + up / this.image.scale], this.act.view.zoom);
  }

  // A window moved by a share of its width, and widened by a factor.
  shift([low, high], by, spread) {
    const half = ((high - low) / 2) * spread;
    const level = (low + high) / 2 + by * (high - low);
    this.act.setWindow(level - half, level + half);
  }

  dragTo([px, py], ended = false) {
    const { act, drag } = this;
    if (!drag) return;
    const [dx, dy] = [px - drag.point[0], py - drag.point[1]];
    drag.moved ||= Math.hypot(dx, dy) > STILL;
    if (!drag.moved) return;
    if (act.state.tool === "pan") this.pan(drag.centre, -dx, dy);
    else if (act.state.tool === "window") this.shift(drag.window, -dy * DRAG_SHARE, Math.exp(dx * DRAG_SHARE * 2));
    else act.drag(drag.at, this.image.toPlane(px, py), ended);
  }

  release(point) {
    const { act, drag } = this;
    if (drag && !drag.moved) {
      act.setCursor(...drag.at);
      if (act.state.tool in MEASURES) act.mark(drag.at);
    } else if (draws(act.state)) this.dragTo(point, true);
    this.drag = null;
  }

  // A step of the cursor; of the image with Shift.
  step(da, db, shifted) {
    const { act, canvas, image } = this;
    if (shifted) this.pan(image.centre, 0.1 * da * canvas.clientWidth, 0.1 * db * canvas.clientHeight);
    else act.moveCursor(da, db);
  }

  // What a key does, nothing for others.
  actionOf({ key, shiftKey }) {
    const { act, canvas: { clientWidth: width, clientHeight: height } } = this;
    const zoom = (factor) => this.zoomAt(width / 2, height / 2, factor);
    return {
      ArrowLeft: () => this.step(-1, 0, shiftKey),
      ArrowRight: () => this.step(1, 0, shiftKey),
      ArrowUp: () => this.step(0, 1, shiftKey),
      ArrowDown: () => this.step(0, -1, shiftKey),
      "+": () => zoom(STEP),
      "=": () => zoom(STEP),
      "-": () => zoom(1 / STEP),
      0: act.reset,
      a: act.automatic,
      ",": () => this.shift(act.window, -KEY_SHARE, 1),
      ".": () => this.shift(act.window, KEY_SHARE, 1),
      "[": () => this.shift(act.window, 0, 1 - 2 * KEY_SHARE),
      "]": () => this.shift(act.window, 0, 1 + 2 * KEY_SHARE),
      PageUp: () => act.moveSlice(1),
      PageDown: () => act.moveSlice(-1),
      Enter: draws(act.state) && (() => act.mark(act.cursor)),
      Escape: act.state.draft && act.cancel,
    }[key];
  }
}
