// Results on canvases with one range of colours and one cursor: quantities, planes, window, profile, region.
import { Alert, html, useEffect, useLater, useMemo, useReducer, useRef, useState } from "../parts/view.js";
import { ColourBar } from "./colour_bar.js";
import { ChoiceBar, Keys, Slices, Swipe, Tools, Window } from "./controls.js";
import { AXES, Planes } from "./field.js";
import { Measures } from "./measures_panel.js";
import { robustLimits } from "./measures.js";
import { flat, inPlane, MEASURES, valueOf, withDrag, withPoint } from "./measuring.js";
import { FADED, QUANTITIES, shownOf } from "./quantities.js";
import { Readout } from "./readout.js";
import { MODES, queryOfState } from "./state.js";
import { Tile } from "./tile.js";

const SAVE_MS = 250;
// Within as many pixels of the page a point is the same one.
const SAME_PX = 7;

const fades = (panes, quantity) => panes.length === 1 && panes[0].stored.includes("uncertainty") && FADED.includes(quantity);

// The names of the quantities that all panes have.
function commonOf(panes) {
  return shownOf(panes.map((pane) => pane.stored).reduce((all, stored) => all.filter((name) => stored.includes(name))));
}

// What is shown of which pane: { number, axis, title, minus, other }; minus: the first pane is subtracted; other: the number of the right image.
function layoutOf(panes, { planes, axis, mode, other }, axes) {
  if (panes.length === 1) return (planes ? axes : [axis]).map((across) => ({ number: 0, axis: across, title: planes ? `across ${across}` : "" }));
  const [first] = panes;
  if (mode === "side") return panes.map(({ title }, number) => ({ number, axis, title }));
  if (mode === "swipe") return [{ number: 0, axis, other, title: `${first.title} | ${panes[other].title}` }];
  return panes.slice(1).map(({ title }, k) => ({ number: k + 1, axis, minus: true, title: `${title} minus ${first.title}` }));
}

// The limits of the colours that suit the values.
function limitsOf(planes, tiles, cursor, comparing) {
  const { limits, symmetric, least } = QUANTITIES[planes.quantity];
  const arrays = comparing ? tiles.map((tile) => planes.shown(tile, cursor).values) : planes.fields.map((field) => field.values);
  const [low, high] = robustLimits(arrays);
  const reach = Math.max(Math.abs(low), Math.abs(high));
  return comparing || symmetric ? [-reach, reach] : limits ?? [least ?? low, high];
}

// The values of the quantity of the state, read anew when it changes: { planes, words, error }; words: how far they are read, "" once they are.
function usePlanes(panes, state) {
  const [found, setFound] = useState({ planes: null, words: "", error: null });
  const { quantity } = state;
  const fading = state.fade && fades(panes, quantity);
  useEffect(() => {
    let newest = true;
    const say = (part) => newest && setFound((before) => ({ ...before, ...part }));
    const shares = panes.map(() => 0);
    async function read() {
      say({ words: "Reading the values", error: null });
      const fields = await Promise.all(panes.map(({ values }, k) => values.field(quantity, (share) => {
        shares[k] = share;
        say({ words: `Reading the values, ${Math.floor((100 * shares.reduce((a, b) => a + b)) / shares.length)} %` });
      })));
      const spread = fading ? await panes[0].values.field("uncertainty") : null;
      if (!newest) return;
      const planes = new Planes(quantity, fields, spread);
      const { main } = planes;
      state.counted = main.uneven;
      state.cursor ??= [0, 1, 2].map((k) => (k < main.dimension ? main.position(AXES[k], Math.floor(main.shape[k] / 2)) : 0));
      if (!main.axes.includes(state.axis)) state.axis = "z";
      if (panes.length > 1 || main.axes.length === 1) state.planes = false;
      say({ planes, words: "" });
    }
    read().catch((error) => say({ words: "", error }));
    return () => {
      newest = false;
    };
  }, [quantity, fading]);
  return found;
}

// A stored quantity beside a region of the speed, at the shown plane: read once, and then drawn. The function gives null before that.
function useBesides(pane, planes, state, redraw) {
  const besides = useRef({});
  return (name) => {
    if (!state.region || planes.quantity !== "speed" || !pane?.stored.includes(name)) return null;
    besides.current[name] ??= pane.values.field(name).then((field) => {
      besides.current[name] = field;
      redraw();
    }, () => {});
    const field = besides.current[name];
    return field.nearest ? planes.planeOf(field, name, state.axis, state.cursor) : null;
  };
}

