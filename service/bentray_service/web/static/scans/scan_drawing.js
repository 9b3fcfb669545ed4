// The elements of a scan as SVG: circles emit, dots receive, to scale, with axes in mm.
import { ticks } from "../viewer/plot.js";

const SVG = "http://www.w3.org/2000/svg";
const [SIZE, EDGE] = [320, 44];

function node(name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

// What the drawing shows, for those who do not see it.
export function inWordsOf(geometry) {
  const emitters = geometry.emits.filter(Boolean).length;
  const receivers = geometry.receives.filter(Boolean).length;
  const ring = geometry.radius_m === null ? "" : ` of radius ${(1e3 * geometry.radius_m).toFixed(1)} mm`;
  const some = geometry.every > 1 ? `; one of ${geometry.every} elements is drawn` : "";
  const space = geometry.position_m[0].length === 3 ? ", seen along z" : "";
  return `${geometry.array_type} array${ring}${space}: ${geometry.position_m.length} elements, ${emitters} emit, ${receivers} receive${some}`;
}

// Draw the geometry of GET /v1/datasets/{id}/geometry; mark(element) shows which one emits, null none.
export function drawElements(geometry) {
  const picture = node("svg", { class: "elements", viewBox: `0 0 ${SIZE} ${SIZE}`, role: "img", "aria-label": inWordsOf(geometry) });
  const places = geometry.position_m.map(([x, y]) => [1e3 * x, 1e3 * y]);
  const limits = [0, 1].map((axis) => {
    const along = places.map((one) => one[axis]);
    return [Math.min(...along), Math.max(...along)];
  });
  const half = 0.54 * Math.max(...limits.map(([low, high]) => high - low)) || 1;
  const scale = (SIZE - 2 * EDGE) / (2 * half);
  const [cx, cy] = limits.map(([low, high]) => (low + high) / 2);
  const px = (x) => SIZE / 2 + (x - cx) * scale;
  const py = (y) => SIZE / 2 - (y - cy) * scale;
  const last = SIZE - EDGE;
  picture.append(node("rect", { class: "frame", x: EDGE, y: EDGE, width: SIZE - 2 * EDGE, height: SIZE - 2 * EDGE }));
  for (const x of ticks(cx - half, cx + half, 4)) {
    picture.append(node("line", { class: "grid", x1: px(x), x2: px(x), y1: EDGE, y2: last }));
    picture.append(node("text", { x: px(x), y: last + 16, "text-anchor": "middle" }, String(x)));
  }
  for (const y of ticks(cy - half, cy + half, 4)) {
    picture.append(node("line", { class: "grid", x1: EDGE, x2: last, y1: py(y), y2: py(y) }));
    picture.append(node("text", { x: EDGE - 6, y: py(y) + 4, "text-anchor": "end" }, String(y)));
  }
  picture.append(node("text", { x: SIZE / 2, y: SIZE - 8, "text-anchor": "middle" }, "x (mm)"));
  picture.append(node("text", { x: 12, y: SIZE / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${SIZE / 2})` }, "y (mm)"));
  if (geometry.array_type === "ring" && geometry.radius_m !== null) {
    picture.append(node("circle", { class: "ring", cx: px(cx), cy: py(cy), r: 1e3 * geometry.radius_m * scale }));
  }
  // Many elements are drawn small, so that neighbours do not merge.
  const radius = Math.min(3.4, Math.max(1.2, 400 / places.length));
  places.forEach(([x, y], k) => {
    if (geometry.receives[k]) picture.append(node("circle", { class: "receiver", cx: px(x), cy: py(y), r: radius / 2 }));
    if (geometry.emits[k]) picture.append(node("circle", { class: "emitter", cx: px(x), cy: py(y), r: radius }));
  });
  const chosen = node("circle", { class: "chosen", r: 6, visibility: "hidden" });
  picture.append(chosen);
  return {
    picture,
    mark(element) {
      const place = element === null || element % geometry.every ? undefined : places[element / geometry.every];
      chosen.setAttribute("visibility", place ? "visible" : "hidden");
      if (!place) return;
      chosen.setAttribute("cx", px(place[0]));
      chosen.setAttribute("cy", py(place[1]));
    },
  };
}
