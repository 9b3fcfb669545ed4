// The viewer: upload a scan, start a reconstruction, follow the jobs; see glass.js for volumes, mesh.js for meshes.
import { request } from "./api.js";
import { loadVolumes, volumeTitle, watchGlass } from "./glass.js";
import { showJobs } from "./jobs.js";
import { admitted } from "./key.js";
import { loadMeshes, meshTitle, showFields, watchMeshes } from "./mesh.js";
import { uploads } from "./uploads.js";

const BUSY_MS = 700;
const IDLE_MS = 4000;
const at = (id) => document.getElementById(id);
const datasets = new Map();
// Volumes of jobs that the list of volumes has been read for.
const asked = new Set();
let timer = 0;

function say(id, error) {
  at(id).textContent = error ? error.message : "";
  at(id).hidden = !error;
}

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
  at("start").disabled = !dataset;
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
  const select = at("dataset");
  const before = chosen || select.value;
  if (rows.length) {
    select.replaceChildren(...rows.map((row) => new Option(`${titleOf(row)} (${new Date(row.created).toLocaleString()})`, row.id)));
    select.disabled = false;
    if (datasets.has(before)) select.value = before;
  }
  showFacts();
}

async function refresh() {
  clearTimeout(timer);
  let wait = IDLE_MS;
  try {
    const { jobs } = await request("/v1/jobs");
    if (jobs.some((job) => job.dataset && !datasets.has(job.dataset))) await loadDatasets();
    const made = jobs.filter((job) => job.volume && !asked.has(job.volume)).map((job) => job.volume);
    if (made.length) await loadVolumes();
    for (const volume of made) asked.add(volume);
    at("empty").hidden = jobs.length > 0;
    showJobs(at("jobs"), jobs, titleOfJob, cancel);
    showFields(jobs);
    if (jobs.some((job) => ["queued", "running", "cancelling"].includes(job.state))) wait = BUSY_MS;
    say("jobs-error", null);
  } catch (error) {
    say("jobs-error", error);
  }
  timer = setTimeout(refresh, wait);
}

async function cancel(job) {
  try {
    await request(job.links.cancel, { method: "POST" });
    await refresh();
  } catch (error) {
    say("jobs-error", error);
  }
}

function showMethod() {
  at("rays").disabled = new FormData(at("run")).get("method") === "auto";
}

async function start(event) {
  event.preventDefault();
  say("run-error", null);
  const form = new FormData(event.target);
  const settings = { method: form.get("method"), nodes: Number(form.get("nodes")), iterations: Number(form.get("iterations")) };
  // With auto the rays are tried, not asked for.
  if (form.has("rays")) settings.rays = form.get("rays");
  const body = JSON.stringify({ kind: "reconstruction", dataset: at("dataset").value, settings });
  try {
    await request("/v1/jobs", { method: "POST", headers: { "Content-Type": "application/json" }, body });
    await refresh();
  } catch (error) {
    say("run-error", error);
  }
}

// What jobs take when nothing is said, as the service itself describes it.
async function fillDefaults() {
  const { components } = await request("/openapi.json");
  for (const [id, schema] of [["run", "Settings"], ["look", "Turntable"], ["field", "FieldSettings"]]) {
    for (const input of at(id).querySelectorAll("input[required]")) {
      // The value that a form goes back to when it is reset.
      if (input.type === "number") input.defaultValue = components.schemas[schema].properties[input.name].default;
    }
  }
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

uploads("scan", () => "/v1/datasets", "application/x-hdf5", (dataset) => loadDatasets(dataset.id));
watchGlass(refresh);
watchMeshes(refresh);
at("dataset").addEventListener("change", showFacts);
at("run").addEventListener("submit", start);
at("run").addEventListener("change", showMethod);
showMethod();
fillDefaults().catch((error) => say("run-error", error));
health();
if (await admitted(request)) {
  loadDatasets().catch((error) => say("jobs-error", error));
  loadVolumes().catch((error) => say("jobs-error", error));
  loadMeshes().catch((error) => say("jobs-error", error));
  refresh();
}
