// All jobs in a table, newest first, below batches of them; with "batch" in the address those of one batch.
import { Batches } from "../jobs/batches.js";
import { JobTable } from "../jobs/job_table.js";
import { parametersOf } from "../parts/description.js";
import { html } from "../parts/view.js";

export async function open({ query }) {
  const batch = query.get("batch");
  document.title = batch ? "Batch – Bentray" : "Jobs – Bentray";
  const { state, kind } = await parametersOf("/v1/jobs");
  return html`<div class="wide">
    ${batch && html`<p class="crumb"><a href="#/jobs">All jobs</a></p>`}
    <h1>${batch ? "Batch" : "Jobs"}</h1>
    <${Batches} id=${batch} />
    <${JobTable} query=${query} words=${{ state: state.enum, kind: kind.enum }} />
  </div>`;
}
