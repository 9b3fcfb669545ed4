// The service: workers, queues, storage against its quota, keys of the tenant, and its projects.
import { counted, inBytes, inTime } from "../parts/amounts.js";
import { request } from "../parts/api.js";
import { description } from "../parts/defaults.js";
import { at, make, showError } from "../parts/dom.js";
import { showProjects } from "../parts/projects.js";
import { headedTable, share } from "../parts/tables.js";

const PAGE = `
  <h1>Service</h1>
  <p id="service-about" class="facts"></p>
  <section class="panel" aria-labelledby="workers-title">
    <h2 id="workers-title">Workers</h2>
    <div id="workers"></div>
    <p id="workers-error" class="error" role="alert" hidden></p>
  </section>
  <section class="panel" aria-labelledby="queue-title">
    <h2 id="queue-title">Queue</h2>
    <div id="queue"></div>
  </section>
  <section class="panel" aria-labelledby="storage-title">
    <h2 id="storage-title">Storage</h2>
    <div id="storage"></div>
    <p id="storage-error" class="error" role="alert" hidden></p>
  </section>
  <section class="panel" aria-labelledby="keys-title">
    <h2 id="keys-title">API keys</h2>
    <div id="keys"></div>
    <p id="keys-error" class="error" role="alert" hidden></p>
  </section>
  <section class="panel" aria-labelledby="projects-title">
    <h2 id="projects-title">Projects</h2>
    <div id="projects"></div>
    <p id="projects-error" class="error" role="alert" hidden></p>
  </section>`;

// Workers send their state every half a second or more rarely.
const FRESH_MS = 5000;

function memory({ memory_bytes: used, memory_limit_bytes: limit }) {
  if (used === null) return limit ? `of ${inBytes(limit)}` : "unknown";
  if (!limit) return `${inBytes(used)}, no limit`;
  return share(used, limit, `${inBytes(used)} of ${inBytes(limit)}`);
}

function workerRow(worker, number) {
  return [
    `Worker ${number + 1}`,
    worker.paused ? "paused, its memory is nearly used up" : "ready",
    memory(worker),
    worker.threads === null ? "unknown" : String(worker.threads),
    worker.cpu_percent === null ? "unknown" : `${worker.cpu_percent.toFixed(0)} %`,
    String(worker.running_tasks),
    worker.opencl ? "available" : "none in use",
  ];
}

function showWorkers(workers) {
  if (!workers.length) {
    at("workers").replaceChildren(make("p", "facts", "No worker is connected. Jobs wait until one is."));
    return;
  }
  const columns = ["Worker", "State", "Memory", "Threads", "Processor", "Tasks", "OpenCL device"];
  const words = make("p", "facts", "100 % is one processor core. A device is tested at the first job that needs one; ");
  words.append(make("code", "", "bentray devices"), " lists those of a machine.");
  at("workers").replaceChildren(headedTable("Table of workers", columns, workers.map(workerRow)), words);
}

function showQueue(queue, shared) {
  const columns = shared ? ["Jobs", "Yours", "All tenants"] : ["Jobs", "Number"];
  const row = (name, own, all) => (shared ? [name, String(own), String(all)] : [name, String(own)]);
  const rows = [row("Running", queue.running, queue.all_running), row("Queued", queue.queued, queue.all_queued)];
  const images = `${counted(queue.waiting_images, "image waits", "images wait")} for a worker.`;
  at("queue").replaceChildren(headedTable("Jobs in the queue", columns, rows), make("p", "facts", images));
}

const KINDS = {
  scans: "Scans",
  results: "Results of reconstructions",
  volumes: "Uploaded volumes",
  meshes: "Meshes",
  "geometry-fields": "Geometry fields",
  exports: "Exported files",
  jobs: "Unfinished jobs, turntables",
  uploads: "Unfinished uploads",
};

function showStorage({ storage, bytes_most: most }) {
  const total = (name) => storage.reduce((sum, one) => sum + one[name], 0);
  const [stored, reserved] = [total("stored"), total("reserved")];
  const words = `${inBytes(stored + reserved)} of ${inBytes(most)} used${reserved ? `, ${inBytes(reserved)} of it reserved for unfinished jobs and uploads` : ""}`;
  const content = [share(stored + reserved, most, words)];
  const rows = storage.map((one) => [KINDS[one.kind] ?? one.kind, String(one.items), inBytes(one.stored), one.reserved ? inBytes(one.reserved) : "–"]);
  if (rows.length) content.push(headedTable("Storage by kind", ["Kind", "Items", "Stored", "Reserved"], rows));
  at("storage").replaceChildren(...content);
}

function stateOf({ revoked, expires }) {
  if (revoked) return `revoked ${inTime(revoked)}`;
  if (expires && new Date(expires) <= new Date()) return "expired";
  return "valid";
}

function showKeys({ keys }, { how, tenant, who }) {
  const command = `bentray keys create --tenant ${tenant} --name NAME --expires 90d`;
  const open = "No key is needed on this machine. Once a key exists, every request needs one.";
  const words = make("p", "facts");
  words.append(how === "open" ? `${open} ` : "", "Keys are created and revoked on the machine of the service, where the secret is shown once: ", make("code", "", command), ", ", make("code", "", "bentray keys revoke ID"), ".");
  const rows = keys.map((one) => [
    one.id === who ? `${one.name} (this one)` : one.name,
    one.id, one.scopes.join(", "), stateOf(one), inTime(one.created), inTime(one.used), inTime(one.expires),
  ]);
  const columns = ["Name", "Id", "Scopes", "State", "Created", "Last used", "Expires"];
  at("keys").replaceChildren(...(rows.length ? [headedTable("Keys of the tenant", columns, rows)] : []), words);
}

export async function open(root) {
  document.title = "Service – Bentray";
  const access = await request("/v1/access");
  root.innerHTML = PAGE;
  const who = access.how === "open" ? "open to this machine" : `tenant ${access.tenant} (${access.scopes.join(", ")})`;
  description().then(
    ({ info }) => {
      if (at("service-about")) at("service-about").textContent = `Bentray ${info.version}, ${who}`;
    },
    () => {},
  );
  let [closed, timer] = [false, 0];

  async function refresh() {
    clearTimeout(timer);
    try {
      const { workers, queue } = await request("/v1/cluster");
      if (closed) return;
      showError("workers-error", null);
      showWorkers(workers);
      showQueue(queue, access.how !== "open");
    } catch (error) {
      if (!closed) showError("workers-error", error);
    }
    if (!closed && !document.hidden) timer = setTimeout(refresh, FRESH_MS);
  }

  const onVisible = () => {
    if (!document.hidden) refresh();
  };
  document.addEventListener("visibilitychange", onVisible);
  const storage = request("/v1/access/storage").then((found) => closed || !at("storage") || showStorage(found), (error) => showError("storage-error", error));
  const listed = request("/v1/access/keys");
  const keys = listed.then((found) => closed || !at("keys") || showKeys(found, access), (error) => showError("keys-error", error));
  const projects = listed
    .catch(() => ({ keys: [] }))
    .then((found) => closed || !at("projects") || showProjects(at("projects"), access, found.keys))
    .catch((error) => showError("projects-error", error));
  await Promise.all([refresh(), storage, keys, projects]);
  return () => {
    closed = true;
    clearTimeout(timer);
    document.removeEventListener("visibilitychange", onVisible);
  };
}
