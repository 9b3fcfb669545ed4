// How a result was made and how good it is, as tables: errors against the truth, what auto compared, the plan.
import { inNanoseconds } from "./amounts.js";
import { make } from "./dom.js";
import { duration } from "./job_words.js";
import { methodOf } from "./results.js";

// The result in a line.
export function facts({ job, volume, summary }) {
  const size = volume.shape.join(" × ");
  const spacing = volume.spacing_m[0] === null ? "" : ` of ${Number((1e3 * volume.spacing_m[0]).toPrecision(3))} mm`;
  const parts = [methodOf(job), `${size} nodes${spacing}`, `water ${volume.water_speed_mps.toFixed(1)} m/s`];
  const residual = job.history.at(-1)?.residual_rms_s;
  if (residual) parts.push(`residual ${inNanoseconds(residual)}`);
  if (summary.truth?.rmse_mps != null) parts.push(`error ${summary.truth.rmse_mps.toFixed(2)} m/s rms (${summary.truth.region})`);
  const widths = summary.resolution_width_m;
  if (widths.length) parts.push(`resolution width ${(1e3 * widths[Math.floor(widths.length / 2)]).toFixed(1)} mm`);
  if (job.seconds !== null) parts.push(`took ${duration(job.seconds)}`);
  return parts.join(" · ");
}

function section(title, ...content) {
  const box = make("section", "panel");
  box.append(make("h2", "", title), ...content);
  return box;
}

function scrolled(table) {
  const box = make("div", "scroll");
  box.tabIndex = 0;
  box.append(table);
  return box;
}

function pairs(entries) {
  const table = make("table", "pairs");
  for (const [name, value] of entries) {
    const row = table.insertRow();
    const head = make("th", "", name);
    head.scope = "row";
    row.append(head, make("td", "", value));
  }
  return table;
}

// Candidate, held-out misfit, chosen, reason; null where nothing was chosen.
export function choiceTable({ candidates, reason }, job) {
  if (!candidates.length) return job.advice ? section("Notes", make("p", "", job.advice)) : null;
  const table = make("table", "choice-table");
  const head = table.createTHead().insertRow();
  for (const name of ["Candidate", "Held-out misfit, mean", "Held-out, rms", "Training, rms", "Result"]) {
    const cell = make("th", "", name);
    cell.scope = "col";
    head.append(cell);
  }
  const body = table.createTBody();
  for (const one of candidates) {
    const row = body.insertRow();
    const misfits = [one.held_out_mean_s, one.held_out_rms_s, one.training_rms_s].map(inNanoseconds);
    const cells = [one.label, ...misfits, one.chosen ? "chosen" : one.rejection];
    row.append(...cells.map((cell) => make("td", "", cell)));
    if (one.chosen) row.className = "chosen";
  }
  const area = scrolled(table);
  area.setAttribute("role", "region");
  area.setAttribute("aria-label", "Candidates of the automatic choice");
  const box = section("Automatic choice", make("p", "", reason), area);
  box.classList.add("whole-row");
  return box;
}

// Errors and statistics against the truth of the scan; null without one.
export function truthTable({ truth }) {
  if (truth?.rmse_mps == null) return null;
  const number = (value, digits) => (value === null ? "–" : value.toFixed(digits));
  const speed = (mean, spread) => `${number(mean, 1)} ± ${number(spread, 1)} m/s`;
  return section("Against the truth", make("p", "", `In ${truth.region}, ${truth.nodes} nodes.`), pairs([
    ["RMSE", `${number(truth.rmse_mps, 2)} m/s`],
    ["MAE", `${number(truth.mean_absolute_error_mps, 2)} m/s`],
    ["SSIM", number(truth.ssim, 3)],
    ["PCC", number(truth.correlation, 3)],
    ["Mean ± spread", speed(truth.mean_mps, truth.spread_mps)],
    ...(truth.uncertainty_mps === null ? [] : [["Uncertainty of the mean", `${number(truth.uncertainty_mps, 1)} m/s`]]),
    ["True mean ± spread", speed(truth.true_mean_mps, truth.true_spread_mps)],
  ]));
}

export function planTable({ plan }) {
  if (!plan) return null;
  const mebibytes = (bytes) => `${Math.ceil(bytes / 2 ** 20)} MiB`;
  const rows = [
    ["Decomposition", plan.decomposition], ["Tasks", plan.tasks], ["Workers", plan.workers],
    ["Memory of a task", `at most ${mebibytes(plan.largest_bytes)}`],
  ];
  if (plan.blocks > 1) rows.push(["Blocks of the volume", plan.blocks]);
  if (plan.minutes) rows.push(["Estimated time", duration(60 * plan.minutes)]);
  return section("Plan", make("p", "", plan.why), pairs(rows));
}
