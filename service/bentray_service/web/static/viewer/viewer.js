// Results on canvases with one range of colours and one cursor: quantities, planes, window, profile, region.
import { Alert, html, useEffect, useLater, useMemo, useRead, useReducer, useState } from "../parts/view.js";
import { ColourBar } from "./colour_bar.js";
import { ChoiceBar, Keys, Slices, Swipe, Tools, Window } from "./controls.js";
import { AXES, nodeAt, shownPlane } from "./field.js";
import { flat, inPlane, MEASURES, robustLimits, valueOf } from "./measures.js";
import { Measures } from "./measures_panel.js";
import { FADED, QUANTITIES, shown, shownOf } from "./quantities.js";
import { MODES, queryOfState } from "./state.js";
import { Tile } from "./tile.js";

const SAVE_MS = 250;

const fades = (panes, quantity) => panes.length === 1 && panes[0].stored.includes("uncertainty") && FADED.includes(quantity);

// What is shown of which pane: { number, axis, title, minus, other }; minus: the first pane is subtracted; other: the number of the right image.
function layoutOf(panes, { planes, axis, mode, other }, axes) {
  if (panes.length === 1) return (planes ? axes : [axis]).map((across) => ({ number: 0, axis: across, title: planes ? `across ${across}` : "" }));
  const [first] = panes;
  if (mode === "side") return panes.map(({ title }, number) => ({ number, axis, title }));
  if (mode === "swipe") return [{ number: 0, axis, other, title: `${first.title} | ${panes[other].title}` }];
  return panes.slice(1).map(({ title }, k) => ({ number: k + 1, axis, minus: true, title: `${title} minus ${first.title}` }));
}

// The limits of the colours that suit the values.
function limitsOf({ limits, symmetric, least }, fields, tiles, cursor, comparing) {
  const arrays = comparing ? tiles.map((tile) => shownPlane(fields, tile, cursor).values) : fields.map((field) => field.values);
  const [low, high] = robustLimits(arrays);
  const reach = Math.max(Math.abs(low), Math.abs(high));
  return comparing || symmetric ? [-reach, reach] : limits ?? [least ?? low, high];
}

// The values of the quantity of the state, read anew when it changes: { read, words, error }. read: { quantity, fields, spread }, a field for each
// pane and the standard deviations of the only one, or null; words: how far they are read, "" once they are.
function useFields(panes, state) {
  const [found, setFound] = useState({ read: null, words: "", error: null });
  const { quantity } = state;
  const fading = state.fade && fades(panes, quantity);
  useEffect(() => {
    let newest = true;
    const say = (part) => newest && setFound((before) => ({ ...before, ...part }));
    const shares = panes.map(() => 0);
    async function readAll() {
      say({ words: "Reading the values", error: null });
      const fields = await Promise.all(panes.map(({ values }, k) => values.field(quantity, (share) => {
        shares[k] = share;
        say({ words: `Reading the values, ${Math.floor((100 * shares.reduce((a, b) => a + b)) / shares.length)} %` });
      })));
      const spread = fading ? await panes[0].values.field("uncertainty") : null;
      if (!newest) return;
      const [main] = fields;
      state.counted = main.uneven;
      state.cursor ??= [0, 1, 2].map((k) => (k < main.dimension ? main.position(AXES[k], Math.floor(main.shape[k] / 2)) : 0));
      if (!main.axes.includes(state.axis)) state.axis = "z";
      if (panes.length > 1 || main.axes.length === 1) state.planes = false;
      say({ read: { quantity, fields, spread }, words: "" });
    }
    readAll().catch((error) => say({ words: "", error }));
    return () => {
      newest = false;
    };
  }, [quantity, fading]);
  return found;
}

// The plane of a stored quantity beside a region of the speed; null before it is read, and where there is none.
function useBeside(name, panes, quantity, { region, axis, cursor }) {
  const wanted = region !== null && quantity === "speed" && panes.length === 1 && panes[0].stored.includes(name);
  const [field] = useRead(() => (wanted ? panes[0].values.field(name) : null), { key: wanted });
  return field?.planeAt(axis, cursor) ?? null;
}

function valueAt(plane, x, y) {
  const node = nodeAt(plane, x, y);
  return { node, value: node ? plane.values[node[0] * plane.nb + node[1]] : NaN };
}

// Position, node and value under the pointer or the cursor, in a line. tile: the image; place: in it, mm; other: whether the right one of two images is shown there; spoken: whether a key moved the cursor;
// apart: whether each pane is read.
function Readout({ quantity, fields, panes, cursor, tile, place: [x, y], other, spoken, apart }) {
  const { axis, number } = tile;
  const field = fields[number];
  const plane = shownPlane(fields, tile, cursor);
  const [across, up] = plane.names;
  const words = [`${across} ${x.toFixed(2)} mm`, `${up} ${y.toFixed(2)} mm`];
  const k = AXES.indexOf(axis);
  const slice = field.nearest(axis, cursor[k]);
  if (field.dimension === 3 && !(field.uneven && axis === "z")) words.splice(k, 0, `${axis} ${field.position(axis, slice).toFixed(2)} mm`);
  const { node, value } = valueAt(other ? fields[tile.other].planeAt(axis, cursor) : plane, x, y);
  const worded = (found) => `${shown(found, quantity)} ${quantity.unit}`;
  if (apart) {
    panes.forEach(({ title }, pane) => words.push(`${title}: ${worded(valueAt(fields[pane].planeAt(axis, cursor), x, y).value)}`));
  } else {
    words.push(worded(value));
    if (node) words.push(`node ${(field.dimension === 3 ? [...node.slice(0, k), slice, ...node.slice(k)] : node).join(", ")}`);
  }
  return html`<p class="readout" aria-live=${spoken ? "polite" : "off"} data-value=${value} data-x=${x} data-y=${y} data-node=${node ? node.join(",") : ""}>
    ${words.join(" · ")}
  </p>`;
}

