// All jobs in a table, newest first.
import { make } from "../parts/dom.js";
import { jobTable } from "../parts/job_table.js";

export async function open(root, { query }) {
  document.title = "Jobs – Bentray";
  root.classList.add("wide");
  root.append(make("h1", "", "Jobs"));
  return (await jobTable(root, query)).close;
}
