// An unfinished job: what happens now, even progress with the time left, the image and the misfit so far; a failure with its reason.
import { inWords, request } from "../parts/api.js";
import { make } from "../parts/dom.js";
import { followJobs } from "./followed_jobs.js";
import { placeInQueue, planned, summaryOf } from "./job_cards.js";
import { duration } from "../parts/job_words.js";
import { comparesModels, misfitCurve } from "./misfit_curve.js";
import { previewPicture } from "./preview_picture.js";
import { ProgressEstimate } from "./progress_estimate.js";
import { methodOf } from "../parts/results.js";
import { loadTitles, titleOfJob } from "../parts/titles.js";

const TICK_MS = 500;
// Between two images, and between two questions to the workers while nothing is done yet.
const PREVIEW_MS = 1000;
const WORKERS_MS = 3000;
const HISTORY_MS = 1000;

const PHASES = { examining: "Examining the scan", picking: "Picking first arrivals in the traces" };
const COMPILING = "The workers compile their kernels for this processor. That happens once and takes up to some minutes.";

const PAGE = `
  <p class="crumb"><a href="#/jobs">Jobs</a><span class="live-scan" hidden> · <a>Scan</a></span></p>
  <h1></h1>
  <p class="facts live-facts"></p>
  <section class="panel" aria-label="State">
    <p class="live-what" role="status"></p>
    <progress aria-label="Progress" max="1"></progress>
    <p class="facts live-time"></p>
    <div class="live-plan"></div>
    <p class="error live-error" role="alert" hidden></p>
    <div class="links live-links"></div>
  </section>
  <section class="live-views" aria-label="Image and misfit so far" hidden></section>`;

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
function happening(job, compiling) {
  const { done, phase } = job.progress;
  if (job.state === "queued") return job.ahead === null ? "Waiting in the queue" : placeInQueue(job.ahead);
  if (job.state === "cancelling") return "Cancelling: running tasks come to an end";
  if (job.state === "cancelled") return "Cancelled";
  if (job.state === "failed") return "Failed";
  if (job.state === "succeeded") return "Finished";
  if (compiling && !done) return COMPILING;
  if (PHASES[phase]) return PHASES[phase];
  if (job.kind !== "reconstruction") return done ? "Running" : "Starting";
  return phase === "reconstructing" && (done || job.history.length) ? iterationOf(job) : "Starting: the scan is read and the first rays are traced";
}

// About how long, without false precision.
function leftInWords(seconds) {
  if (seconds < 10) return "a few seconds left";
  return seconds < 90 ? `about ${5 * Math.ceil(seconds / 5)} s left` : `about ${Math.ceil(seconds / 60)} min left`;
}

function anchor(text, address) {
  const made = make("a", "button quiet", text);
  made.href = address;
  return made;
}

