// The elements of a scan as SVG: circles emit, dots receive, to scale, with axes in mm.
import { html } from "../parts/view.js";
import { Axes, ticks } from "../viewer/plot.js";

const [SIZE, EDGE] = [320, 44];

// What the drawing shows, for those who do not see it.
export function inWordsOf(geometry) {
  const emitters = geometry.emits.filter(Boolean).length;
  const receivers = geometry.receives.filter(Boolean).length;
  const ring = geometry.radius_m === null ? "" : ` of radius ${(1e3 * geometry.radius_m).toFixed(1)} mm`;
  const drawn = geometry.every > 1 ? `; one of ${geometry.every} elements is drawn` : "";
  const space = geometry.position_m[0].length === 3 ? ", seen along z" : "";
  return `${geometry.array_type} array${ring}${space}: ${geometry.position_m.length} elements, ${emitters} emit, ${receivers} receive${drawn}`;
}

// geometry: of GET /v1/datasets/{id}/geometry; chosen: the element that emits, null for none.
export function Elements({ geometry, chosen }) {
  const places = geometry.position_m.map(([x, y]) => [1e3 * x, 1e3 * y]);
  const limits = [0, 1].map((axis) => {
    const along = places.map((place) => place[axis]);
    return [Math.min(...along), Math.max(...along)];
  });
  const half = 0.54 * Math.max(...limits.map(([low, high]) => high - low)) || 1;
  const scale = (SIZE - 2 * EDGE) / (2 * half);
  const [cx, cy] = limits.map(([low, high]) => (low + high) / 2);
  const px = (x) => SIZE / 2 + (x - cx) * scale;
  const py = (y) => SIZE / 2 - (y - cy) * scale;
  const last = SIZE - EDGE;
  const ring = geometry.array_type === "ring" && geometry.radius_m !== null;
  // Many elements are drawn small, so that neighbours do not merge.
  const radius = Math.min(3.4, Math.max(1.2, 400 / places.length));
  const emitting = chosen !== null && chosen % geometry.every === 0 ? places[chosen / geometry.every] : null;
  return html`<svg class="elements" viewBox=${`0 0 ${SIZE} ${SIZE}`} role="img" aria-label=${inWordsOf(geometry)}>
    <rect class="frame" x=${EDGE} y=${EDGE} width=${SIZE - 2 * EDGE} height=${SIZE - 2 * EDGE} />
    <${Axes} box=${[EDGE, EDGE, last, last]} px=${px} py=${py} x=${ticks(cx - half, cx + half, 4)} y=${ticks(cy - half, cy + half, 4)}
      words=${["x (mm)", "y (mm)"]} height=${SIZE - 2} margin="12" />
    ${ring && html`<circle class="ring" cx=${px(cx)} cy=${py(cy)} r=${1e3 * geometry.radius_m * scale} />`}
    ${places.map(([x, y], k) => html`
      ${geometry.receives[k] && html`<circle class="receiver" cx=${px(x)} cy=${py(y)} r=${radius / 2} />`}
      ${geometry.emits[k] && html`<circle class="emitter" cx=${px(x)} cy=${py(y)} r=${radius} />`}`)}
    ${emitting && html`<circle class="chosen" r="6" cx=${px(emitting[0])} cy=${py(emitting[1])} />`}
  </svg>`;
}
