// All jobs in a table, newest first, below batches of them; with "batch" in the address those of one batch.
import { Batches } from "../jobs/batches.js";
import { JobTable } from "../jobs/job_table.js";
import { description } from "../parts/description.js";
import { html } from "../parts/view.js";

export async function open({ query }) {
  const batch = query.get("batch");
  document.title = batch ? "Batch – Bentray" : "Jobs – Bentray";
  const { parameters } = (await description()).paths["/v1/jobs"].get;
  const words = Object.fromEntries(["state", "kind"].map((name) => [name, parameters.find((parameter) => parameter.name === name).schema.enum]));
  return html`<div class="wide">
    ${batch && html`<p class="crumb"><a href="#/jobs">All jobs</a></p>`}
    <h1>${batch ? "Batch" : "Jobs"}</h1>
    <${Batches} id=${batch} />
    <${JobTable} query=${query} words=${words} />
  </div>`;
}
