// Results on canvases with one range of colours and one cursor: quantities, planes, window, profile, region.
import { Alert, html, useEffect, useLater, useMemo, useRead, useReducer, useRef, useState } from "../parts/view.js";
import { Waiting } from "../parts/waiting.js";
import { ColourBar } from "./colour_bar.js";
import { ChoiceBar, Colours, Drawing, Keys, Overlay, percent, Slices, Swipe, Switch, Tools } from "./controls.js";
import { AXES, nodeAt, shownPlane } from "./field.js";
import { flat, inPlane, MEASURES, robustLimits, valueOf } from "./measures.js";
import { Measures } from "./measures_panel.js";
import { FADED, overMapOf, QUANTITIES, shown, shownOf } from "./quantities.js";
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

// The values of the quantities of the state, read anew when they change: { read, words, error }. read: { quantity, fields, spread, over, above }, a
// field for each pane; the standard deviations of the only one, or null; the name and the field of what lies above it, or null; words: how far
// they are read, "" once they are.
function useFields(panes, state) {
  const [found, setFound] = useState({ read: null, words: "", error: null });
  const { quantity, over } = state;
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
      const [spread, above] = await Promise.all([fading && "uncertainty", over].map((name) => (name ? panes[0].values.field(name) : null)));
      if (!newest) return;
      const [main] = fields;
      state.counted = main.uneven;
      state.cursor ??= [0, 1, 2].map((k) => (k < main.dimension ? main.position(AXES[k], Math.floor(main.shape[k] / 2)) : 0));
      if (!main.axes.includes(state.axis)) state.axis = "z";
      if (panes.length > 1 || main.axes.length === 1) state.planes = false;
      say({ read: { quantity, fields, spread, over, above }, words: "" });
    }
    readAll().catch((error) => say({ words: "", error }));
    return () => {
      newest = false;
    };
  }, [quantity, over, fading]);
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
// apart: whether each pane is read; over: the quantity and the field of what lies above, or null.
function Readout({ quantity, fields, panes, cursor, tile, place: [x, y], other, spoken, apart, over }) {
  const { axis, number } = tile;
  const field = fields[number];
  const plane = shownPlane(fields, tile, cursor);
  const [across, up] = plane.names;
  const words = [`${across} ${x.toFixed(2)} mm`, `${up} ${y.toFixed(2)} mm`];
  const k = AXES.indexOf(axis);
  const slice = field.nearest(axis, cursor[k]);
  if (field.dimension === 3 && !(field.uneven && axis === "z")) words.splice(k, 0, `${axis} ${field.position(axis, slice).toFixed(2)} mm`);
  const { node, value } = valueAt(other ? fields[tile.other].planeAt(axis, cursor) : plane, x, y);
  const worded = (found, of = quantity) => `${shown(found, of)} ${of.unit}`;
  if (apart) {
    panes.forEach(({ title }, pane) => words.push(`${title}: ${worded(valueAt(fields[pane].planeAt(axis, cursor), x, y).value)}`));
  } else {
    const named = ({ title }) => (over ? `${title.split(" (")[0]}: ` : "");
    words.push(named(quantity) + worded(value));
    if (over) words.push(named(over) + worded(valueAt(over.field.planeAt(axis, cursor), x, y).value, over));
    if (node) words.push(`node ${(field.dimension === 3 ? [...node.slice(0, k), slice, ...node.slice(k)] : node).join(", ")}`);
  }
  return html`<p class="readout" aria-live=${spoken ? "polite" : "off"} data-value=${value} data-x=${x} data-y=${y} data-node=${node ? node.join(",") : ""}>
    ${words.join(" · ")}
  </p>`;
}

// What is shown, for the caption of a figure. bars: of colours; look: of the first image.
function viewInWords({ planes, axis, cursor, over, opacity, clear, interpolation }, bars, main, look) {
  const at = (of) => `${of} = ${Number(main.position(of, main.nearest(of, cursor[AXES.indexOf(of)])).toFixed(2))}${main.uneven ? "" : " mm"}`;
  const [{ low, words }] = bars.slice(-1);
  const parts = [
    bars[0].words,
    over && `with ${words} above it, opacity ${percent(opacity)}${clear ? `, clear below ${Number(low.toPrecision(4))}` : ""}`,
    main.dimension === 3 && (planes ? `planes at ${main.axes.map(at).join(", ")}` : `slice at ${at(axis)}`),
    look.other && "border between two images",
    look.deviations && "the more transparent the less certain",
    interpolation === "linear" && "linear between nodes",
  ].filter(Boolean).join("; ");
  return parts[0].toUpperCase() + parts.slice(1);
}

