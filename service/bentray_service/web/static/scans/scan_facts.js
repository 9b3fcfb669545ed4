// What is known about a scan, and what is wrong with it, in words; its elements as a drawing.
import { Button, html } from "../parts/view.js";
import { Axes, ticks } from "../viewer/plot.js";

// Of the drawing, in its own unit.
const [SIZE, EDGE] = [320, 44];

const percent = (part, whole) => (whole ? `${((100 * part) / whole).toFixed(1)} %` : "none");

function frequency({ center_frequency_hz: hertz, frequency_estimated: estimated }) {
  if (hertz === null) return "not stated";
  return `${(1e-3 * hertz).toFixed(1)} kHz, ${estimated ? "estimated from the traces" : "stated in the file"}`;
}

function sampling({ sampling_rate_hz: hertz, samples, t0_s: first }) {
  if (!samples || hertz === null) return "no traces";
  return `${(1e-6 * hertz).toFixed(3)} MHz, ${samples} samples from ${(1e6 * first).toFixed(2)} µs`;
}

function water({ water_speed_mps: speed, water_temperature_c: temperature, water_assumed: assumed, water_in_file: file }, stated) {
  const warm = temperature === null ? "" : `, ${temperature.toFixed(1)} °C`;
  const origin = stated ? `, stated on this page; in the file: ${file}` : assumed ? "; assumed, since nobody stated it" : "";
  return `${speed.toFixed(1)} m/s${warm}${origin}`;
}

function slices({ slice_z_m: heights }) {
  const millimetres = heights.map((one) => (1e3 * one).toFixed(1));
  return `${heights.length}, at z from ${millimetres[0]} to ${millimetres.at(-1)} mm`;
}

// Terms and values of GET /v1/datasets/{id}/geometry, and of the scan itself.
export function factRows(geometry, scan) {
  const rows = [
    ["Centre frequency", frequency(geometry)],
    ["Sampling", sampling(geometry)],
    ["Water", water(geometry, scan.water_temperature_c !== null)],
    ["Pairs of elements", geometry.pairs.toLocaleString("en")],
  ];
  if (geometry.slice_z_m.length) rows.splice(3, 0, ["Slices", slices(geometry)]);
  if (geometry.timed_pairs !== null) {
    const share = percent(geometry.timed_pairs, geometry.pairs);
    rows.push(["With a valid travel time", `${geometry.timed_pairs.toLocaleString("en")} (${share})`]);
  }
  return rows;
}

const VERDICTS = {
  clean: "No faults found.",
  usable: "Usable, with the findings below.",
  refused: "Not usable for a reconstruction, see the findings.",
};

// What reconstructions do about a finding, unless their setting “Check the scan first” is off.
const ACTIONS = {
  "left out": "Left out, in reconstructions too.",
  corrected: "Corrected, in reconstructions too.",
  refused: "Refused, by reconstructions too.",
  reported: "Only reported: reconstructions use the data as they are.",
};

function sentence({ check, elements, role, slice, found, accepted, action }, several) {
  const which = elements.length ? ` (${elements.length === 1 ? "element" : "elements"} ${listed(elements)}${role ? `, ${role}` : ""})` : "";
  const where = several ? `, slice ${slice}` : "";
  return `${check}${which}${where}: ${found}; accepted: ${accepted}. ${ACTIONS[action]}`;
}

function listed(elements) {
  const shown = elements.slice(0, 12).join(", ");
  return elements.length > 12 ? `${shown} and ${elements.length - 12} more` : shown;
}

// A finding, with a button where the page can do what it advises.
const Finding = ({ finding, several, useWater }) => html`<li>${sentence(finding, several)}
  ${finding.water_temperature_c !== null && html` <${Button} onClick=${() => useWater(finding.water_temperature_c)}>
    Use water of ${finding.water_temperature_c.toFixed(1)} °C</${Button}>`}</li>`;

// report: of GET /v1/datasets/{id}/quality: verdict, share of usable pairs, findings. several: whether the scan has slices; useWater(°C):
// states the temperature of its water.
export function Quality({ report, several, useWater }) {
  const share = `${report.usable_pairs.toLocaleString("en")} of ${report.pairs.toLocaleString("en")} pairs`;
  const picker = report.picker ? `, arrivals by the picker ${report.picker}` : "";
  const skipped = Object.entries(report.not_checked);
  return html`
    <p class="verdict">${VERDICTS[report.verdict]}</p>
    <p class="usable">Usable: ${share} (${percent(report.usable_pairs, report.pairs)})${picker}.</p>
    ${report.findings.length > 0 && html`<ul class="findings">
      ${report.findings.map((finding) => html`<${Finding} finding=${finding} several=${several} useWater=${useWater} />`)}</ul>`}
    ${skipped.length > 0 && html`<details>
      <summary>${skipped.length} checks do not apply</summary>
      <ul class="findings">${skipped.map(([check, reason]) => html`<li>${check}: ${reason}</li>`)}</ul>
    </details>`}`;
}

// What the drawing of the elements shows, for those who do not see it.
export function inWordsOf(geometry) {
  const emitters = geometry.emits.filter(Boolean).length;
  const receivers = geometry.receives.filter(Boolean).length;
  const ring = geometry.radius_m === null ? "" : ` of radius ${(1e3 * geometry.radius_m).toFixed(1)} mm`;
  const drawn = geometry.every > 1 ? `; one of ${geometry.every} elements is drawn` : "";
  const space = geometry.position_m[0].length === 3 ? ", seen along z" : "";
  return `${geometry.array_type} array${ring}${space}: ${geometry.position_m.length} elements, ${emitters} emit, ${receivers} receive${drawn}`;
}

// Circles emit, dots receive, to scale, with axes in mm. geometry: of GET /v1/datasets/{id}/geometry; chosen: the element that emits, null for none.
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