// Shows a job in root until it has succeeded, then calls onSuccess(job). Returns { close }.
export function liveJob(root, first, onSuccess) {
  root.innerHTML = PAGE;
  const part = (name) => root.querySelector(name);
  const estimate = new ProgressEstimate();
  const bar = part("progress");
  let job = first;
  let received = performance.now();
  let seconds;
  let compiling = false;
  let over = false;
  let asked = -Infinity;
  let drawn = "";
  let drawing = false;
  let curve = null;
  let picture = null;

  function say(selector, words) {
    if (part(selector).textContent !== words) part(selector).textContent = words;
  }

  function tick() {
    const now = performance.now() / 1e3;
    const running = job.state === "running";
    const elapsed = (job.seconds ?? 0) + (running ? now - received / 1e3 : 0);
    say(".live-what", happening(job, compiling));
    bar.hidden = !running && job.state !== "cancelling";
    if (running && job.progress.total) bar.value = estimate.share(now);
    else bar.removeAttribute("value");
    const words = [];
    if (running && job.progress.total) words.push(`${Math.floor(100 * estimate.share(now))} % of this step`);
    if (job.seconds !== null) words.push(job.finished ? `took ${duration(elapsed)}` : `${duration(elapsed)} so far`);
    const planMinutes = job.plan?.minutes;
    const left = estimate.left(now) ?? (planMinutes ? Math.max(0, 60 * planMinutes - elapsed) : null);
    if (running && left !== null) words.push(`${leftInWords(left)}${PHASES[job.progress.phase] ? " of this step" : ""}`);
    say(".live-time", words.join(" · "));
    if (running && !job.progress.done) askWorkers();
    if (running && picture) draw();
  }

  async function askWorkers() {
    if (performance.now() - asked < WORKERS_MS) return;
    asked = performance.now();
    const { workers } = await request("/v1/cluster").catch(() => ({ workers: [] }));
    compiling = workers.some((one) => one.compiling);
  }

  // The image after the newest progress; without one yet, the hint stays.
  async function draw() {
    const key = `${job.progress.phase} ${job.progress.done} ${job.history.length}`;
    if (drawing || key === drawn || !job.links.preview || !job.progress.done || job.progress.phase !== "reconstructing") return;
    drawing = true;
    drawn = key;
    try {
      const record = await request(job.links.preview);
      if (!over) picture.show(record, comparesModels(job.history) ? "candidate method" : "slice");
    } catch {
      // There is none yet, or no longer.
    }
    setTimeout(() => {
      drawing = false;
    }, PREVIEW_MS);
  }

  function showLinks() {
    const made = [];
    if (job.links.cancel) {
      const cancel = make("button", "quiet", "Cancel");
      cancel.type = "button";
      cancel.addEventListener("click", async () => {
        cancel.disabled = true;
        try {
          await request(job.links.cancel, { method: "POST" });
          await followed.refresh();
        } catch (problem) {
          showProblem(problem.message);
        }
      });
      made.push(cancel);
    }
    if (job.kind === "reconstruction" && ["failed", "cancelled"].includes(job.state)) {
      made.push(anchor("Run again with changes", `#/scans/${job.dataset}?from=${job.id}`), anchor("Examine the scan", `#/scans/${job.dataset}`));
    }
    const kept = part(".live-links");
    const labels = (nodes) => [...nodes].map((node) => node.textContent).join();
    if (labels(kept.children) !== labels(made)) kept.replaceChildren(...made);
  }

  function showProblem(words) {
    part(".live-error").textContent = words ?? "";
    part(".live-error").hidden = !words;
  }

  // What can be done about a failure.
  function advice({ type, field }) {
    if (type === "/problems/internal") return " Ask the operator of the service, who finds the entry in its log.";
    // Of a damaged scan the reason says it.
    if (job.kind !== "reconstruction" || type === "/problems/stored-data-damaged") return "";
    return field ? " Change this and run it again." : " Run it again with fewer nodes, or examine the scan.";
  }

  function show(next) {
    // Events carry the progress alone.
    if (next.seconds !== seconds) [seconds, received] = [next.seconds, performance.now()];
    job = next;
    const [summary, settings] = summaryOf(job);
    const what = job.kind === "reconstruction" ? methodOf(job) : summary;
    say("h1", job.name || what);
    if (job.dataset && job.kind === "reconstruction") {
      part(".live-scan").hidden = false;
      part(".live-scan a").href = `#/scans/${job.dataset}`;
    }
    say(".live-facts", [titleOfJob(job), job.name ? `${what}: ${settings}` : settings].join(" · "));
    const now = performance.now();
    estimate.add(now / 1e3, job.progress, (job.seconds ?? 0) + (now - received) / 1e3);
    if (job.plan && !part(".live-plan").childElementCount) part(".live-plan").append(planned(job.plan));
    const views = part(".live-views");
    if (job.kind === "reconstruction" && job.state === "running" && !picture) {
      views.hidden = false;
      picture = previewPicture(views);
      curve = misfitCurve(views);
    }
    curve?.show(job.history);
    if (job.error) showProblem(`${inWords(job.error)}${advice(job.error)}`);
    showLinks();
    tick();
    if (job.state !== "succeeded" || over) return;
    over = true;
    Promise.resolve(onSuccess(job)).catch((problem) => showProblem(problem.message));
  }

  const ticking = setInterval(tick, TICK_MS);
  const followed = followJobs({
    historyMs: HISTORY_MS,
    // Alone, since lists do not count the jobs before it.
    async read() {
      const found = await request(`/v1/jobs/${first.id}`);
      await loadTitles([found]);
      return [found];
    },
    onJobs: ([found]) => !over && show(found),
    onError: (problem) => job.error || showProblem(problem?.message),
  });
  return {
    close() {
      over = true;
      clearInterval(ticking);
      followed.close();
      picture?.close();
    },
  };
}