// The images and what is measured in them, once there are values.
function Body({ read, panes, state, change, drawn }) {
  const [{ at: hover, spoken }, setHover] = useState({ at: null, spoken: false });
  const images = useRef(null);
  const { fields, spread } = read;
  const [main] = fields;
  const { cursor } = state;
  const comparing = panes.length > 1 && state.mode === "difference";
  const quantity = QUANTITIES[read.quantity];
  const tiles = layoutOf(panes, state, main.axes).map((tile) => ({ ...tile, key: `${tile.number} ${tile.axis} ${tile.minus}` }));
  // Measured anew for another arrangement, and not for another slice.
  const automatic = useMemo(() => limitsOf(quantity, fields, tiles, cursor, comparing), [read, state.mode, state.other, comparing && state.axis]);
  const [low, high] = state.window ?? automatic;
  const over = useMemo(() => {
    if (!read.above) return null;
    const above = QUANTITIES[read.over];
    return { ...above, field: read.above, automatic: limitsOf(above, [read.above]) };
  }, [read]);
  const [overLow, overHigh] = state.overWindow ?? over?.automatic ?? [];
  const map = state.map ?? (comparing ? "RdBu_r" : over ? "gray" : quantity.map);
  const overMap = over && (state.overMap ?? overMapOf(over));
  const truth = useBeside("truth", panes, read.quantity, state);
  const deviations = useBeside("uncertainty", panes, read.quantity, state);

  // Takes only sensible limits; null for the automatic ones.
  const windowSetter = (name) => (limits) => {
    const [from, to] = limits ?? [];
    if (!limits || (Number.isFinite(from) && Number.isFinite(to) && to - from > 1e-9 * Math.max(Math.abs(from), Math.abs(to), 1e-30))) change({ [name]: limits });
  };

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
    const { swipe, interpolation, opacity, clear } = state;
    const above = over && { plane: over.field.planeAt(axis, cursor), low: overLow, high: overHigh, map: overMap, clear };
    return { plane: shownPlane(fields, tile, cursor), other, swipe, deviations: fading, low, high, map, marks, over: above, opacity, interpolation, ...state.views[axis] };
  }

  const curves = tiles.filter((tile) => tile.axis === state.axis).flatMap((tile) => [
    { title: tile.other ? panes[0].title : tile.title || panes[0].title, plane: shownPlane(fields, tile, cursor) },
    ...(tile.other ? [{ title: panes[tile.other].title, plane: fields[tile.other].planeAt(tile.axis, cursor) }] : []),
  ]);
  const pointed = tiles.find((tile) => tile.key === hover?.key);
  const readAt = pointed ? hover.place : inPlane(tiles[0].axis).map((k) => cursor[k]);
  const setWindow = windowSetter("window");
  const actions = { main, state, window: [low, high], change, setWindow, setHover };
  const axes = [...new Set(tiles.map((tile) => tile.axis))].filter((axis) => main.count(axis) > 1);
  const moveSlice = (axis, index) => {
    cursor[AXES.indexOf(axis)] = main.position(axis, index);
    change({});
  };
  const inUnit = ({ words, unit }) => `${words}${unit ? ` (${unit})` : ""}`;
  const bars = [{ low, high, map, words: `${comparing ? "difference of " : ""}${inUnit(quantity)}` }];
  if (over) bars.push({ low: overLow, high: overHigh, map: overMap, words: inUnit(over) });
  const noteOf = ({ number: pane }) => panes[pane].notes[read.quantity] ?? panes[pane].notes[read.over];
  // What a figure shows, once it is wanted: see figure.js.
  drawn.current = () => {
    const canvases = images.current.querySelectorAll("canvas.plane");
    const panels = tiles.map((tile, k) => ({ title: tile.title, look: lookOf(tile), size: [canvases[k].clientWidth, canvases[k].clientHeight] }));
    return { panels, bars, words: [viewInWords(state, bars, main, panels[0].look), ...new Set(tiles.map(noteOf))].filter(Boolean).join(". ") };
  };
  return html`<div class="viewer-body">
    <div class="viewer-images">
      <div class="tiles" data-count=${tiles.length} ref=${images}>
        ${tiles.map((tile) => html`<${Tile} key=${tile.key} tile=${tile} words=${over ? `${quantity.words} with ${over.words} above` : quantity.words} note=${noteOf(tile)} look=${lookOf(tile)} actions=${actions} />`)}
      </div>
      ${state.mode === "swipe" && panes.length > 1 && html`<${Swipe} panes=${panes} other=${state.other} swipe=${state.swipe} change=${change} />`}
      <${Slices} main=${main} axes=${axes} axis=${main.axes.length > 1 && !state.planes ? state.axis : null} cursor=${cursor}
        onMove=${moveSlice} onAxis=${(axis) => change({ axis })} />
      <${Readout} quantity=${quantity} fields=${fields} panes=${panes} cursor=${cursor} tile=${pointed ?? tiles[0]} place=${readAt} other=${pointed?.other && hover.other}
        spoken=${spoken} apart=${panes.length > 1 && !comparing} over=${over} />
      <div class="colour-bars">${bars.map((bar) => html`<${ColourBar} ...${bar} />`)}</div>
    </div>
    <div class="viewer-side">
      <${Tools} tool=${state.tool} change=${change} />
      <${Colours} title="Window" low=${low} high=${high} map=${map} onWindow=${setWindow} onMap=${(name) => change({ map: name })}>
        <${Drawing} state=${state} fades=${fades(panes, read.quantity)} sliced=${panes.length === 1 && main.axes.length > 1} change=${change} />
      </${Colours}>
      ${over && html`<${Colours} title=${`Overlay: ${over.words}`} before="Overlay " low=${overLow} high=${overHigh} map=${overMap} onWindow=${windowSetter("overWindow")}
        onMap=${(name) => change({ overMap: name })}>
        <${Switch} name="clear" state=${state} change=${change}>Clear below the window</${Switch}>
      </${Colours}>`}
      <${Measures} curves=${curves} state=${state} quantity=${quantity} beside=${truth ? [{ title: QUANTITIES.truth.title, plane: truth }] : []}
        deviations=${deviations} detail=${panes[0].detail} change=${change} main=${main} />
      <${Keys} />
    </div>
  </div>`;
}

