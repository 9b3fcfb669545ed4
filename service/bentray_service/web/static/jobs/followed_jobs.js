// Jobs kept up to date while a page is open: by the stream of events, or by polling where there is none.
import { useEffect, useNewest, useRef, useState } from "../parts/view.js";
import { jobEvents } from "./job_events.js";

// Without a stream of events: intervals while a job is unfinished, and else.
const BUSY_MS = 3000;
const IDLE_MS = 15000;
// With one: soon after a change of a state; the histories, and the place in the queue, which other tenants change too.
const SOON_MS = 50;
const HISTORY_MS = 3000;
export const UNFINISHED = ["queued", "running", "cancelling"];

// Calls onJobs(jobs) with the records of read() whenever one has changed, and onError(error), null once it is over. Returns
// { refresh, close }.
function followJobs({ read, onJobs, onError, historyMs = HISTORY_MS }) {
  let timer = 0;
  let due = Infinity;
  let closed = false;
  let reading = false;
  let live = false;
  let failed = false;
  let jobs = [];
  // Of jobs that read() does not return.
  const states = new Map();

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
      if (closed) return;
      jobs = found;
      failed = false;
      onJobs(jobs);
      onError(null);
    } catch (problem) {
      failed = true;
      if (!closed) onError(problem);
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
    onJobs(jobs);
    readIn(historyMs);
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

// [jobs, error, refresh] as a hook; onJobs(jobs) is also called with each answer. jobs is null before the first one.
export function useJobs({ read, historyMs, onJobs = () => {} }) {
  const [{ jobs, error }, setState] = useState({ jobs: null, error: null });
  const newest = useNewest({ read, onJobs });
  const followed = useRef(null);
  useEffect(() => {
    followed.current = followJobs({
      read: () => newest.current.read(),
      historyMs,
      onJobs(found) {
        // Another list each time, since events change the records in place.
        setState((before) => ({ ...before, jobs: [...found] }));
        newest.current.onJobs(found);
      },
      onError: (problem) => setState((before) => ({ ...before, error: problem })),
    });
    return followed.current.close;
  }, []);
  return [jobs, error, () => followed.current.refresh()];
}
