// An unfinished job: what happens now, even progress with the time left, the image and the misfit so far; a failure with its reason.
import { inWords, request } from "../parts/api.js";
import { loadTitles, titleOfJob } from "../parts/lists.js";
import { Alert, Button, html, useNewest, useRead, useRef, useState } from "../parts/view.js";
import { jobsInWords, Waiting } from "../parts/waiting.js";
import { duration, placeInQueue, settingsOf, waitInWords } from "../parts/words.js";
import { useJobs } from "./followed_jobs.js";
import { Plan } from "./job_cards.js";
import { comparesModels, MisfitCurve } from "./misfit_curve.js";
import { PreviewPicture } from "./preview_picture.js";
import { ProgressEstimate } from "./progress_estimate.js";

const TICK_MS = 500;
// Between two images.
const PREVIEW_MS = 1000;
const HISTORY_MS = 1000;

const PHASES = {
  examining: "Examining the scan",
  picking: "Picking first arrivals in the traces",
  cutting: "Cutting the surface to a disk",
  parameterising: "Laying the surface out on a square",
  sampling: "Sampling the image and the rays of the tables",
};
const COMPILING = "compiling";
const STATES = { cancelling: "Cancelling: running tasks come to an end", cancelled: "Cancelled", failed: "Failed", succeeded: "Finished" };

// The iteration in words, from the last record of the history.
function iterationOf({ history, settings }) {
  if (!history.length) return "Reconstructing";
  if (comparesModels(history)) return "Automatic: comparing candidate methods by pairs that are held out";
  const { stage, sweep, band_hz: band } = history.at(-1);
  if (band) return `Full waveform, ${Math.round(band[0] / 1e3)} to ${Math.round(band[1] / 1e3)} kHz, iteration ${sweep}`;
  const stages = stage ? `stage ${stage + 1}, ` : "";
  const of = stage || !settings.iterations ? "" : ` of at most ${settings.iterations}`;
  return `Reconstructing: ${stages}iteration ${sweep}${of} finished`;
}

// What happens now, in a line.
function happening(job) {
  const { done, total, phase } = job.progress;
  if (job.state === "queued") {
    const then = job.minutes === null ? "" : `, then ${waitInWords({ minutes: job.minutes })}`;
    return job.ahead === null ? "Waiting in the queue" : `${placeInQueue(job.ahead)}${then}`;
  }
  if (STATES[job.state]) return STATES[job.state];
  if (phase === COMPILING) return `Compiling kernels for this processor, once: ${done} of ${total}`;
  if (PHASES[phase]) return PHASES[phase];
  if (job.kind !== "reconstruction") return done ? "Running" : "Starting";
  return phase === "reconstructing" && (done || job.history.length) ? iterationOf(job) : "Starting: the scan is read and the first rays are traced";
}

// About how long, without false precision.
function leftInWords(seconds) {
  if (seconds < 10) return "a few seconds left";
  return seconds < 90 ? `about ${5 * Math.ceil(seconds / 5)} s left` : `about ${Math.ceil(seconds / 60)} min left`;
}

// What can be done about a failure.
function advice({ kind, error: { type, field } }) {
  if (type === "/problems/internal") return " Ask the operator of the service, who finds the entry in its log.";
  // Of a damaged scan the reason says it.
  if (kind !== "reconstruction" || type === "/problems/stored-data-damaged") return "";
  return field ? " Change this and run it again." : " Run it again with fewer nodes, or examine the scan.";
}

// Progress and time of a job at this moment.
function Progress({ job, estimate, elapsed }) {
  const now = performance.now() / 1e3;
  const running = job.state === "running";
  const share = running && job.progress.total ? estimate.share(now) : null;
  const left = job.progress.phase === COMPILING ? null : estimate.left(now);
  const words = [
    share !== null && `${Math.floor(100 * share)} % of this step`,
    job.seconds !== null && (job.finished ? `took ${duration(elapsed)}` : `${duration(elapsed)} so far`),
    running && left !== null && `${leftInWords(left)}${PHASES[job.progress.phase] ? " of this step" : ""}`,
  ];
  return html`
    ${share !== null && html`<progress key="share" aria-label="Progress" max="1" value=${share}></progress>`}
    ${share === null && (running || job.state === "cancelling") && html`<progress key="unknown" aria-label="Progress"></progress>`}
    <p class="facts live-time">${words.filter(Boolean).join(" · ")}</p>`;
}