// panes: [{ title, values, stored, notes, detail }], with Values, the names of the stored quantities, notes as for ChoiceBar, and the resolution width, mm, if it is known. state: of the view, which is changed in place;
// keep(query): called when the view changes; drawn: { current }, which becomes a function that gives what figureOf draws.
export function Viewer({ panes, state, keep, drawn = {}, ...more }) {
  // The quantities that all panes have.
  const names = shownOf(panes[0].stored.filter((name) => panes.every(({ stored }) => stored.includes(name))));
  if (!names.includes(state.quantity)) [state.quantity] = names;
  const others = panes.length > 1 ? [] : names.filter((name) => name !== state.quantity);
  if (!others.includes(state.over)) Object.assign(state, { over: null, overMap: null, overWindow: null, clear: false });
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
      ${names.length > 1 && html`<${ChoiceBar} label="Quantity" className="quantities" entries=${names.map((name) => [name, QUANTITIES[name].title])} chosen=${state.quantity}
        notes=${Object.assign({}, ...panes.map(({ notes }) => notes))}
        onChoose=${(name) => change({ quantity: name, window: null, map: null })} />`}
      ${panes.length > 1 && html`<${ChoiceBar} label="Comparison" className="comparison-modes" entries=${Object.entries(MODES)} chosen=${state.mode}
        onChoose=${(mode) => change({ mode, window: null, map: null })} />`}
      ${others.length > 0 && html`<${Overlay} entries=${others.map((name) => [name, QUANTITIES[name].title])} state=${state} change=${change} />`}
    </div>
    <${Alert} error=${error} />
    ${words && html`<${Waiting} class="loading" role="status" words=${words} />`}
    ${read && html`<${Body} read=${read} panes=${panes} state=${state} change=${change} drawn=${drawn} />`}
  </section>`;
}
