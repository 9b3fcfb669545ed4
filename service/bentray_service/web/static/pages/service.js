// The service: workers, queues, storage against its quota, keys of the tenant, and its projects.
import { description, request } from "../parts/api.js";
import { Projects } from "../parts/projects.js";
import { Alert, Facts, HeadedTable, html, Section, useRead } from "../parts/view.js";
import { counted, inBytes, inTime } from "../parts/words.js";

// Workers send their state every half a second or more rarely.
const FRESH_MS = 5000;
const WORKER_COLUMNS = ["Worker", "State", "Memory", "Threads", "Processor", "Tasks", "OpenCL device"];
const KEY_COLUMNS = ["Name", "Id", "Scopes", "State", "Created", "Last used", "Expires"];
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

// A bar for a part of a whole, with its numbers as text beside it.
function Share({ part, whole, words }) {
  return html`<div class="share">
    <meter min="0" max=${whole} low=${0.75 * whole} high=${0.9 * whole} optimum="0" value=${Math.min(part, whole)} aria-label=${words}></meter>
    <span>${words}</span>
  </div>`;
}

function memory({ memory_bytes: used, memory_limit_bytes: limit }) {
  if (used === null) return limit ? `of ${inBytes(limit)}` : "unknown";
  if (!limit) return `${inBytes(used)}, no limit`;
  return html`<${Share} part=${used} whole=${limit} words=${`${inBytes(used)} of ${inBytes(limit)}`} />`;
}

function workerRow(worker, number) {
  return [
    `Worker ${number + 1}`,
    worker.paused ? "paused, its memory is nearly used up" : "ready",
    memory(worker),
    worker.threads ?? "unknown",
    worker.cpu_percent === null ? "unknown" : `${worker.cpu_percent.toFixed(0)} %`,
    worker.running_tasks,
    worker.opencl ? "available" : "none in use",
  ];
}

function Workers({ workers }) {
  if (!workers.length) return html`<${Facts}>No worker is connected. Jobs wait until one is.</${Facts}>`;
  return html`
    <${HeadedTable} label="Table of workers" columns=${WORKER_COLUMNS} rows=${workers.map(workerRow)} />
    <${Facts}>100 % is one processor core. A device is tested at the first job that needs one; <code>bentray devices</code> lists those of a machine.</${Facts}>`;
}

// shared: with the numbers of all tenants.
function Queue({ queue, shared }) {
  const columns = shared ? ["Jobs", "Yours", "All tenants"] : ["Jobs", "Number"];
  const rows = [["Running", queue.running, queue.all_running], ["Queued", queue.queued, queue.all_queued]];
  return html`
    <${HeadedTable} label="Jobs in the queue" columns=${columns} rows=${rows.map((row) => row.slice(0, columns.length))} />
    <${Facts}>${counted(queue.waiting_images, "image waits", "images wait")} for a worker.</${Facts}>`;
}

function Storage({ storage, bytes_most: most }) {
  const total = (name) => storage.reduce((sum, row) => sum + row[name], 0);
  const [stored, reserved] = [total("stored"), total("reserved")];
  const words = `${inBytes(stored + reserved)} of ${inBytes(most)} used${reserved ? `, ${inBytes(reserved)} of it reserved for unfinished jobs and uploads` : ""}`;
  const rows = storage.map((row) => [KINDS[row.kind] ?? row.kind, row.items, inBytes(row.stored), row.reserved ? inBytes(row.reserved) : "–"]);
  return html`
    <${Share} part=${stored + reserved} whole=${most} words=${words} />
    ${rows.length > 0 && html`<${HeadedTable} label="Storage by kind" columns=${["Kind", "Items", "Stored", "Reserved"]} rows=${rows} />`}`;
}

function stateOf({ revoked, expires }) {
  if (revoked) return `revoked ${inTime(revoked)}`;
  return expires && new Date(expires) <= new Date() ? "expired" : "valid";
}

function Keys({ keys, access: { how, tenant, who } }) {
  const rows = keys.map((key) => [
    key.id === who ? `${key.name} (this one)` : key.name,
    key.id, key.scopes.join(", "), stateOf(key), inTime(key.created), inTime(key.used), inTime(key.expires),
  ]);
  const open = how === "open" ? "No key is needed on this machine. Once a key exists, every request needs one. " : "";
  return html`
    ${rows.length > 0 && html`<${HeadedTable} label="Keys of the tenant" columns=${KEY_COLUMNS} rows=${rows} />`}
    <${Facts}>${open}Keys are created and revoked on the machine of the service, where the secret is shown once: ${" "}
      <code>bentray keys create --tenant ${tenant} --name NAME --expires 90d</code>, <code>bentray keys revoke ID</code>.</${Facts}>`;
}

function Panel({ name, title, error, children }) {
  return html`<${Section} id=${name} title=${title}>
    <div id=${name}>${children}</div>
    <${Alert} id=${`${name}-error`} error=${error} />
  </${Section}>`;
}

function Service({ access }) {
  const [about] = useRead(description);
  const [cluster, clusterError] = useRead(() => request("/v1/cluster"), { waitOf: () => FRESH_MS });
  const [storage, storageError] = useRead(() => request("/v1/access/storage"));
  const [listed, keysError] = useRead(() => request("/v1/access/keys"));
  const who = access.how === "open" ? "open to this machine" : `tenant ${access.tenant} (${access.scopes.join(", ")})`;
  return html`
    <h1>Service</h1>
    <p id="service-about" class="facts">${about && `Bentray ${about.info.version}, ${who}`}</p>
    <${Panel} name="workers" title="Workers" error=${clusterError}>${cluster && html`<${Workers} ...${cluster} />`}</${Panel}>
    <${Panel} name="queue" title="Queue">${cluster && html`<${Queue} queue=${cluster.queue} shared=${access.how !== "open"} />`}</${Panel}>
    <${Panel} name="storage" title="Storage" error=${storageError}>${storage && html`<${Storage} ...${storage} />`}</${Panel}>
    <${Panel} name="keys" title="API keys" error=${keysError}>${listed && html`<${Keys} keys=${listed.keys} access=${access} />`}</${Panel}>
    <${Panel} name="projects" title="Projects">
      ${(listed || keysError) && html`<${Projects} access=${access} keys=${listed?.keys ?? []} />`}
    </${Panel}>`;
}

export async function open() {
  document.title = "Service – Bentray";
  return html`<${Service} access=${await request("/v1/access")} />`;
}
