// One job: its progress while it runs, then its result; and below it the messages to its webhook.
import { JobList } from "../jobs/job_list.js";
import { LiveJob } from "../jobs/live_job.js";
import { WebhookPanel } from "../jobs/webhook_panel.js";
import { request } from "../parts/api.js";
import { Alert, html, useShown, useState } from "../parts/view.js";

const resultOf = async (parameters) => (await import("./result.js")).open(parameters);

// result: the view of a reconstruction that has succeeded already.
function Job({ job, result: ready, query, id }) {
  const [result, setResult] = useState(ready);
  const [error, setError] = useState(null);
  const shown = useShown();

  async function onSuccess(ended) {
    // Who asked for a sample wants its scan, and "back" to lead to the start.
    if (query.get("then") === "scan" && ended.kind === "simulation") {
      location.replace(`#/scans/${ended.dataset}`);
      return;
    }
    try {
      const view = ended.kind === "reconstruction" ? await resultOf({ id, query }) : html`<${JobList} read=${async () => [await request(`/v1/jobs/${id}`)]} />`;
      // The reader may have gone on in the meantime.
      if (shown.current) setResult(view);
    } catch (problem) {
      setError(problem);
    }
  }

  return html`
    <div>${result ?? html`<${LiveJob} first=${job} onSuccess=${onSuccess} />`}</div>
    <${Alert} error=${error} />
    <${WebhookPanel} id=${id} />`;
}

export async function open({ id, query }) {
  const job = await request(`/v1/jobs/${id}`);
  const finished = job.kind === "reconstruction" && job.state === "succeeded";
  if (!finished) document.title = "Job – Bentray";
  return html`<${Job} job=${job} id=${id} query=${query} result=${finished ? await resultOf({ id, query }) : null} />`;
}