// The preview after the newest progress; null before the first one.
function usePreview(job) {
  const newest = useNewest(job);
  const last = useRef({ key: "", record: null });
  const [record] = useRead(async () => {
    const { state, links, history, progress: { phase, done } } = newest.current;
    const key = `${phase} ${done} ${history.length}`;
    if (state === "running" && links.preview && done && phase === "reconstructing" && key !== last.current.key) {
      // There may be none yet, or no longer.
      const found = await request(links.preview).catch(() => null);
      last.current = { key, record: found ?? last.current.record };
    }
    return last.current.record;
  }, { waitOf: () => PREVIEW_MS });
  return record;
}

function Links({ job, change, words }) {
  const cancel = ({ currentTarget: button }) => {
    button.disabled = true;
    change(job.links.cancel, "POST");
  };
  const ended = job.kind === "reconstruction" && ["failed", "cancelled"].includes(job.state);
  return html`<div class="links live-links">
    ${job.links.cancel && html`<${Button} onClick=${cancel}>${words}</${Button}>`}
    ${ended && html`
      <a class="button quiet" href=${`#/scans/${job.dataset}?from=${job.id}`}>Run again with changes</a>
      <a class="button quiet" href=${`#/scans/${job.dataset}`}>Examine the scan</a>`}
  </div>`;
}

// Shows a job until it has succeeded, then calls onSuccess(job). before: an image that full waveforms of this job replace, band by
// band, and that is shown again after a stop; without it the job has the page to itself.
export function LiveJob({ first, before, onSuccess }) {
  const [estimate] = useState(() => new ProgressEstimate());
  const over = useRef(false);
  // When the running time of the job was received.
  const clock = useRef({ seconds: first.seconds, received: performance.now() });
  const elapsedOf = (job) => (job.seconds ?? 0) + (job.state === "running" ? (performance.now() - clock.current.received) / 1e3 : 0);
  const [jobs, error, , change] = useJobs({
    historyMs: HISTORY_MS,
    // Alone, since lists do not count the jobs before it.
    async read() {
      const found = await request(`/v1/jobs/${first.id}`);
      await loadTitles([found]);
      return [found];
    },
    onJobs([found]) {
      // Events carry the progress alone.
      if (found.seconds !== clock.current.seconds) clock.current = { seconds: found.seconds, received: performance.now() };
      estimate.add(performance.now() / 1e3, found.progress, elapsedOf(found));
      if (found.state !== "succeeded" || over.current) return;
      over.current = true;
      onSuccess(found);
    },
  });
  const job = jobs?.[0] ?? first;
  const preview = usePreview(job);
  const running = job.state === "running";
  const seen = useRef(false);
  seen.current ||= running && job.kind === "reconstruction";
  // Draws again every so often.
  useRead(() => null, { waitOf: () => TICK_MS });
  const problem = job.error ? `${inWords(job.error)}${advice(job)}` : error;
  const keeps = before && !(running && job.history.some(({ band_hz: band }) => band));
  return html`
    ${!before && html`<p class="crumb"><a href="#/jobs">Jobs</a>
      ${job.dataset && job.kind === "reconstruction" && html`<span class="live-scan"> · <a href=${`#/scans/${job.dataset}`}>Scan</a></span>`}
    </p>
    <h1>${job.title}</h1>
    <p class="facts live-facts">${jobs && titleOfJob(job)} · ${settingsOf(job)}</p>`}
    <section class="panel" aria-label="State">
      <p class="live-what" role="status">${happening(job)}</p>
      ${(job.state === "queued" || (running && !job.progress.done)) && html`<${Waiting} words="" busyInWords=${jobsInWords} />`}
      <${Progress} job=${job} estimate=${estimate} elapsed=${elapsedOf(job)} />
      <div class="live-plan">${job.plan && html`<${Plan} plan=${job.plan} />`}</div>
      <${Alert} className="live-error" error=${problem} />
      <${Links} job=${job} change=${change} words=${before ? "Stop" : "Cancel"} />
    </section>
    ${keeps && before}
    ${seen.current && !keeps && html`<section class="live-views" aria-label="Image and misfit so far">
      <${PreviewPicture} record=${preview} what=${comparesModels(job.history) ? "candidate method" : "slice"} />
      <${MisfitCurve} history=${job.history} />
    </section>`}`;
}
