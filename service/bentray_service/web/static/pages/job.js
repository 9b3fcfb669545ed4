// One job: its progress, then its result.
import { parse } from "../parts/address.js";
import { request } from "../parts/api.js";
import { make } from "../parts/dom.js";
import { jobList } from "../parts/job_list.js";

export async function open(root, parameters) {
  const { id } = parameters;
  // Who asked for a sample wants its scan, and "back" to lead to the start.
  const opensScan = parse(location.hash).query.get("then") === "scan";
  const job = await request(`/v1/jobs/${id}`);
  if (job.kind === "reconstruction" && job.state === "succeeded") return (await import("./result.js")).open(root, parameters);
  document.title = "Job – Bentray";
  root.append(make("h1", "", "Job"));
  let close = () => {};
  const jobs = jobList(root, {
    // Alone, since lists do not count the jobs before it.
    read: async () => [await request(`/v1/jobs/${id}`)],
    async onJobs([mine]) {
      if (opensScan && mine.kind === "simulation" && mine.state === "succeeded") return location.replace(`#/scans/${mine.dataset}`);
      if (mine.kind !== "reconstruction" || mine.state !== "succeeded") return;
      jobs.close();
      root.replaceChildren();
      close = await (await import("./result.js")).open(root, parameters);
    },
  });
  return () => {
    jobs.close();
    close();
  };
}
