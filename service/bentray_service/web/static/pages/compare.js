// Two to four results side by side.
import { make } from "../parts/dom.js";
import { jobList } from "../parts/job_list.js";

export function open(root, { id }) {
  document.title = "Comparison – Bentray";
  root.append(make("h1", "", "Comparison"));
  const ids = id.split(",");
  const jobs = jobList(root, { empty: `There are no jobs ${id}`, wanted: (job) => ids.includes(job.id) });
  return jobs.close;
}
