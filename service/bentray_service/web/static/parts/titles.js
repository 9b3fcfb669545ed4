// Titles of scans, volumes, meshes, and of the jobs that use them.
import { request } from "./api.js";

const known = { datasets: new Map(), volumes: new Map(), meshes: new Map() };
const FIELDS = { dataset: "datasets", volume: "volumes", mesh: "meshes" };

// Records of one kind ("datasets", "volumes" or "meshes"), newest first.
export async function load(what) {
  const { [what]: records } = await request(`/v1/${what}?limit=1000`);
  for (const record of records) known[what].set(record.id, record);
  return records;
}

export function titleOf(record) {
  return record.title || record.id;
}

export function titleOfJob(job) {
  if (job.kind === "simulation" && !job.dataset) return "Will be a scan to reconstruct";
  const field = ["mesh", "dataset", "volume"].find((one) => job[one]);
  const record = field && known[FIELDS[field]].get(job[field]);
  return record ? titleOf(record) : field ? job[field] : job.id;
}

// Load what the jobs refer to and is not known yet.
export async function loadTitles(jobs) {
  const missing = Object.entries(FIELDS).filter(([field, what]) => jobs.some((job) => job[field] && !known[what].has(job[field])));
  await Promise.all(missing.map(([, what]) => load(what)));
}
