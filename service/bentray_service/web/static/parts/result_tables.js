// A result, read from the service: how it was made and how good it is, as tables: errors against the truth, what auto compared, the plan.
import { Values } from "../viewer/quantities.js";
import { request } from "./api.js";
import { FoldedSection, HeadedTable, html, Pairs } from "./view.js";
import { duration, inNanoseconds } from "./words.js";

// { job, volume, summary, values, notes } of a job; notes: of quantities that are not to be trusted, by name.
export async function loadResult(id) {
  const job = await request(`/v1/jobs/${id}`);
  if (job.kind !== "reconstruction" || job.state !== "succeeded") {
    throw new Error(`${id} is no finished reconstruction: ${job.kind}, ${job.state}`);
  }
  const volume = await request(job.links.volume);
  const summary = await request(`${volume.links.self}/summary`);
  const notes = Object.fromEntries(summary.cautions.filter(({ code }) => code === "attenuation").map(({ code, text }) => [code, text]));
  return { job, volume, summary, values: new Values(volume, summary.grids), notes };
}

// What a reader calls it: its own name, else what was reconstructed how.
export function nameOf({ job, volume }) {
  return job.name || volume.title || job.id;
}

// Method, grid and water.
function makingOf({ job, volume }) {
  const spacing = volume.spacing_m[0] === null ? "" : ` of ${Number((1e3 * volume.spacing_m[0]).toPrecision(3))} mm`;
  return [volume.provenance.made_by ?? job.title, `${volume.shape.join(" × ")} nodes${spacing}`, `water ${volume.water_speed_mps.toFixed(1)} m/s`];
}

// What the caption of a figure says of the result.
export function captionOf(result) {
  const { trust, cautions } = result.summary;
  const making = `Image by ${makingOf(result).join(", ")}, Bentray ${result.volume.provenance.bentray}.`;
  return [making, `Uncertainty: ${trust}.`, ...cautions.map(({ text }) => text)].join(" ");
}

// The result in a line.
export function facts(result) {
  const { job, summary: { truth, trust } } = result;
  const residual = job.history.at(-1)?.residual_rms_s;
  return [
    trust, ...makingOf(result),
    residual && `residual ${inNanoseconds(residual)}`,
    truth?.rmse_mps != null && `error ${truth.rmse_mps.toFixed(2)} m/s rms (${truth.region})`,
    job.seconds !== null && `took ${duration(job.seconds)}`,
  ].filter(Boolean).join(" · ");
}

function Section({ title, className = "", words, children }) {
  return html`<section class=${`panel ${className}`.trim()}><h2>${title}</h2><p>${words}</p>${children}</section>`;
}

const MISFITS = { held_out_mean_s: "Held-out misfit, mean", held_out_rms_s: "Held-out misfit, rms", training_rms_s: "Training, rms" };

// Candidate, misfits, outcome, and in bold the misfit that decided; nothing where nothing was chosen.
export function ChoiceTable({ candidates, criterion, reason, advice }) {
  if (!candidates.length) return advice && html`<${Section} title="Notes" words=${advice} />`;
  const others = Object.keys(MISFITS).filter((name) => name !== criterion);
  const columns = ["Candidate", `${MISFITS[criterion]} (decides)`, "Result", ...others.map((name) => MISFITS[name])];
  const cells = (row) => [
    row.label, html`<strong>${inNanoseconds(row[criterion])}</strong>`, row.outcome, ...others.map((name) => inNanoseconds(row[name])),
  ];
  return html`<${Section} title="Automatic choice" className="whole-row" words=${reason}>
    <${HeadedTable} label="Candidates of the automatic choice" columns=${columns} rows=${candidates.map(cells)}
      chosen=${candidates.findIndex((candidate) => candidate.shown)} />
  </${Section}>`;
}

// Errors and statistics against the truth of the scan; nothing without one.
export function TruthTable({ truth }) {
  if (truth?.rmse_mps == null) return null;
  const number = (value, digits) => (value === null ? "–" : value.toFixed(digits));
  const speed = (mean, spread) => `${number(mean, 1)} ± ${number(spread, 1)} m/s`;
  const rows = [
    ["RMSE", `${number(truth.rmse_mps, 2)} m/s`],
    ["MAE", `${number(truth.mean_absolute_error_mps, 2)} m/s`],
    ["SSIM", number(truth.ssim, 3)],
    ["PCC", number(truth.correlation, 3)],
    ["Mean ± spread", speed(truth.mean_mps, truth.spread_mps)],
    ...(truth.uncertainty_mps === null ? [] : [["Uncertainty of the mean", `${number(truth.uncertainty_mps, 1)} m/s`]]),
    ["True mean ± spread", speed(truth.true_mean_mps, truth.true_spread_mps)],
  ];
  return html`<${Section} title="Against the truth" words=${`In ${truth.region.replace(/^mask/, "the region mask")}, ${truth.nodes} nodes.`}><${Pairs} rows=${rows} /></${Section}>`;
}

export function PlanTable({ plan }) {
  if (!plan) return null;
  const rows = [
    ["Decomposition", plan.decomposition], ["Tasks", plan.tasks], ["Workers", plan.workers],
    ["Memory of a task", `at most ${Math.ceil(plan.largest_bytes / 2 ** 20)} MiB`],
    ...(plan.blocks > 1 ? [["Blocks of the volume", plan.blocks]] : []),
    ...(plan.minutes ? [["Estimated time", duration(60 * plan.minutes)]] : []),
  ];
  return html`<${FoldedSection} title="Plan"><p>${plan.why}</p><${Pairs} rows=${rows} /></${FoldedSection}>`;
}
