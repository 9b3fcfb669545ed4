// Distances, angles and areas between points in mm, what a tool makes of the points that are set; profiles, regions and limits of a plane.
import { AXES, interpolated } from "./field.js";

// points: how many a measure has; an area is closed by a point at its first or last one.
export const MEASURES = {
  distance: { title: "Distance", unit: "mm", points: 2 },
  angle: { title: "Angle", unit: "°", points: 3 },
  area: { title: "Area", unit: "mm²", points: Infinity },
};

const apart = (a, b) => Math.hypot(...a.map((value, k) => value - b[k]));

// The two axes in the plane across an axis.
export const inPlane = (axis) => [0, 1, 2].filter((other) => other !== AXES.indexOf(axis));

// Points in the plane across an axis, [right, up].
export const flat = (points, axis) => points.map((point) => inPlane(axis).map((k) => point[k]));

// The value of a measure in its unit; the second point of an angle is its vertex.
export function valueOf({ kind, axis, points }) {
  if (kind === "distance") return apart(...points);
  if (kind === "angle") {
    const [a, vertex, b] = points;
    const scalar = a.reduce((sum, value, k) => sum + (value - vertex[k]) * (b[k] - vertex[k]), 0);
    return (180 / Math.PI) * Math.acos(Math.min(1, Math.max(-1, scalar / (apart(a, vertex) * apart(b, vertex)))));
  }
  const outline = flat(points, axis);
  return Math.abs(outline.reduce((sum, [x, y], k) => {
    const [u, v] = outline[(k + 1) % outline.length];
    return sum + (x * v - u * y) / 2;
  }, 0));
}

// What the state becomes by the last point of a tool.
function completed({ tool, measures, region }, axis, points) {
  if (tool in MEASURES) return { draft: null, measures: [...measures, { kind: tool, axis, points }] };
  const place = flat(points, axis).flat();
  return { draft: null, axis, ...(tool === "profile" ? { profile: place } : { region: { ...region, shape: tool, place } }) };
}

// The points that are set so far by this tool; outlines and shapes keep to their plane, and all where slices are counted.
function pointsSoFar({ tool, draft, counted }, axis, point) {
  if (draft?.tool !== tool) return [];
  const across = AXES.indexOf(axis);
  const free = !counted && (tool === "distance" || tool === "angle");
  return free || (draft.axis === axis && draft.points[0][across] === point[across]) ? draft.points : [];
}

// What the state becomes by a point; near: what is the same place, mm.
export function withPoint(state, axis, point, near) {
  const { tool } = state;
  const before = pointsSoFar(state, axis, point);
  const closes = tool === "area" && before.length > 2 && [before[0], before.at(-1)].some((other) => apart(other, point) <= near);
  const points = closes ? before : [...before, point];
  return closes || points.length >= (MEASURES[tool]?.points ?? 2) ? completed(state, axis, points) : { draft: { tool, axis, points } };
}

// What the state becomes by dragging from one point to another; an area follows the way, in steps longer than near.
export function withDrag(state, axis, from, to, near, ended) {
  const { tool } = state;
  if (tool === "area") {
    const before = pointsSoFar(state, axis, to);
    const path = before.length ? before : [from];
    const points = apart(path.at(-1), to) > near ? [...path, to] : path;
    return ended && points.length > 2 ? completed(state, axis, points) : { draft: { tool, axis, points } };
  }
  if (tool === "angle" || (tool === "distance" && !ended)) return { draft: { tool, axis, points: [from, to] } };
  return completed(state, axis, [from, to]);
}

// Values along a line, by linear interpolation at half the smaller node spacing: x, the distance in mm, and y.
export function profileOf(plane, [x0, y0, x1, y1]) {
  const length = Math.hypot(x1 - x0, y1 - y0);
  const count = Math.max(2, Math.ceil(length / (0.5 * Math.min(...plane.spacing))) + 1);
  const share = Array.from({ length: count }, (_, k) => k / (count - 1));
  return {
    x: share.map((one) => one * length),
    y: share.map((one) => interpolated(plane, x0 + one * (x1 - x0), y0 + one * (y1 - y0))),
  };
}