// What pointers and keys on the canvas of a tile do, see pointing.js.
function actionsOf({ axis, key }, view, { main, state, window, change, setWindow, setHover }) {
  const [first, second] = inPlane(axis);
  const moveTo = (places) => {
    for (const [k, place] of places) state.cursor[k] = main.position(AXES[k], main.nearest(AXES[k], place));
    change({});
  };
  // A point of the plane at the cursor, [x, y, z].
  const inSpace = ([a, b]) => state.cursor.map((place, k) => (k === first ? a : k === second ? b : place));
  return {
    state,
    window,
    setWindow,
    get view() {
      return state.views[axis] ?? { centre: null, zoom: 1 };
    },
    get cursor() {
      return [state.cursor[first], state.cursor[second]];
    },
    setView: (centre, zoom) => change({ views: { ...state.views, [axis]: { centre, zoom } } }),
    hover(point) {
      const place = point && view.toPlane(...point);
      setHover({ at: place && { key, axis, place, other: view.showsOther(place[0]) }, spoken: false });
    },
    setCursor: (x, y) => moveTo([[first, x], [second, y]]),
    moveCursor(da, db) {
      setHover({ at: null, spoken: true });
      moveTo([[first, state.cursor[first] + da * main.spacing[first]], [second, state.cursor[second] + db * main.spacing[second]]]);
    },
    moveSlice(by) {
      const k = AXES.indexOf(axis);
      const index = main.nearest(axis, state.cursor[k]) + by;
      if (index >= 0 && index < main.count(axis)) state.cursor[k] = main.position(axis, index);
      change({});
    },
    mark: (point) => change(withPoint(state, axis, inSpace(point), SAME_PX / view.scale)),
    drag: (from, to, ended) => change(withDrag(state, axis, inSpace(from), inSpace(to), SAME_PX / view.scale, ended)),
    cancel: () => change({ draft: null }),
    automatic: () => change({ window: null }),
    reset() {
      const { [axis]: _, ...views } = state.views;
      change({ views });
    },
  };
}