// The images and what is measured in them, once there are values.
function Body({ read, panes, state, change }) {
  const [{ at: hover, spoken }, setHover] = useState({ at: null, spoken: false });
  const { fields, spread } = read;
  const [main] = fields;
  const { cursor } = state;
  const comparing = panes.length > 1 && state.mode === "difference";
  const quantity = QUANTITIES[read.quantity];
  const tiles = layoutOf(panes, state, main.axes).map((tile) => ({ ...tile, key: `${tile.number} ${tile.axis} ${tile.minus}` }));
  // Measured anew for another arrangement, and not for another slice.
  const automatic = useMemo(() => limitsOf(quantity, fields, tiles, cursor, comparing), [read, state.mode, state.other, comparing && state.axis]);
  const [low, high] = state.window ?? automatic;
  const map = state.map ?? (comparing ? "RdBu_r" : quantity.map);
  const truth = useBeside("truth", panes, read.quantity, state);
  const deviations = useBeside("uncertainty", panes, read.quantity, state);

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

  function lookOf(tile) {
    const { axis } = tile;
    const linked = hover && hover.key !== tile.key && hover.axis === axis ? hover.place : null;
    const marks = {
      cursor: linked ?? inPlane(axis).map((k) => cursor[k]),
      ...(axis === state.axis && { profile: state.profile, region: state.region }),
      measures: marksOf(tile),
    };
    const other = tile.other ? fields[tile.other].planeAt(axis, cursor) : null;
    const fading = spread?.planeAt(axis, cursor) ?? null;
    return { plane: shownPlane(fields, tile, cursor), other, swipe: state.swipe, deviations: fading, low, high, map, marks, ...state.views[axis] };
  }

  const curves = tiles.filter((tile) => tile.axis === state.axis).flatMap((tile) => [
    { title: tile.other ? panes[0].title : tile.title || panes[0].title, plane: shownPlane(fields, tile, cursor) },
    ...(tile.other ? [{ title: panes[tile.other].title, plane: fields[tile.other].planeAt(tile.axis, cursor) }] : []),
  ]);
  const pointed = tiles.find((tile) => tile.key === hover?.key);
  const readAt = pointed ? hover.place : inPlane(tiles[0].axis).map((k) => cursor[k]);
  const actions = { main, state, window: [low, high], change, setWindow, setHover };
  const axes = [...new Set(tiles.map((tile) => tile.axis))].filter((axis) => main.count(axis) > 1);
  const moveSlice = (axis, index) => {
    cursor[AXES.indexOf(axis)] = main.position(axis, index);
    change({});
  };
  const words = `${comparing ? "difference of " : ""}${quantity.words}${quantity.unit ? ` (${quantity.unit})` : ""}`;
  return html`<div class="viewer-body">
    <div class="viewer-images">
      <div class="tiles" data-count=${tiles.length}>
        ${tiles.map((tile) => html`<${Tile} key=${tile.key} tile=${tile} words=${quantity.words} look=${lookOf(tile)} actions=${actions} />`)}
      </div>
      ${state.mode === "swipe" && panes.length > 1 && html`<${Swipe} panes=${panes} other=${state.other} swipe=${state.swipe} change=${change} />`}
      <${Slices} main=${main} axes=${axes} axis=${main.axes.length > 1 && !state.planes ? state.axis : null} cursor=${cursor}
        onMove=${moveSlice} onAxis=${(axis) => change({ axis })} />
      <${Readout} quantity=${quantity} fields=${fields} panes=${panes} cursor=${cursor} tile=${pointed ?? tiles[0]} place=${readAt} other=${pointed?.other && hover.other}
        spoken=${spoken} apart=${panes.length > 1 && !comparing} />
      <${ColourBar} low=${low} high=${high} map=${map} words=${words} />
    </div>
    <div class="viewer-side">
      <${Tools} tool=${state.tool} change=${change} />
      <${Window} low=${low} high=${high} map=${map} fade=${state.fade} planes=${state.planes} fades=${fades(panes, read.quantity)}
        sliced=${panes.length === 1 && main.axes.length > 1} setWindow=${setWindow} change=${change} />
      <${Measures} curves=${curves} state=${state} quantity=${quantity} beside=${truth ? [{ title: QUANTITIES.truth.title, plane: truth }] : []}
        deviations=${deviations} detail=${panes[0].detail} change=${change} main=${main} />
      <${Keys} />
    </div>
  </div>`;
}

// panes: [{ title, values, stored, detail }], with Values, the names of the stored quantities, and the resolution width, mm, if it is known. state: of the view, which is changed in place;
// keep(query): called when the view changes.
export function Viewer({ panes, state, keep, ...more }) {
  // The quantities that all panes have.
  const names = shownOf(panes[0].stored.filter((name) => panes.every(({ stored }) => stored.includes(name))));
  if (!names.includes(state.quantity)) [state.quantity] = names;
  state.other = Math.max(1, Math.min(state.other, panes.length - 1));
  const [, redraw] = useReducer((count) => count + 1, 0);
  const later = useLater();
  const { read, words, error } = useFields(panes, state);
  const save = () => later(() => keep(queryOfState(state)), SAVE_MS);
  useEffect(save, [read]);
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
    ${read && html`<${Body} read=${read} panes=${panes} state=${state} change=${change} />`}
  </section>`;
}
