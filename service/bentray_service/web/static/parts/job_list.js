// A list of jobs as cards, kept up to date while the page is open.
import { request } from "./api.js";
import { at, make, showError } from "./dom.js";
import { showJobs } from "./job_cards.js";
import { loadTitles, titleOfJob } from "./titles.js";

const BUSY_MS = 700;
const IDLE_MS = 4000;

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
  let timer = 0;
  let closed = false;

  async function refresh() {
    clearTimeout(timer);
    let wait = IDLE_MS;
    try {
      const jobs = await read();
      await loadTitles(jobs);
      if (closed) return;
      const shown = jobs.filter(wanted);
      none.hidden = shown.length > 0;
      showJobs(list, shown, titleOfJob, cancel);
      onJobs(jobs);
      if (jobs.some((job) => ["queued", "running", "cancelling"].includes(job.state))) wait = BUSY_MS;
      showError("jobs-error", null);
    } catch (problem) {
      showError("jobs-error", problem);
    }
    if (!closed) timer = setTimeout(refresh, wait);
  }

  async function cancel(job) {
    try {
      await request(job.links.cancel, { method: "POST" });
      await refresh();
    } catch (problem) {
      showError("jobs-error", problem);
    }
  }

  refresh();
  return {
    refresh,
    close() {
      closed = true;
      clearTimeout(timer);
    },
  };
}
