// The viewer: upload a scan, start a reconstruction, follow the jobs; see glass.js for volumes, mesh.js for meshes.
import { request } from "./api.js";
import { at, showError } from "./dom.js";
import { loadVolumes, volumeTitle, watchGlass } from "./glass.js";
import { showJobs } from "./jobs.js";
import { admitted } from "./key.js";
import { loadMeshes, meshTitle, showFields, watchMeshes } from "./mesh.js";
import { fillSelect, startJob } from "./panel.js";
import { uploads } from "./uploads.js";

const BUSY_MS = 700;
const IDLE_MS = 4000;
const datasets = new Map();
// Volumes of jobs that are in the list of volumes already.
const listed = new Set();
let timer = 0;

function titleOf(dataset) {
  return dataset.title || dataset.id;
}

function titleOfJob(job) {
  if (job.mesh) return meshTitle(job.mesh);
  if (job.kind === "simulation" && !job.dataset) return "Will be a scan to reconstruct";
  return datasets.has(job.dataset) ? titleOf(datasets.get(job.dataset)) : volumeTitle(job.volume);
}

function showFacts() {
  const dataset = datasets.get(at("dataset").value);
  for (const id of ["start", "best", "start-own"]) at(id).disabled = !dataset;
  if (!dataset) return;
  const times = dataset.has_travel_times ? "travel times" : "raw traces";
  const slices = dataset.slices > 1 ? ` · ${dataset.slices} slices` : "";
  at("dataset-facts").textContent =
    `${dataset.ntx} emitters × ${dataset.nrx} receivers · ${times}${slices} · water ${dataset.water_speed_mps.toFixed(1)} m/s`;
}

async function loadDatasets(chosen) {
  const { datasets: rows } = await request("/v1/datasets");
  datasets.clear();
  for (const row of rows) datasets.set(row.id, row);
  fillSelect("dataset", rows, titleOf, chosen);
  showFacts();
}

async function refresh() {
  clearTimeout(timer);
  let wait = IDLE_MS;
  try {
    const { jobs } = await request("/v1/jobs");
    if (jobs.some((job) => job.dataset && !datasets.has(job.dataset))) await loadDatasets();
    const made = jobs.filter((job) => job.volume && !listed.has(job.volume)).map((job) => job.volume);
    if (made.length) await loadVolumes();
    for (const volume of made) listed.add(volume);
    at("empty").hidden = jobs.length > 0;
    showJobs(at("jobs"), jobs, titleOfJob, cancel);
    showFields(jobs);
    if (jobs.some((job) => ["queued", "running", "cancelling"].includes(job.state))) wait = BUSY_MS;
    showError("jobs-error", null);
  } catch (error) {
    showError("jobs-error", error);
  }
  timer = setTimeout(refresh, wait);
}

async function cancel(job) {
  try {
    await request(job.links.cancel, { method: "POST" });
    await refresh();
  } catch (error) {
    showError("jobs-error", error);
  }
}

// Settings of the two buttons. Best may take half an hour of one processor core for full waveforms.
const PRESETS = { fast: { method: "auto" }, best: { method: "auto", minutes: 30 } };

function showMethod() {
  at("rays").disabled = new FormData(at("run")).get("method") === "auto";
}

function start(event) {
  event.preventDefault();
  const preset = PRESETS[event.submitter?.value ?? "fast"];
  startJob({ kind: "reconstruction", dataset: at("dataset").value, settings: preset ?? ownSettings(event.target) }, "run-error", refresh);
}

function ownSettings(element) {
  const form = new FormData(element);
  const settings = { method: form.get("method"), iterations: Number(form.get("iterations")) };
  if (form.get("nodes")) settings.nodes = Number(form.get("nodes"));
  // The method auto chooses the rays itself.
  if (form.has("rays")) settings.rays = form.get("rays");
  return settings;
}

// The default settings of jobs, from the OpenAPI description.
async function fillDefaults() {
  const { components } = await request("/openapi.json");
  for (const [id, schema] of [["run", "Settings"], ["look", "Turntable"], ["field", "FieldSettings"]]) {
    for (const input of at(id).querySelectorAll("input[required]")) {
      // Also used when the form is reset.
      if (input.type === "number") input.defaultValue = components.schemas[schema].properties[input.name].default;
    }
  }
}

// What the form states about a file of another program.
function scanAddress() {
  const query = new URLSearchParams();
  for (const [name, value] of new FormData(at("own"))) {
    for (const one of value.split(",")) {
      if (one.trim()) query.append(name, one.trim());
    }
  }
  return `/v1/datasets?${query}`;
}

async function health() {
  const sign = at("health");
  try {
    const { workers } = await request("/health/ready");
    sign.textContent = workers === 1 ? "ready, 1 worker" : `ready, ${workers} workers`;
    sign.className = "health good";
  } catch (error) {
    sign.textContent = error.message;
    sign.className = "health bad";
  }
  setTimeout(health, 15000);
}

const sendAgain = uploads("scan", scanAddress, "application/x-hdf5", (dataset) => loadDatasets(dataset.id));
at("own").addEventListener("submit", (event) => {
  event.preventDefault();
  sendAgain();
});
watchGlass(refresh);
watchMeshes(refresh);
at("dataset").addEventListener("change", showFacts);
at("run").addEventListener("submit", start);
at("run").addEventListener("change", showMethod);
showMethod();
fillDefaults().catch((error) => showError("run-error", error));
health();
if (await admitted(request)) {
  loadDatasets().catch((error) => showError("jobs-error", error));
  loadVolumes().catch((error) => showError("jobs-error", error));
  loadMeshes().catch((error) => showError("jobs-error", error));
  refresh();
}
