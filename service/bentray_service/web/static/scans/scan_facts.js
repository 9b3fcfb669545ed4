// What is known about a scan, and what is wrong with it, in words.
import { Button, html } from "../parts/view.js";

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
