// Batches of reconstructions above the table of jobs: one with its settings, or the newest, each with one progress.
import { request } from "../parts/api.js";
import { make } from "../parts/dom.js";
import { UNFINISHED } from "./followed_jobs.js";
import { duration, moment } from "../parts/job_words.js";

const SHOWN = 5;
const BUSY_MS = 2000;
const IDLE_MS = 15000;
const STATES = ["succeeded", "failed", "cancelled", "cancelling", "running", "queued"];

function nameOf(batch) {
  return batch.name || `Batch of ${batch.size} scans`;
}

// The jobs in each state, in words.
function countsOf({ counts }) {
  return STATES.filter((state) => counts[state]).map((state) => `${counts[state]} ${state}`).join(", ");
}

function card(batch, act, level) {
  const box = make("section", "batch");
  const heading = make(level);
  const anchor = make("a", "", nameOf(batch));
  anchor.href = `#/jobs?batch=${batch.id}`;
  heading.append(anchor, make("span", `state ${batch.state}`, batch.state));
  const bar = make("progress");
  Object.assign(bar, { max: 1, value: batch.progress });
  bar.setAttribute("aria-label", `Progress of ${nameOf(batch)}`);
  const time = batch.seconds === null ? "" : ` · ${duration(batch.seconds)}`;
  const words = `${Math.floor(100 * batch.progress)} % · ${countsOf(batch)} · started ${moment(batch.created)}${time}`;
  box.append(heading, bar, make("p", "facts", words));
  if (batch.links.cancel) {
    const cancel = make("button", "quiet", "Cancel");
    cancel.type = "button";
    cancel.setAttribute("aria-label", `Cancel ${nameOf(batch)}`);
    cancel.addEventListener("click", () => {
      if (confirm(`Cancel ${nameOf(batch)}? Results so far stay.`)) act(request(batch.links.cancel, { method: "POST" }));
    });
    box.append(cancel);
  }
  return box;
}

// Show one batch, or without an id the newest, at the end of root. Returns close().
export async function showBatches(root, id) {
  const place = make("div", "batches");
  const error = make("p", "error");
  error.setAttribute("role", "alert");
  error.hidden = true;
  root.append(error, place);
  let timer = 0;
  let closed = false;
  let shown = "";

  async function act(promise) {
    try {
      await promise;
      await refresh();
    } catch (problem) {
      error.textContent = problem.message;
      error.hidden = false;
    }
  }

  async function refresh() {
    clearTimeout(timer);
    const found = id ? [await request(`/v1/batches/${id}`)] : (await request(`/v1/batches?limit=${SHOWN}`)).batches;
    if (closed) return;
    error.hidden = true;
    const signature = JSON.stringify(found);
    if (signature !== shown) {
      shown = signature;
      const focused = place.contains(document.activeElement) && document.activeElement.getAttribute("aria-label");
      place.replaceChildren(...found.map((batch) => card(batch, act, "h2")));
      if (focused) place.querySelector(`[aria-label="${CSS.escape(focused)}"]`)?.focus();
    }
    const busy = found.some((batch) => UNFINISHED.includes(batch.state));
    timer = setTimeout(() => act(Promise.resolve()), busy ? BUSY_MS : IDLE_MS);
  }

  await act(Promise.resolve());
  return () => {
    closed = true;
    clearTimeout(timer);
  };
}
