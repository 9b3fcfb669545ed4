// The state of a view, and its form in the address.
import { NAMES } from "./colour_bar.js";
import { AXES } from "./field.js";
import { MEASURES } from "./measures.js";
import { QUANTITIES } from "./quantities.js";

export const TOOLS = {
  pan: "Move", window: "Window", ...Object.fromEntries(Object.entries(MEASURES).map(([name, { title }]) => [name, title])), profile: "Profile", rectangle: "Rectangle",
  ellipse: "Ellipse",
};
export const MODES = { side: "Side by side", difference: "Difference", swipe: "Swipe" };
// Between nodes.
export const INTERPOLATIONS = ["nearest", "linear"];
const MOST_ZOOM = 64;
const NOTHING = [];
// Of a plane whose whole image is shown, and of all planes.
export const WHOLE = { centre: null, zoom: 1 };
export const WHOLE_VIEWS = { x: WHOLE, y: WHOLE, z: WHOLE };

const short = (value) => String(Number(value.toPrecision(8)));

export const clampZoom = (zoom) => Math.min(MOST_ZOOM, Math.max(0.25, zoom));

// Kinds of values: read(text) gives undefined for what is wrong.
const oneOf = (names) => ({ read: (text) => (names.includes(text) ? text : undefined), words: String });
const flag = (word) => ({ read: (text) => text === word, words: () => word });
const listOf = (count, accepts = () => true) => ({
  read(text) {
    const values = text.split(",").map(Number);
    return text && values.length === count && values.every(Number.isFinite) && accepts(values) ? values : undefined;
  },
  words: (values) => values.map(short).join(","),
});
const number = (accepts) => {
  const { read } = listOf(1, ([value]) => accepts(value));
  return { read: (text) => read(text)?.[0], words: short };
};

// As distance,z,x,y,z,x,y,z;angle,…
const measured = {
  read(text) {
    const measures = text.split(";").map((entry) => {
      const [kind, axis, ...rest] = entry.split(",");
      const values = rest.map(Number);
      const points = Array.from({ length: values.length / 3 }, (_, k) => values.slice(3 * k, 3 * k + 3));
      const known = kind in MEASURES && AXES.includes(axis) && values.length % 3 === 0 && values.every(Number.isFinite);
      return known && points.length >= Math.min(3, MEASURES[kind].points) ? { kind, axis, points } : null;
    });
    return measures.includes(null) ? undefined : measures;
  },
  words: (measures) => measures.map(({ kind, axis, points }) => [kind, axis, ...points.flat().map(short)].join(",")).join(";"),
};

// Of the state: the parameter of the address, the default, and the kind of the value.
const FIELDS = {
  quantity: ["q", "speed", oneOf(Object.keys(QUANTITIES))],
  map: ["map", null, oneOf(NAMES)],
  window: ["window", null, listOf(2, ([low, high]) => low < high)],
  interpolation: ["interpolation", "nearest", oneOf(INTERPOLATIONS)],
  over: ["over", null, oneOf(Object.keys(QUANTITIES))],
  opacity: ["opacity", 0.5, number((value) => value >= 0 && value <= 1)],
  overMap: ["over-map", null, oneOf(NAMES)],
  overWindow: ["over-window", null, listOf(2, ([low, high]) => low < high)],
  clear: ["clear", false, flag("1")],
  axis: ["axis", "z", oneOf([...AXES])],
  planes: ["planes", false, flag("3")],
  fade: ["fade", false, flag("1")],
  cursor: ["at", null, listOf(3)],
  tool: ["tool", "pan", oneOf(Object.keys(TOOLS))],
  profile: ["profile", null, listOf(4)],
  measures: ["measures", NOTHING, measured],
  mode: ["mode", "side", oneOf(Object.keys(MODES))],
  other: ["other", 1, number((value) => [1, 2, 3].includes(value))],
  swipe: ["swipe", 0.5, number((value) => value >= 0 && value <= 1)],
};
const PLACE = listOf(4);
const VIEW = listOf(3);

// The state that an address asks for; what is wrong in it is left at its default.
export function stateOf(query) {
  const state = { views: { ...WHOLE_VIEWS }, region: null, draft: null };
  for (const [field, [name, usual, { read }]] of Object.entries(FIELDS)) state[field] = (query.has(name) ? read(query.get(name)) : undefined) ?? usual;
  for (const axis of AXES) {
    const view = VIEW.read(query.get(`view-${axis}`) ?? "");
    if (view) state.views[axis] = { centre: view.slice(0, 2), zoom: clampZoom(view[2]) };
  }
  for (const shape of ["rectangle", "ellipse"]) {
    const place = PLACE.read(query.get(shape) ?? "");
    if (place) state.region = { shape, place };
  }
  return state;
}

export function queryOfState(state) {
  const query = new URLSearchParams();
  for (const [field, [name, usual, { words }]] of Object.entries(FIELDS)) if (state[field] !== usual && state[field]?.length !== 0) query.set(name, words(state[field]));
  for (const [axis, { centre, zoom }] of Object.entries(state.views)) if (centre) query.set(`view-${axis}`, VIEW.words([...centre, zoom]));
  if (state.region) query.set(state.region.shape, PLACE.words(state.region.place));
  return query;
}
