// The viewer: upload a scan, start a reconstruction, follow the jobs.
import { request, upload } from "./api.js";
import { showJobs } from "./jobs.js";

const BUSY_MS = 700;
const IDLE_MS = 4000;
const at = (id) => document.getElementById(id);
const datasets = new Map();
let timer = 0;

function say(id, error) {
  at(id).textContent = error ? error.message : "";
  at(id).hidden = !error;
}

function titleOf(dataset) {
  return dataset.title || dataset.id;
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

async function send(file) {
  say("upload-error", null);
  at("upload").hidden = at("upload-bar").hidden = false;
  at("upload-name").textContent = `Sending ${file.name}`;
  at("upload-bar").value = 0;
  try {
    const dataset = await upload(file, (share) => {
      at("upload-bar").value = share;
      if (share === 1) at("upload-name").textContent = `Checking ${file.name}`;
    });
    at("upload-name").textContent = `${file.name} is stored`;
    at("upload-bar").hidden = true;
    await loadDatasets(dataset.id);
  } catch (error) {
    at("upload").hidden = true;
    say("upload-error", error);
  } finally {
    at("file").value = "";
  }
}

async function refresh() {
  clearTimeout(timer);
  let wait = IDLE_MS;
  try {
    const { jobs } = await request("/v1/jobs");
    if (jobs.some((job) => job.dataset && !datasets.has(job.dataset))) await loadDatasets();
    const titles = new Map([...datasets].map(([id, dataset]) => [id, titleOf(dataset)]));
    at("empty").hidden = jobs.length > 0;
    showJobs(at("jobs"), jobs, titles, cancel);
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
  const settings = { method: form.get("method"), nodes: Number(form.get("nodes")), sweeps: Number(form.get("sweeps")) };
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

// What a reconstruction takes when nothing is said, as the service itself describes it.
async function fillDefaults() {
  const { components } = await request("/openapi.json");
  for (const input of document.querySelectorAll("#run input[type=number]")) {
    input.value = components.schemas.Settings.properties[input.name].default;
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

const drop = at("drop");
for (const name of ["dragenter", "dragover"]) {
  drop.addEventListener(name, (event) => {
    event.preventDefault();
    drop.classList.add("over");
  });
}
for (const name of ["dragleave", "drop"]) drop.addEventListener(name, () => drop.classList.remove("over"));
drop.addEventListener("drop", (event) => {
  event.preventDefault();
  if (event.dataTransfer.files.length) send(event.dataTransfer.files[0]);
});
at("file").addEventListener("change", (event) => event.target.files.length && send(event.target.files[0]));
at("dataset").addEventListener("change", showFacts);
at("run").addEventListener("submit", start);
at("run").addEventListener("change", showMethod);
showMethod();
fillDefaults().catch((error) => say("run-error", error));
loadDatasets().catch((error) => say("jobs-error", error));
refresh();
health();