// Multiples of the size of a region between which its surroundings lie, as in kernels/…/tomography/regions.py.
const INNER = 1.25;
const OUTER = 2;

export const meanOf = (values) => values.reduce((sum, one) => sum + one, 0) / values.length;

// Whether a point is inside an outline of points.
function isInside(outline, x, y) {
  let inside = false;
  outline.forEach(([x0, y0], k) => {
    const [x1, y1] = outline[(k + 1) % outline.length];
    if (y0 > y !== y1 > y && x < x0 + ((y - y0) * (x1 - x0)) / (y1 - y0)) inside = !inside;
  });
  return inside;
}

// Nodes in an outline: see regionOf.
export function outlineOf(plane, outline, detail) {
  const [xs, ys] = [0, 1].map((k) => outline.map((point) => point[k]));
  const box = [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
  return regionOf(plane, "outline", box, detail, (x, y) => (isInside(outline, x, y) ? 0 : Infinity));
}

// Nodes in a rectangle, or the ellipse in it: count, area (mm²), mean, standard deviation, standard error of the mean, minimum, maximum, and
// contrast: mean minus that of the surroundings, NaN without any. detail: the resolution width, mm, of whose cells each counts as one
// measurement; without it each node does. distance(x, y): of another shape, at most 1 inside.
export function regionOf(plane, shape, [x0, y0, x1, y1], detail = null, distance = null) {
  const [cx, cy, rx, ry] = [(x0 + x1) / 2, (y0 + y1) / 2, Math.abs(x1 - x0) / 2, Math.abs(y1 - y0) / 2];
  const inside = [];
  const beside = [];
  for (let a = 0; a < plane.na; a += 1) {
    const x = plane.origin[0] + a * plane.spacing[0];
    const u = (x - cx) / rx;
    if (!(Math.abs(u) <= OUTER)) continue;
    for (let b = 0; b < plane.nb; b += 1) {
      const y = plane.origin[1] + b * plane.spacing[1];
      const v = (y - cy) / ry;
      const away = distance ? distance(x, y) : shape === "ellipse" ? Math.hypot(u, v) : Math.max(Math.abs(u), Math.abs(v));
      const value = plane.values[a * plane.nb + b];
      if (!Number.isFinite(value)) continue;
      if (away <= 1) inside.push(value);
      else if (away > INNER && away <= OUTER) beside.push(value);
    }
  }
  const nodes = inside.length;
  const mean = meanOf(inside);
  const deviation = Math.sqrt(inside.reduce((sum, one) => sum + (one - mean) ** 2, 0) / nodes);
  const area = nodes * plane.spacing[0] * plane.spacing[1];
  const cells = detail ? Math.min(nodes, Math.max(1, area / ((Math.PI / 4) * detail ** 2))) : nodes;
  return {
    nodes, area, mean, deviation, standardError: deviation / Math.sqrt(cells), contrast: mean - meanOf(beside),
    minimum: inside.reduce((least, one) => Math.min(least, one), Infinity),
    maximum: inside.reduce((most, one) => Math.max(most, one), -Infinity),
  };
}

// Values outside the limits at each end, of 1; and values that are looked at.
const OUTSIDE = 0.001;
const LOOKED_AT = 200000;

// Limits of the colours of all these arrays, without outliers.
export function robustLimits(arrays) {
  const total = arrays.reduce((sum, one) => sum + one.length, 0);
  const step = Math.max(1, Math.floor(total / LOOKED_AT));
  const some = [];
  for (const values of arrays) {
    for (let k = 0; k < values.length; k += step) if (Number.isFinite(values[k])) some.push(values[k]);
  }
  if (!some.length) return [0, 1];
  const sorted = Float64Array.from(some).sort();
  const at = (share) => sorted[Math.round(share * (sorted.length - 1))];
  const [low, high] = [at(OUTSIDE), at(1 - OUTSIDE)];
  const least = 1e-6 * Math.max(Math.abs(low), Math.abs(high)) || 1;
  return high - low > least ? [low, high] : [low - least, high + least];
}
