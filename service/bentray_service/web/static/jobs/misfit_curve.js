// The misfit of a reconstruction after each iteration: as a curve with axes, and as a small one without.
import { html } from "../parts/view.js";
import { inNanoseconds } from "../parts/words.js";
import { meanOf } from "../viewer/measures.js";
import { Plot } from "../viewer/plot.js";

// Largest over smallest misfit above which a linear axis would show a flat line.
const STEEP = 20;

// Whether several models are reconstructed side by side: then an iteration of a slice occurs more than once.
export function comparesModels(history) {
  const keys = history.map(({ slice, stage, sweep, of_attenuation: attenuation }) => [slice, stage, sweep, attenuation].join(" "));
  return new Set(keys).size < keys.length;
}

// Mean residual of each iteration over the slices, stage by stage; and the iterations at which a stage begins.
export function residuals(history) {
  const known = history.filter((row) => row.residual_rms_s !== null);
  const sweeps = Object.values(Object.groupBy(known, ({ stage, sweep }) => `${stage} ${sweep}`))
    .sort(([a], [b]) => a.stage - b.stage || a.sweep - b.sweep);
  return {
    values: sweeps.map((rows) => meanOf(rows.map((row) => row.residual_rms_s))),
    begins: sweeps.flatMap(([{ stage }], i) => (i && stage !== sweeps[i - 1][0].stage ? [i] : [])),
  };
}

const inStages = (begins) => (begins.length ? ` in ${begins.length + 1} stages` : "");

export function Sparkline({ values, begins }) {
  const top = Math.max(...values) || 1;
  const across = (i) => (100 * i) / (values.length - 1);
  const points = values.map((value, i) => `${across(i)},${39 - (36 * value) / top}`).join(" ");
  const label = `Residual of ${values.length} iterations${inStages(begins)}`;
  return html`<svg class="spark" viewBox="0 0 100 40" preserveAspectRatio="none" role="img" aria-label=${label}>
    <line x1="0" x2="100" y1="39" y2="39" />
    ${begins.map((first) => html`<line class="stage" x1=${across(first - 0.5)} x2=${across(first - 0.5)} y1="0" y2="39" />`)}
    <polyline points=${points} />
  </svg>`;
}

function Curve({ history }) {
  if (comparesModels(history)) return html`<p class="hint">Candidate methods are compared; the curve is that of the chosen one.</p>`;
  const { values, begins } = residuals(history);
  if (!values.length) return html`<p class="hint">The misfit of the first iteration follows</p>`;
  // One point is no curve.
  if (values.length === 1) return html`<p class="hint">${inNanoseconds(values[0])} in the first iteration</p>`;
  const label = `Misfit of ${values.length} iterations${inStages(begins)}: ${inNanoseconds(values[0])} to ${inNanoseconds(values.at(-1))}`;
  const logarithmic = Math.min(...values) > 0 && Math.max(...values) > STEEP * Math.min(...values);
  const curve = { x: values.map((_, k) => k + 1), y: values.map((value) => 1e9 * value) };
  return html`<${Plot} curves=${[curve]} across="Iteration" up="Misfit (ns)" label=${label} whole logarithmic=${logarithmic} data-points=${values.length} />`;
}

export function MisfitCurve({ history }) {
  return html`<figure class="tile misfit">
    <figcaption class="facts">Misfit: measured minus predicted travel time, rms; of full waveforms the equivalent time shift</figcaption>
    <${Curve} history=${history} />
  </figure>`;
}
