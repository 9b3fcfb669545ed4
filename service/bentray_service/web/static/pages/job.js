// One job: its progress, then its result.
import { make } from "../parts/dom.js";
import { jobList } from "../parts/job_list.js";

export function open(root, { id }) {
  document.title = "Job – Bentray";
  root.append(make("h1", "", "Job"));
  const jobs = jobList(root, { empty: `There is no job ${id}`, wanted: (job) => job.id === id });
  return jobs.close;
}
