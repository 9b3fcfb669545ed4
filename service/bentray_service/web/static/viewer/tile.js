// One image of the viewer: a canvas with its title; mouse, pen, touch and keys on it change the state of the view.
import { keyHandler, usePointers } from "../parts/pointers.js";
import { html, useRef } from "../parts/view.js";
import { AXES } from "./field.js";
import { useImage } from "./image.js";
import { inPlane, MEASURES, withDrag, withPoint } from "./measures.js";
import { clampZoom, WHOLE } from "./state.js";

const WHEEL = 1.0015;
const STEP = 1.25;
// A press that moves less is a click, and within as many pixels of the page a point is the same one.
const [STILL, SAME_PX] = [4, 7];
// Of the window: by a pixel of dragging, and by a key.
const [DRAG_SHARE, KEY_SHARE] = [1 / 300, 0.05];

const draws = ({ tool }) => !["pan", "window"].includes(tool);

// What pointers and keys do with the plane across an axis. image: where it is on its canvas, see image.js; main: the field that the cursor keeps to; window: of the colours.
function actionsOf({ key, axis }, image, { main, state, window, change, setWindow, setHover }) {
  const { cursor } = state;
  const across = AXES.indexOf(axis);
  const [first, second] = inPlane(axis);
  // A point of the plane at the cursor, [x, y, z].
  const inSpace = ([a, b]) => cursor.map((place, k) => (k === first ? a : k === second ? b : place));
  const setView = (centre, zoom) => change({ views: { ...state.views, [axis]: { centre, zoom } } });
  return {
    hover(point) {
      const place = point && image.toPlane(...point);
      setHover({ at: place && { key, axis, place, other: point[0] > image.border }, spoken: false });
    },
    moveTo(...places) {
      [first, second].forEach((k, n) => (cursor[k] = main.position(AXES[k], main.nearest(AXES[k], places[n]))));
      change({});
    },
    // A step of the cursor; of the image with Shift.
    step(da, db, { shiftKey, currentTarget: { clientWidth: width, clientHeight: height } }) {
      if (shiftKey) return this.pan(image.centre, 0.1 * da * width, 0.1 * db * height);
      setHover({ at: null, spoken: true });
      this.moveTo(cursor[first] + da * main.spacing[first], cursor[second] + db * main.spacing[second]);
    },
    moveSlice(by) {
      const index = main.nearest(axis, cursor[across]) + by;
      if (index >= 0 && index < main.count(axis)) cursor[across] = main.position(axis, index);
      change({});
    },
    mark: (point) => change(withPoint(state, axis, inSpace(point), SAME_PX / image.scale)),
    // Zoom so that the point under (px, py) stays.
    zoomAt(px, py, factor) {
      const [[x, y], centre, before] = [image.toPlane(px, py), image.centre, state.views[axis].zoom];
      const zoom = clampZoom(before * factor);
      setView([x + (centre[0] - x) * (before / zoom), y + (centre[1] - y) * (before / zoom)], zoom);
    },
    // Show what is some pixels to the right of a centre, and above it.
    pan: ([x, y], right, up) => setView([x + right / image.scale, y + up / image.scale], state.views[axis].zoom),
    // A window moved by a share of its width, and widened by a factor.
    shift(by, spread, [low, high] = window) {
      const half = ((high - low) / 2) * spread;
      const level = (low + high) / 2 + by * (high - low);
      setWindow([level - half, level + half]);
    },
    // drag: the press and what was shown then; ended: whether this is its last point.
    dragTo(drag, [px, py], ended) {
      const [dx, dy] = [px - drag.point[0], py - drag.point[1]];
      drag.moved ||= Math.hypot(dx, dy) > STILL;
      if (!drag.moved) return;
      if (state.tool === "pan") this.pan(drag.centre, -dx, dy);
      else if (state.tool === "window") this.shift(-dy * DRAG_SHARE, Math.exp(dx * DRAG_SHARE * 2), drag.window);
      else change(withDrag(state, axis, inSpace(drag.at), inSpace(image.toPlane(px, py)), SAME_PX / image.scale, ended));
    },
    // What keys do.
    keys(event) {
      const { clientWidth: width, clientHeight: height } = event.currentTarget;
      const zoom = (factor) => this.zoomAt(width / 2, height / 2, factor);
      return {
        ArrowLeft: () => this.step(-1, 0, event),
        ArrowRight: () => this.step(1, 0, event),
        ArrowUp: () => this.step(0, 1, event),
        ArrowDown: () => this.step(0, -1, event),
        "+": () => zoom(STEP),
        "=": () => zoom(STEP),
        "-": () => zoom(1 / STEP),
        0: () => change({ views: { ...state.views, [axis]: WHOLE } }),
        a: () => change({ window: null }),
        ",": () => this.shift(-KEY_SHARE, 1),
        ".": () => this.shift(KEY_SHARE, 1),
        "[": () => this.shift(0, 1 - 2 * KEY_SHARE),
        "]": () => this.shift(0, 1 + 2 * KEY_SHARE),
        PageUp: () => this.moveSlice(1),
        PageDown: () => this.moveSlice(-1),
        Enter: draws(state) && (() => this.mark([cursor[first], cursor[second]])),
        Escape: state.draft && (() => change({ draft: null })),
      };
    },
  };
}

// note: on the image; look: as for useImage; actions: see actionsOf.
export function Tile({ tile, words, note, look, actions }) {
  const [canvas, image, marks] = useImage(look);
  const pressed = useRef(null);
  const { state } = actions;
  const act = () => actionsOf(tile, image, actions);
  const pointers = usePointers({
    press(point) {
      pressed.current = point && { point, moved: false, at: image.toPlane(...point), centre: image.centre, window: actions.window };
    },
    hover: (point) => act().hover(point),
    drag: (point) => pressed.current && act().dragTo(pressed.current, point, false),
    pinch: (factor, point) => act().zoomAt(...point, factor),
    release(point) {
      const { current: drag } = pressed;
      if (drag && !drag.moved) {
        act().moveTo(...drag.at);
        if (state.tool in MEASURES) act().mark(drag.at);
      } else if (drag && draws(state)) act().dragTo(drag, point, true);
      pressed.current = null;
    },
    cancel() {
      pressed.current = null;
    },
  });
  const onWheel = (event) => {
    event.preventDefault();
    act().zoomAt(event.offsetX, event.offsetY, WHEEL ** -event.deltaY);
  };
  const grip = state.tool !== "pan" || state.views[tile.axis].zoom > 1;
  const label = `Image of ${words}${tile.title && `, ${tile.title}`}; arrow keys move the cursor`;
  return html`<figure class="tile">
    <canvas ref=${canvas} class=${grip ? "plane grip" : "plane"} tabindex="0" role="application" aria-roledescription="image" aria-label=${label}
      ...${image && { onKeyDown: keyHandler((event) => act().keys(event)), onWheel, ...pointers }}></canvas>
    ${marks}
    ${note && html`<p class="on-image" role="note">${note}</p>`}
    ${tile.title && html`<figcaption>${tile.title}</figcaption>`}
  </figure>`;
}
