// All jobs in a table, newest first, below batches of them; with "batch" in the address those of one batch.
import { make } from "../parts/dom.js";
import { jobTable } from "../jobs/job_table.js";
import { showBatches } from "../jobs/batches.js";

export async function open(root, { query }) {
  const batch = query.get("batch");
  document.title = batch ? "Batch – Bentray" : "Jobs – Bentray";
  root.classList.add("wide");
  if (batch) {
    const back = make("a", "", "All jobs");
    back.href = "#/jobs";
    const crumb = make("p", "crumb");
    crumb.append(back);
    root.append(crumb);
  }
  root.append(make("h1", "", batch ? "Batch" : "Jobs"));
  const closeBatches = await showBatches(root, batch);
  const table = await jobTable(root, query);
  return () => {
    closeBatches();
    table.close();
  };
}
