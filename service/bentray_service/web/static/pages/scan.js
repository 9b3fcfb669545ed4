// One scan: its geometry, facts, quality and traces, the reconstruction to start, and the reconstructions of it.
import { request } from "../parts/api.js";
import { at, make, showError } from "../parts/dom.js";
import { jobList } from "../jobs/job_list.js";
import { show, withKey } from "../parts/key.js";
import { startJob } from "../parts/panel.js";
import { planInWords, planOf, queueInWords, timeInWords } from "../parts/plan_estimate.js";
import { drawElements, inWordsOf } from "../scans/scan_drawing.js";
import { correctButton, scanEditor } from "../scans/scan_edit.js";
import { factRows, fillFacts, showQuality } from "../scans/scan_facts.js";
import { settingsForm } from "../parts/settings_form.js";
import { openShot } from "../scans/shot.js";
import { titleOf } from "../parts/titles.js";

const PAGE = `
  <h1 id="scan-name"></h1>
  <p id="dataset-facts" class="facts"></p>
  <div id="scan-editor"></div>
  <section aria-labelledby="run-title" class="panel">
    <h2 id="run-title">Reconstruction</h2>
    <form id="run" novalidate>
      <div class="presets">
        <button id="start" type="submit" value="fast">Fast
          <small>rays and method chosen automatically</small>
          <small class="time" id="fast-time">…</small></button>
        <button id="best" type="submit" value="best">Best
          <small id="best-words">then full waveform, where it predicts unused traces better</small>
          <small class="time" id="best-time">…</small></button>
      </div>
      <details id="run-own">
      <summary>All settings</summary>
      <div id="run-settings"><p class="facts">Reading the settings</p></div>
      <p id="own-plan" class="facts" role="status"></p>
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
        <p id="quality-error" class="error" role="alert" hidden></p>
      </div>
    </div>
    <details id="quality-more">
      <summary>Matrix and histogram of the travel times, excluded pairs</summary>
      <img id="quality-picture" class="report" alt="Traces with picks, matrix and histogram of the travel times, excluded pairs with reasons, findings">
      <p><a id="quality-page" target="_blank" rel="noopener">Quality report as an image</a></p>
    </details>
  </section>
  <section aria-labelledby="shot-title" class="panel" id="traces" hidden></section>`;

// Settings of the two buttons. Best may take half an hour of one processor core for full waveforms.
const PRESETS = { fast: { method: "auto" }, best: { method: "auto", minutes: 30 } };
const PLAN_MS = 400;

function factsOf(scan) {
  const times = scan.has_travel_times ? "travel times" : "raw traces";
  const slices = scan.slices > 1 ? ` · ${scan.slices} slices` : "";
  const stated = scan.water_temperature_c;
  const water = stated === null ? `water ${scan.water_speed_mps.toFixed(1)} m/s` : `water ${stated} °C, stated here`;
  return `${scan.ntx} emitters × ${scan.nrx} receivers · ${times}${slices} · ${water}`;
}

// The time of each button, by a plan of the service; a plan that is refused says why.
function presetTimes(scan) {
  let number = 0;
  return () => {
    const mine = ++number;
    for (const [name, settings] of Object.entries(PRESETS)) {
      const show = (textContent, title = "") => {
        if (mine === number && at(`${name}-time`)) Object.assign(at(`${name}-time`), { textContent, title });
      };
      planOf({ kind: "reconstruction", dataset: scan.id, settings }).then(
        (estimate) => show([timeInWords(estimate), queueInWords(estimate)].filter(Boolean).join(", "), estimate.basis),
        (error) => show(error.message),
      );
    }
  };
}

// All settings as a form, those of an earlier job in it to run it again with changes. Returns close() and own().
async function showSettings(scan, from) {
  const form = await settingsForm();
  const earlier = from && (await request(`/v1/jobs/${from}`).catch((error) => showError("run-error", error)));
  if (!at("run-settings")) return { close() {} };
  at("run-settings").replaceChildren(form.node);
  if (earlier) {
    form.fill(earlier.settings);
    at("run-own").open = true;
  }
  let timer = 0;
  let number = 0;
  // A setting that the service refuses is told at its field before anything is started.
  const plan = async () => {
    const mine = ++number;
    const settings = form.changed(false);
    if (!settings) {
      at("own-plan").textContent = "";
      return;
    }
    let words = "";
    let refused = null;
    try {
      const estimate = await planOf({ kind: "reconstruction", dataset: scan.id, settings });
      words = `${planInWords(estimate)}. ${estimate.basis}`;
    } catch (error) {
      refused = error;
    }
    if (mine !== number || !at("own-plan")) return;
    at("own-plan").textContent = words;
    if (refused && !form.refuse(refused.problem ?? {}, false)) at("own-plan").textContent = refused.message;
  };
  const later = () => {
    clearTimeout(timer);
    timer = setTimeout(plan, PLAN_MS);
  };
  form.node.addEventListener("input", later);
  at("run-own").addEventListener("toggle", () => at("run-own")?.open && later());
  if (earlier) later();
  at("start-own").disabled = false;
  return { form, close: () => clearTimeout(timer) };
}

