// The state of a view, and its form in the address.
import { NAMES } from "./colormaps.js";
import { QUANTITIES } from "./quantities.js";

export const TOOLS = { pan: "Move", window: "Window", profile: "Profile", rectangle: "Rectangle", ellipse: "Ellipse" };
export const MODES = { side: "Side by side", difference: "Difference", swipe: "Swipe" };
const MOST_ZOOM = 64;

const short = (value) => String(Number(value.toPrecision(8)));

function numbers(text, count) {
  const found = (text ?? "").split(",").map(Number);
  return text && found.length === count && found.every(Number.isFinite) ? found : null;
}

export const clampZoom = (zoom) => Math.min(MOST_ZOOM, Math.max(0.25, zoom));

function freshState() {
  return {
    quantity: "speed", map: null, window: null, axis: "z", planes: false, fade: false, cursor: null, views: {},
    tool: "pan", profile: null, region: null, mode: "side", other: 1, swipe: 0.5,
  };
}

// The state that an address asks for; what is wrong in it is left at its default.
export function stateOf(query) {
  const state = freshState();
  const get = (name) => query.get(name);
  if (Object.hasOwn(QUANTITIES, get("q") ?? "")) state.quantity = get("q");
  if (NAMES.includes(get("map"))) state.map = get("map");
  const window = numbers(get("window"), 2);
  if (window && window[0] < window[1]) state.window = window;
  if (["x", "y", "z"].includes(get("axis"))) state.axis = get("axis");
  state.planes = get("planes") === "3";
  state.fade = get("fade") === "1";
  state.cursor = numbers(get("at"), 3);
  for (const axis of ["x", "y", "z"]) {
    const view = numbers(get(`view-${axis}`), 3);
    if (view) state.views[axis] = { centre: view.slice(0, 2), zoom: clampZoom(view[2]) };
  }
  if (Object.hasOwn(TOOLS, get("tool") ?? "")) state.tool = get("tool");
  state.profile = numbers(get("profile"), 4);
  for (const shape of ["rectangle", "ellipse"]) {
    const place = numbers(get(shape), 4);
    if (place) state.region = { shape, place };
  }
  if (Object.hasOwn(MODES, get("mode") ?? "")) state.mode = get("mode");
  const other = numbers(get("other"), 1);
  if (other && [1, 2, 3].includes(other[0])) [state.other] = other;
  const swipe = numbers(get("swipe"), 1);
  if (swipe && swipe[0] >= 0 && swipe[0] <= 1) [state.swipe] = swipe;
  return state;
}

export function queryOfState(state) {
  const query = new URLSearchParams();
  const usual = freshState();
  const put = (name, value) => query.set(name, [value].flat().map((one) => (typeof one === "number" ? short(one) : one)).join(","));
  if (state.quantity !== usual.quantity) put("q", state.quantity);
  if (state.map) put("map", state.map);
  if (state.window) put("window", state.window);
  if (state.axis !== usual.axis) put("axis", state.axis);
  if (state.planes) put("planes", "3");
  if (state.fade) put("fade", "1");
  if (state.cursor) put("at", state.cursor);
  for (const [axis, { centre, zoom }] of Object.entries(state.views)) put(`view-${axis}`, [...centre, zoom]);
  if (state.tool !== usual.tool) put("tool", state.tool);
  if (state.profile) put("profile", state.profile);
  if (state.region) put(state.region.shape, state.region.place);
  if (state.mode !== usual.mode) put("mode", state.mode);
  if (state.other !== usual.other) put("other", state.other);
  if (state.swipe !== usual.swipe) put("swipe", state.swipe);
  return query;
}
