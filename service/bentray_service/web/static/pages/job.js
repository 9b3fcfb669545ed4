// One job: its progress while it runs, then its result; and below it the messages to its webhook.
import { parse } from "../parts/address.js";
import { request } from "../parts/api.js";
import { make } from "../parts/dom.js";
import { jobList } from "../jobs/job_list.js";
import { liveJob } from "../jobs/live_job.js";
import { showWebhook } from "../jobs/webhook_panel.js";

export async function open(page, parameters) {
  const { id } = parameters;
  const [root, below] = [make("div"), make("div")];
  page.append(root, below);
  const closeMain = await openMain(root, parameters);
  const closeWebhook = showWebhook(below, id);
  return () => {
    closeWebhook();
    closeMain();
  };
}

async function openMain(root, parameters) {
  const { id } = parameters;
  // Who asked for a sample wants its scan, and "back" to lead to the start.
  const opensScan = parse(location.hash).query.get("then") === "scan";
  const result = async () => (await import("./result.js")).open(root, parameters);
  const job = await request(`/v1/jobs/${id}`);
  if (job.kind === "reconstruction" && job.state === "succeeded") return result();
  document.title = "Job – Bentray";
  let left = false;
  let close = () => {};
  const live = liveJob(root, job, async (ended) => {
    if (opensScan && ended.kind === "simulation") return location.replace(`#/scans/${ended.dataset}`);
    live.close();
    root.replaceChildren();
    const opened = ended.kind === "reconstruction" ? await result() : jobList(root, { read: async () => [await request(`/v1/jobs/${id}`)] }).close;
    // The reader may have gone on in the meantime.
    if (left) opened();
    else close = opened;
  });
  return () => {
    left = true;
    live.close();
    close();
  };
}