// The elements and the facts; a function that marks the element that emits.
function showGeometry(scan, geometry, editor) {
  const { picture, mark } = drawElements(geometry);
  const words = make("figcaption", "facts", `${inWordsOf(geometry)}. Circles emit, dots receive.`);
  at("elements").replaceChildren(picture, words);
  fillFacts(at("scan-facts"), factRows(geometry, scan));
  at("scan-facts").querySelector("[data-term=Water]").append(" ", correctButton(editor.openWater));
  editor.propose(geometry.proposed_corrections);
  return mark;
}

// What workers read from the scan, each part on its own, so that one that fails hides no other. Returns close().
function showScan(scan, editor) {
  const page = `/v1/datasets/${scan.id}/quality.png`;
  at("quality-page").href = page;
  let reported = false;
  const drawPage = () => {
    if (reported || !at("quality-more").open) return;
    reported = true;
    // Another fragment after another temperature, or the browser would keep the picture that it has.
    show(at("quality-picture"), `${page}#${scan.water_temperature_c ?? ""}`);
  };
  at("quality-more").ontoggle = drawPage;
  drawPage();
  at("quality").replaceChildren(make("p", "facts", "Checking the scan"));
  for (const id of ["geometry-error", "quality-error"]) showError(id, null);
  // What arrives after the page, or this view of the scan, was closed is left out.
  let closed = false;
  const unless = (show) => (found) => (closed ? () => {} : show(found));
  const geometry = request(`/v1/datasets/${scan.id}/geometry`);
  const drawn = geometry.then(unless((found) => showGeometry(scan, found, editor))).catch(
    unless((error) => {
      showError("geometry-error", error);
      return () => {};
    }),
  );
  request(`/v1/datasets/${scan.id}/quality`).then(
    unless((report) => showQuality(at("quality"), report, scan.slices > 1)),
    unless((error) => {
      at("quality").replaceChildren();
      showError("quality-error", error);
    }),
  );
  let closeShot = () => {};
  if (scan.has_traces) {
    at("traces").hidden = false;
    closeShot = openShot(at("traces"), scan, geometry, (element) => drawn.then((mark) => mark(element)));
  }
  return () => {
    closed = true;
    closeShot();
  };
}

export async function open(root, { id, query }) {
  const scan = await request(`/v1/datasets/${id}`);
  root.innerHTML = PAGE;
  withKey(at("quality-page"));
  const entitle = (shown) => {
    document.title = `${titleOf(shown)} – Bentray`;
    at("scan-name").textContent = titleOf(shown);
    at("dataset-facts").textContent = factsOf(shown);
  };
  entitle(scan);
  if (!scan.has_traces) at("best-words").textContent = "the same here: full waveforms need traces, and the file has none";
  const showTimes = presetTimes(scan);
  showTimes();
  let states = null;
  const jobs = jobList(at("of-scan"), {
    // A job that ends changes the estimates, one that waits the place in the queue.
    onJobs(all) {
      const now = all.map((job) => job.id + job.state).join();
      if (states !== null && states !== now) showTimes();
      states = now;
    },
    empty: "Nothing has run yet. Press Fast or Best. The image appears here.",
    filters: { kind: "reconstruction", text: id },
  });
  let own = { close() {} };
  at("run").addEventListener("submit", (event) => {
    event.preventDefault();
    const settings = PRESETS[event.submitter?.value ?? "fast"] ?? own.form.changed(true);
    if (!settings) return;
    const refused = (error) => event.submitter?.value === "own" && own.form.refuse(error.problem ?? {}, true);
    startJob({ kind: "reconstruction", dataset: id, settings }, "run-error", jobs.refresh, refused);
  });
  let closed = false;
  showSettings(scan, query.get("from")).then(
    (made) => {
      own = made;
      if (closed) own.close();
    },
    (error) => showError("run-error", error),
  );
  let water = scan.water_temperature_c;
  const editor = scanEditor(at("scan-editor"), scan, (changed) => {
    entitle(changed);
    if (changed.water_temperature_c === water) return;
    water = changed.water_temperature_c;
    closeShot();
    closeShot = showScan(changed, editor);
  });
  let closeShot = showScan(scan, editor);
  return () => {
    closed = true;
    own.close();
    closeShot();
    jobs.close();
  };
}
