// Provenance, settings and numerical parameters of a result as tables in words, and all of it as JSON to copy.
import { inTime } from "./amounts.js";
import { CopyButton } from "./copying.js";
import { Pairs } from "./tables.js";
import { html } from "./view.js";

const SOFTWARE = { bentray: "Bentray", python: "Python", numpy: "NumPy", numba: "Numba", scipy: "SciPy" };
const SAID = {
  water: "Water", pulse: "Pulse", quality: "Quality of the scan", geometry: "Geometry", waveform: "Full waveform", attenuation: "Attenuation",
  reflection: "Reflection", uncertainty: "Uncertainty",
  frequency_hz: "Centre frequency", amplitudes: "Amplitudes",
};
// What a parameter of no value means: the automatic decision, unless stated here.
const NUMERICS = {
  axial_margin_nodes: ["Axial margin", "nodes", "everywhere"],
  straight_iterations: ["Iterations with straight rays first"],
  coarser_grids: ["Coarser grids first"],
  stop_rms_s: ["Stop at a residual of", "s", "not early"],
  front_smoothing_nodes: ["Smoothing for the wave front", "nodes"],
  ray_width_m: ["Width of rays", "m"],
  ray_gradient: ["Gradient along rays"],
  relaxation_decay: ["Decay of the relaxation per iteration"],
  subset: ["Emitters per update"],
  huber_scale: ["Residuals are weighed linearly beyond", "standard deviations"],
  reciprocity: ["Reverse pairs fill missing ones"],
  guided_rounds: ["Arrivals picked again"],
  bands: ["Frequency bands"],
  emitters: ["Emitters per band"],
};
const UNITS = { mps: "m/s", s: "s", m: "m", hz: "Hz", deg: "°", c: "°C", nodes: "nodes" };

const NAMES = {
  sart: "SART", gauss_newton: "Gauss–Newton", roi: "Only the region of interest", eikonal: "Eikonal solver", side_m: "Side of the image",
  minutes: "Time budget of full waveform (minutes)", examine: "Scan is checked first", max_left_out: "Pairs that may be left out", enabled: "Reconstructed", attenuation_solver: "Solver",
  nodes: "Nodes per side", smoothing_nodes: "Smoothing of updates", edge_mps: "Edges above",
  pixel_m: "Pixel spacing", pair_angle_deg: "Largest angle of a pair", delays: "Travel times in", gain: "Compensated",
};

// "speed_bounds_mps" is "Speed bounds" and the unit m/s.
function named(name) {
  const [, stem, ending] = /^(.*?)(?:_(mps|s|m|hz|deg|c|nodes))?$/.exec(name);
  const words = stem.replaceAll("_", " ");
  return [NAMES[name] ?? words[0].toUpperCase() + words.slice(1), UNITS[ending] ?? ""];
}

// A value in words; without one, what that means.
function inWords(value, unit = "", unset = "automatic") {
  if (value === null) return unset;
  if (typeof value === "boolean") return value ? "yes" : "no";
  // Times of waves are nanoseconds.
  if (unit === "s" && value > 0 && value < 1e-3) return `${Number((1e9 * value).toPrecision(4))} ns`;
  const number = (one) => (typeof one === "number" ? String(Number(one.toPrecision(6))) : String(one));
  const text = Array.isArray(value) ? value.map(number).join(" to ") : number(value);
  return unit && typeof value !== "string" ? `${text} ${unit}` : text;
}

function Folded({ title, rows }) {
  return html`<details><summary>${title}</summary><${Pairs} rows=${rows} /></details>`;
}

// Rows of settings: those of nested records below the name of the record.
function settingRows(settings, before = "") {
  return Object.entries(settings).flatMap(([name, value]) => {
    if (value !== null && typeof value === "object" && !Array.isArray(value)) return settingRows(value, `${before}${named(name)[0]}: `);
    const [words, unit] = named(name);
    return [[before ? `${before}${words[0].toLowerCase()}${words.slice(1)}` : words, inWords(value, unit)]];
  });
}

const fixed = (numerics) => Object.entries(numerics).map(([name, value]) => {
  const [words, unit, unset] = NUMERICS[name] ?? named(name);
  return [words, inWords(value, unit, unset)];
});

// The provenance of a result in a section of its own.
export function Provenance({ job, volume }) {
  const { advice, numerics: stored, ray_numerics: ofRays, ...provenance } = volume.provenance;
  const [numerics, rayNumerics] = [stored, ofRays].map((text) => (text ? JSON.parse(text) : null));
  const frequency = (hertz) => `${(1e-3 * Number(hertz)).toFixed(1)} kHz`;
  const said = Object.entries(provenance).filter(([name]) => !(name in SOFTWARE));
  const versions = Object.entries(SOFTWARE).filter(([name]) => name in provenance).map(([name, words]) => `${words} ${provenance[name]}`);
  const temperature = job.settings.water_temperature_c;
  const rows = [
    ["Job", job.id], ["Volume", volume.id], ["Scan", job.dataset],
    ["Finished", inTime(job.finished)],
    ["Speed in water", `${volume.water_speed_mps.toFixed(1)} m/s${temperature == null ? "" : `, ${temperature} °C by the user`}`],
    ...said.map(([name, value]) => [SAID[name] ?? named(name)[0], name === "frequency_hz" ? frequency(value) : String(value)]),
    ["Software", versions.join(", ")],
  ];
  const everything = { job: job.id, volume: volume.id, scan: job.dataset, finished: job.finished, settings: job.settings, numerics, provenance };
  if (rayNumerics) everything.ray_numerics = rayNumerics;
  return html`<section class="panel provenance">
    <div class="section-head">
      <h2>Provenance</h2>
      <${CopyButton} title="Copy JSON" text=${() => `${JSON.stringify(everything, null, 2)}\n`} />
    </div>
    <${Pairs} rows=${rows} />
    <${Folded} title="Settings" rows=${settingRows(job.settings)} />
    ${numerics && html`<${Folded} title="Numerical parameters, chosen automatically" rows=${fixed(numerics)} />`}
    ${rayNumerics && html`<${Folded} title="Those of the rays before full waveforms" rows=${fixed(rayNumerics)} />`}
  </section>`;
}
