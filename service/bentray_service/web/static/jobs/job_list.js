// A list of jobs as cards, kept up to date while the page is open.
import { request } from "../parts/api.js";
import { make, showError } from "../parts/dom.js";
import { followJobs } from "./followed_jobs.js";
import { showJobs } from "./job_cards.js";
import { loadTitles, titleOfJob } from "../parts/titles.js";

// The newest ones are shown, the others are in the table of jobs.
const MOST = 6;

// A reader of the newest jobs with these filters of the table of jobs: kind, text.
export const newest = (filters) => async () => (await request(`/v1/jobs?${new URLSearchParams(filters)}`)).jobs;

// The link to the table of jobs with these filters.
function tableLink(filters) {
  const line = make("p", "links");
  const anchor = make("a", "", "All in the table of jobs");
  anchor.href = `#/jobs?${new URLSearchParams(filters)}`;
  line.append(anchor);
  line.hidden = true;
  return line;
}

// Show the newest jobs of read() in root, by default those with the filters; onJobs(jobs) is called with all. Returns { refresh, close }.
export function jobList(root, { empty = "", filters = {}, read = newest(filters), onJobs = () => {} }) {
  const error = make("p", "error");
  error.id = "jobs-error";
  error.setAttribute("role", "alert");
  error.hidden = true;
  const none = make("p", "empty", empty);
  none.hidden = true;
  const list = make("ul", "jobs");
  list.id = "jobs";
  const more = tableLink(filters);
  root.append(error, none, list, more);

  async function cancel(job) {
    try {
      await request(job.links.cancel, { method: "POST" });
      await followed.refresh();
    } catch (problem) {
      showError("jobs-error", problem);
    }
  }

  const followed = followJobs({
    async read() {
      const jobs = await read();
      await loadTitles(jobs);
      return jobs;
    },
    onJobs(jobs) {
      none.hidden = jobs.length > 0;
      more.hidden = jobs.length <= MOST;
      showJobs(list, jobs.slice(0, MOST), titleOfJob, cancel);
      onJobs(jobs);
    },
    onError: (problem) => showError("jobs-error", problem),
  });
  return followed;
}
