// Distances, angles and areas between points [x, y, z] in mm, and what a tool makes of the points that are set.
import { AXES } from "./field.js";

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
