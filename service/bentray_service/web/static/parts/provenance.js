// Provenance, settings and numerical parameters of a result as tables in words, and all of it as JSON to copy.
import { captionOf } from "./settings_fields.js";
import { readSettings } from "./settings_form.js";
import { CopyButton, FoldedSection, html, Pairs, useRead } from "./view.js";
import { inTime } from "./words.js";

const SOFTWARE = { bentray: "Bentray", python: "Python", numpy: "NumPy", numba: "Numba", scipy: "SciPy" };
const SAID = {
  automatic: "Decided automatically",
  water: "Water", pulse: "Pulse", quality: "Quality of the scan", geometry: "Geometry", waveform: "Full waveform", attenuation: "Attenuation",
  reflection: "Reflection", uncertainty: "Uncertainty", pairs: "Pairs", noise: "Noise of the times",
  frequency_hz: "Centre frequency", amplitudes: "Amplitudes",
};
// What a parameter of no value means: the automatic decision, unless stated here.
const NUMERICS = {
  coarser_grids: ["Coarser grids first"],
  stop_rms_s: ["Stop at a residual of", "s", "not early"],
  ray_width_m: ["Width of rays", "m"],
  ray_gradient: ["Gradient along rays"],
  subset: ["Emitters per update"],
  huber_scale: ["Residuals are weighed linearly beyond", "standard deviations"],
  reciprocity: ["Reverse pairs fill missing ones"],
  bands: ["Frequency bands"],
  emitters: ["Emitters per band"],
};
const UNITS = { mps: "m/s", s: "s", m: "m", hz: "Hz", deg: "°", c: "°C", nodes: "nodes" };

// "speed_bounds_mps" is "Speed bounds" and the unit m/s.
function named(name) {
  const [, stem, ending] = /^(.*?)(?:_(mps|s|m|hz|deg|c|nodes))?$/.exec(name);
  const words = stem.replaceAll("_", " ");
  return [words[0].toUpperCase() + words.slice(1), UNITS[ending] ?? ""];
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

// Settings by their paths.
function flat(settings, before = "") {
  return Object.entries(settings).flatMap(([name, value]) => {
    const nested = value !== null && typeof value === "object" && !Array.isArray(value);
    return nested ? flat(value, `${before}${name}.`) : [[`${before}${name}`, value]];
  });
}

// Settings as the form names them; earlier versions had others.
function Settings({ settings }) {
  const [groups] = useRead(readSettings);
  const labels = new Map(groups?.flatMap(([group, members]) => members.map(({ path, schema }) => [path, { group, schema }])));
  const rows = flat(settings).map(([path, value]) => {
    const { group, schema } = labels.get(path) ?? {};
    const [words, unit] = schema ? [captionOf(schema), schema["x-unit"]] : named(path.split(".").at(-1));
    const shown = schema?.["x-words"]?.[value] ?? inWords(value, unit, schema?.["x-unset"]);
    return [group ? `${captionOf(group)}: ${words}` : words, shown];
  });
  return html`<${Folded} title="Settings" rows=${rows} />`;
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
  return html`<${FoldedSection} title="Provenance" className="provenance">
    <${CopyButton} title="Copy JSON" text=${() => `${JSON.stringify(everything, null, 2)}\n`} />
    <${Pairs} rows=${rows} />
    <${Settings} settings=${job.settings} />
    ${numerics && html`<${Folded} title="Numerical parameters, chosen automatically" rows=${fixed(numerics)} />`}
    ${rayNumerics && html`<${Folded} title="Those of the rays before full waveforms" rows=${fixed(rayNumerics)} />`}
  </${FoldedSection}>`;
}
