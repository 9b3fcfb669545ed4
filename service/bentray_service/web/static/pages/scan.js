// One scan: its geometry, facts, quality and traces, the reconstruction to start, and the reconstructions of it.
import { request } from "../parts/api.js";
import { fillDefaults } from "../parts/defaults.js";
import { at, make, showError } from "../parts/dom.js";
import { jobList } from "../parts/job_list.js";
import { withKey } from "../parts/key.js";
import { startJob } from "../parts/panel.js";
import { drawElements, inWordsOf } from "../parts/scan_drawing.js";
import { factRows, fillFacts, showQuality } from "../parts/scan_facts.js";
import { openShot } from "../parts/shot.js";
import { titleOf } from "../parts/titles.js";

const PAGE = `
  <h1 id="scan-name"></h1>
  <p id="dataset-facts" class="facts"></p>
  <section aria-labelledby="run-title" class="panel">
    <h2 id="run-title">Reconstruction</h2>
    <form id="run">
      <div class="presets">
        <button id="start" type="submit" value="fast" formnovalidate>Fast
          <small>rays and method chosen automatically; seconds to a minute</small></button>
        <button id="best" type="submit" value="best" formnovalidate>Best
          <small>then full waveform, where it predicts unused traces better; minutes</small></button>
      </div>
      <details id="run-own">
      <summary>Other settings</summary>
      <fieldset class="choice">
        <legend class="caption">Method</legend>
        <label><input type="radio" name="method" value="auto" checked>
          <span><strong>Automatic (recommended)</strong><small>rays and method by held-out validation</small></span></label>
        <label><input type="radio" name="method" value="sart">
          <span><strong>SART</strong><small>one emitter after another; seconds</small></span></label>
        <label><input type="radio" name="method" value="gauss-newton">
          <span><strong>Gauss–Newton</strong><small>all emitters at once, regularised</small></span></label>
        <label><input type="radio" name="method" value="waveform">
          <span><strong>Full waveform</strong><small>refined by simulated traces; minutes</small></span></label>
      </fieldset>
      <fieldset class="choice" id="rays" disabled>
        <legend class="caption">Rays</legend>
        <label><input type="radio" name="rays" value="curved" checked>
          <span><strong>Bent</strong><small>corrected for refraction</small></span></label>
        <label><input type="radio" name="rays" value="straight">
          <span><strong>Straight</strong><small>no correction; faster</small></span></label>
      </fieldset>
      <div class="numbers">
        <label><span class="caption">Nodes per side</span>
          <input name="nodes" type="number" min="16" max="2048" placeholder="automatic"></label>
        <label><span class="caption">Iterations</span>
          <input name="iterations" type="number" min="1" max="1000" required></label>
      </div>
      <button id="start-own" type="submit" value="own" disabled>Start</button>
      </details>
      <p id="run-error" class="error" role="alert" hidden></p>
    </form>
  </section>
  <section aria-labelledby="jobs-title" id="of-scan">
    <h2 id="jobs-title">Reconstructions of this scan</h2>
  </section>
  <section aria-labelledby="about-title" class="panel">
    <h2 id="about-title">Geometry and quality</h2>
    <div class="about">
      <figure id="elements" class="figure"></figure>
      <div>
        <dl id="scan-facts" class="terms"></dl>
        <p id="geometry-error" class="error" role="alert" hidden></p>
        <h3>Quality</h3>
        <div id="quality"><p class="facts">Checking the scan</p></div>
        <p><a id="quality-page" target="_blank" rel="noopener">Quality report as an image</a></p>
        <p id="quality-error" class="error" role="alert" hidden></p>
      </div>
    </div>
  </section>
  <section aria-labelledby="shot-title" class="panel" id="traces" hidden></section>`;

// Settings of the two buttons. Best may take half an hour of one processor core for full waveforms.
const PRESETS = { fast: { method: "auto" }, best: { method: "auto", minutes: 30 } };

function ownSettings(element) {
  const form = new FormData(element);
  const settings = { method: form.get("method"), iterations: Number(form.get("iterations")) };
  if (form.get("nodes")) settings.nodes = Number(form.get("nodes"));
  // The method auto chooses the rays itself.
  if (form.has("rays")) settings.rays = form.get("rays");
  return settings;
}

function showMethod() {
  at("rays").disabled = new FormData(at("run")).get("method") === "auto";
}

function factsOf(scan) {
  const times = scan.has_travel_times ? "travel times" : "raw traces";
  const slices = scan.slices > 1 ? ` · ${scan.slices} slices` : "";
  return `${scan.ntx} emitters × ${scan.nrx} receivers · ${times}${slices} · water ${scan.water_speed_mps.toFixed(1)} m/s`;
}

// The settings of an earlier job in the form, to run it again with changes.
async function fillFrom(job) {
  const { settings } = await request(`/v1/jobs/${job}`);
  const { method, rays, nodes, iterations } = at("run").elements;
  method.value = settings.method;
  if (settings.rays) rays.value = settings.rays;
  nodes.value = settings.nodes ?? "";
  iterations.value = settings.iterations;
  at("run-own").open = true;
  showMethod();
}

// The elements and the facts; a function that marks the element that emits.
async function showGeometry(scan) {
  const geometry = await request(`/v1/datasets/${scan.id}/geometry`);
  if (!at("elements")) return () => {};
  const { picture, mark } = drawElements(geometry);
  const words = make("figcaption", "facts", `${inWordsOf(geometry)}. Circles emit, dots receive.`);
  at("elements").replaceChildren(picture, words);
  fillFacts(at("scan-facts"), factRows(geometry));
  return mark;
}

async function showReport(scan) {
  const report = await request(`/v1/datasets/${scan.id}/quality`);
  if (at("quality")) showQuality(at("quality"), report, scan.slices > 1);
}

// What workers read from the scan, each part on its own, so that one that fails hides no other. Returns close().
function showScan(scan) {
  withKey(at("quality-page")).href = `/v1/datasets/${scan.id}/quality.png`;
  const drawn = showGeometry(scan).catch((error) => {
    showError("geometry-error", error);
    return () => {};
  });
  showReport(scan).catch((error) => {
    at("quality")?.replaceChildren();
    showError("quality-error", error);
  });
  if (!scan.has_traces) return () => {};
  at("traces").hidden = false;
  return openShot(at("traces"), scan, (element) => drawn.then((mark) => mark(element)));
}

export async function open(root, { id, query }) {
  const scan = await request(`/v1/datasets/${id}`);
  root.innerHTML = PAGE;
  document.title = `${titleOf(scan)} – Bentray`;
  at("scan-name").textContent = titleOf(scan);
  at("dataset-facts").textContent = factsOf(scan);
  const jobs = jobList(at("of-scan"), {
    empty: "Nothing has run yet. Press Fast or Best. The image appears here.",
    wanted: (job) => job.dataset === id && job.kind === "reconstruction",
  });
  at("run").addEventListener("submit", (event) => {
    event.preventDefault();
    const preset = PRESETS[event.submitter?.value ?? "fast"];
    startJob({ kind: "reconstruction", dataset: id, settings: preset ?? ownSettings(event.target) }, "run-error", jobs.refresh);
  });
  at("run").addEventListener("change", showMethod);
  showMethod();
  fillDefaults(at("run"), "Settings").then(
    async () => {
      if (query.has("from") && root.isConnected) await fillFrom(query.get("from")).catch((error) => showError("run-error", error));
      if (root.isConnected) at("start-own").disabled = false;
    },
    (error) => showError("run-error", error),
  );
  const closeShot = showScan(scan);
  return () => {
    closeShot();
    jobs.close();
  };
}
