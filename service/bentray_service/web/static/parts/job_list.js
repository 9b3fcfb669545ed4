// A list of jobs as cards, kept up to date while the page is open.
import { request } from "./api.js";
import { make, showError } from "./dom.js";
import { followJobs } from "./followed_jobs.js";
import { showJobs } from "./job_cards.js";
import { loadTitles, titleOfJob } from "./titles.js";

const newest = async () => (await request("/v1/jobs")).jobs;

// Show the jobs of read() for which wanted(job) is true in root; onJobs(jobs) is called with all. Returns { refresh, close }.
export function jobList(root, { empty = "", read = newest, wanted = () => true, onJobs = () => {} }) {
  const error = make("p", "error");
  error.id = "jobs-error";
  error.setAttribute("role", "alert");
  error.hidden = true;
  const none = make("p", "empty", empty);
  none.hidden = true;
  const list = make("ul", "jobs");
  list.id = "jobs";
  root.append(error, none, list);

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
      const shown = jobs.filter(wanted);
      none.hidden = shown.length > 0;
      showJobs(list, shown, titleOfJob, cancel);
      onJobs(jobs);
    },
    onError: (problem) => showError("jobs-error", problem),
  });
  return followed;
}
