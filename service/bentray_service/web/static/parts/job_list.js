// A list of jobs as cards, kept up to date while the page is open.
import { request } from "./api.js";
import { at, make, showError } from "./dom.js";
import { showJobs } from "./job_cards.js";
import { jobEvents } from "./job_events.js";
import { loadTitles, titleOfJob } from "./titles.js";

// Without a stream of events: intervals while a job is unfinished, and else.
const BUSY_MS = 3000;
const IDLE_MS = 15000;
// With one: soon after a change of a state; the histories, and the place in the queue, which other tenants change too.
const SOON_MS = 50;
const HISTORY_MS = 3000;
const UNFINISHED = ["queued", "running", "cancelling"];

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
  let due = Infinity;
  let closed = false;
  let reading = false;
  let live = false;
  let failed = false;
  let jobs = [];
  // Of jobs that are not in the list.
  const states = new Map();

  function show() {
    const shown = jobs.filter(wanted);
    none.hidden = shown.length > 0;
    showJobs(list, shown, titleOfJob, cancel);
    onJobs(jobs);
  }

  // Read again after a time, unless that is done earlier anyway.
  function readIn(milliseconds) {
    const then = performance.now() + milliseconds;
    if (closed || then >= due) return;
    due = then;
    clearTimeout(timer);
    timer = setTimeout(refresh, milliseconds);
  }

  async function refresh() {
    clearTimeout(timer);
    due = Infinity;
    if (reading) return readIn(SOON_MS);
    reading = true;
    try {
      const found = await read();
      await loadTitles(found);
      if (closed) return;
      jobs = found;
      show();
      failed = false;
      showError("jobs-error", null);
    } catch (problem) {
      failed = true;
      if (!closed) showError("jobs-error", problem);
    } finally {
      reading = false;
    }
    const unfinished = jobs.some((job) => UNFINISHED.includes(job.state));
    if (!live || failed) readIn(unfinished ? BUSY_MS : IDLE_MS);
    else if (jobs.some((job) => job.ahead)) readIn(HISTORY_MS);
  }

  function follow({ id, state, progress }) {
    const job = jobs.find((one) => one.id === id);
    const before = job ? job.state : states.get(id);
    states.set(id, state);
    if (before !== state) return readIn(SOON_MS);
    if (!job || JSON.stringify(job.progress) === JSON.stringify(progress)) return;
    job.progress = progress;
    show();
    readIn(HISTORY_MS);
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
  const closeEvents = jobEvents({
    onChange: follow,
    onOpen(open) {
      live = open;
      // Changes before it opened are not in the stream.
      readIn(open ? SOON_MS : BUSY_MS);
    },
  });
  return {
    refresh,
    close() {
      closed = true;
      closeEvents();
      clearTimeout(timer);
    },
  };
}
