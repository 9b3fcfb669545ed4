// A result: its job, volume, summary, and values, read from the service.
import { request } from "./api.js";
import { Values } from "../viewer/quantities.js";

export async function loadResult(id) {
  const job = await request(`/v1/jobs/${id}`);
  if (job.kind !== "reconstruction" || job.state !== "succeeded") {
    throw new Error(`${id} is no finished reconstruction: ${job.kind}, ${job.state}`);
  }
  const volume = await request(job.links.volume);
  const summary = await request(`${volume.links.self}/summary`);
  return { job, volume, summary, values: new Values(volume, summary.grids) };
}

// What a reader calls it: its own name, else what was reconstructed how.
export function nameOf({ job, volume }) {
  return job.name || volume.title || job.id;
}