// The images and what is measured in them, once there are values.
function Body({ planes, panes, state, change, redraw }) {
  const [{ at: hover, spoken }, setHover] = useState({ at: null, spoken: false });
  const { main } = planes;
  const { cursor } = state;
  const comparing = panes.length > 1 && state.mode === "difference";
  const quantity = QUANTITIES[planes.quantity];
  const tiles = layoutOf(panes, state, main.axes).map((tile) => ({ ...tile, key: `${tile.number} ${tile.axis} ${tile.minus}` }));
  // Measured anew for another arrangement, and not for another slice.
  const automatic = useMemo(() => limitsOf(planes, tiles, cursor, comparing), [planes, state.mode, state.other, comparing && state.axis]);
  const [low, high] = state.window ?? automatic;
  const map = state.map ?? (comparing ? "RdBu_r" : quantity.map);
  const beside = useBesides(panes.length === 1 ? panes[0] : null, planes, state, redraw);
  const truth = beside("truth");

  function setWindow(from, to) {
    if (Number.isFinite(from) && Number.isFinite(to) && to - from > 1e-9 * Math.max(Math.abs(from), Math.abs(to), 1e-30)) change({ window: [from, to] });
  }

  // Measures that have a point in the slice of a tile, and the one that is being set, to the pointer or the cursor.
  function marksOf({ axis, key }) {
    const k = AXES.indexOf(axis);
    const slice = main.nearest(axis, cursor[k]);
    const { draft, measures } = state;
    const tip = [...cursor];
    if (hover?.key === key) inPlane(axis).forEach((of, n) => (tip[of] = hover.place[n]));
    const missing = draft && draft.points.length < (MEASURES[draft.tool]?.points ?? 2);
    const begun = draft ? [{ kind: draft.tool, axis: draft.axis, points: missing ? [...draft.points, tip] : draft.points }] : [];
    return [...measures, ...begun].filter((measure) => (
      (measure.kind !== "area" || measure.axis === axis) && measure.points.some((point) => main.nearest(axis, point[k]) === slice)
    )).map((measure) => {
      const whole = measure.points.length >= Math.min(3, MEASURES[measure.kind]?.points ?? Infinity);
      const words = whole ? `${valueOf(measure).toFixed(measure.kind === "angle" ? 1 : 2)} ${MEASURES[measure.kind].unit}` : "";
      return { kind: measure.kind, points: flat(measure.points, axis), words };
    });
  }

  function imageOf(tile) {
    const { axis } = tile;
    const linked = hover && hover.key !== tile.key && hover.axis === axis ? hover.place : null;
    const marks = {
      cursor: linked ?? inPlane(axis).map((k) => cursor[k]),
      ...(axis === state.axis && { profile: state.profile, region: state.region }),
      measures: marksOf(tile),
    };
    const other = tile.other ? planes.plane(tile.other, axis, cursor) : null;
    const look = state.views[axis] ?? { centre: null, zoom: 1 };
    return { plane: planes.shown(tile, cursor), other, swipe: state.swipe, deviations: planes.deviations(axis, cursor), low, high, map, marks, ...look };
  }

  const curves = tiles.filter((tile) => tile.axis === state.axis).flatMap((tile) => [
    { title: tile.other ? panes[0].title : tile.title || panes[0].title, plane: planes.shown(tile, cursor) },
    ...(tile.other ? [{ title: panes[tile.other].title, plane: planes.plane(tile.other, tile.axis, cursor) }] : []),
  ]);
  const pointed = tiles.find((tile) => tile.key === hover?.key);
  const readAt = pointed ? hover.place : inPlane(tiles[0].axis).map((k) => cursor[k]);
  const shared = { main, state, window: [low, high], change, setWindow, setHover };
  const axes = [...new Set(tiles.map((tile) => tile.axis))].filter((axis) => main.count(axis) > 1);
  const moveSlice = (axis, index) => {
    cursor[AXES.indexOf(axis)] = main.position(axis, index);
    change({});
  };
  const words = `${comparing ? "difference of " : ""}${quantity.words}${quantity.unit ? ` (${quantity.unit})` : ""}`;
  return html`<div class="viewer-body">
    <div class="viewer-images">
      <div class="tiles" data-count=${tiles.length}>
        ${tiles.map((tile) => html`<${Tile} key=${tile.key} title=${tile.title} words=${quantity.words} image=${imageOf(tile)}
          grip=${state.tool !== "pan" || state.views[tile.axis]?.zoom > 1} actionsOf=${(view) => actionsOf(tile, view, shared)} />`)}
      </div>
      ${state.mode === "swipe" && panes.length > 1 && html`<${Swipe} panes=${panes} other=${state.other} swipe=${state.swipe} change=${change} />`}
      <${Slices} main=${main} axes=${axes} axis=${main.axes.length > 1 && !state.planes ? state.axis : null} cursor=${cursor}
        onMove=${moveSlice} onAxis=${(axis) => change({ axis })} />
      <${Readout} planes=${planes} panes=${panes} cursor=${cursor} tile=${pointed ?? tiles[0]} place=${readAt} other=${pointed?.other && hover.other}
        spoken=${spoken} apart=${panes.length > 1 && !comparing} />
      <${ColourBar} low=${low} high=${high} map=${map} words=${words} />
    </div>
    <div class="viewer-side">
      <${Tools} tool=${state.tool} change=${change} />
      <${Window} low=${low} high=${high} map=${map} fade=${state.fade} planes=${state.planes} fades=${fades(panes, planes.quantity)}
        sliced=${panes.length === 1 && main.axes.length > 1} setWindow=${setWindow} change=${change} />
      <${Measures} curves=${curves} state=${state} quantity=${quantity} beside=${truth ? [{ title: QUANTITIES.truth.title, plane: truth }] : []}
        deviations=${beside("uncertainty")} detail=${panes[0].detail} change=${change}
        planeOf=${(axis, point) => planes.sliceAt(axis, point[AXES.indexOf(axis)])} />
      <${Keys} />
    </div>
  </div>`;
}

// panes: [{ title, values, stored, detail }], with Values, the names of the stored quantities, and the resolution width, mm, if it is known. state: of the view, which is changed in place;
// keep(query): called when the view changes.
export function Viewer({ panes, state, keep, ...more }) {
  const names = useMemo(() => commonOf(panes), []);
  if (!names.includes(state.quantity)) [state.quantity] = names;
  state.other = Math.max(1, Math.min(state.other, panes.length - 1));
  const [, redraw] = useReducer((count) => count + 1, 0);
  const later = useLater();
  const { planes, words, error } = usePlanes(panes, state);
  const save = () => later(() => keep(queryOfState(state)), SAVE_MS);
  useEffect(save, [planes]);
  const change = (part) => {
    Object.assign(state, part);
    redraw();
    save();
  };
  return html`<section class="image-viewer" aria-busy=${words ? "true" : undefined} ...${more}>
    <div class="viewer-bar">
      <${ChoiceBar} label="Quantity" className="quantities" entries=${names.map((name) => [name, QUANTITIES[name].title])} chosen=${state.quantity}
        onChoose=${(name) => change({ quantity: name, window: null, map: null })} />
      ${panes.length > 1 && html`<${ChoiceBar} label="Comparison" className="comparison-modes" entries=${Object.entries(MODES)} chosen=${state.mode}
        onChoose=${(mode) => change({ mode, window: null, map: null })} />`}
    </div>
    <${Alert} error=${error} />
    <p class="loading" role="status" hidden=${!words}>${words}</p>
    ${planes && html`<${Body} planes=${planes} panes=${panes} state=${state} change=${change} redraw=${redraw} />`}
  </section>`;
}
