// All jobs, newest first.
import { make } from "../parts/dom.js";
import { jobList } from "../parts/job_list.js";

export function open(root) {
  document.title = "Jobs – Bentray";
  root.append(make("h1", "", "Jobs"));
  const jobs = jobList(root, { empty: "Nothing has run yet. Upload a scan and press Fast or Best." });
  return jobs.close;
}
