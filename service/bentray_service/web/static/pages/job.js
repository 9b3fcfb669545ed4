// One job: its progress while it runs, then its result; and below it the messages to its webhook.
import { JobList } from "../jobs/job_cards.js";
import { LiveJob } from "../jobs/live_job.js";
import { request } from "../parts/api.js";
import { Alert, Facts, HeadedTable, html, Section, useRead, useShown, useState } from "../parts/view.js";
import { inTime } from "../parts/words.js";

const FRESH_MS = 5000;
const COLUMNS = ["Attempt", "Time", "Answer", "Duration"];
const STATES = {
  pending: "The message is sent when the job has ended.",
  waiting: "The message has not been accepted yet.",
  delivered: "The message was accepted.",
  failed: "The message was given up after the last attempt.",
};
// States of jobs of the same colour.
const COLOURS = { delivered: "succeeded", waiting: "running" };

function rowOf({ time, status, error, seconds }, number) {
  const answer = [status !== null && `status ${status}`, error].filter(Boolean).join(": ");
  return [number + 1, inTime(time), answer, `${seconds.toFixed(2)} s`];
}

// Followed until the message is accepted or given up; nothing for a job without a webhook.
function WebhookPanel({ id }) {
  const ended = (job) => job && (!job.webhook || ["delivered", "failed"].includes(job.webhook.state));
  const [job] = useRead(() => request(`/v1/jobs/${id}`), { waitOf: (found) => (ended(found) ? null : FRESH_MS) });
  if (!job?.webhook) return null;
  const { url, state, attempts, due, message } = job.webhook;
  const title = html`Webhook<span class=${`state ${COLOURS[state] ?? state}`}>${state}</span>`;
  return html`<${Section} id="webhook" title=${title} className="panel webhook">
    <${Facts}>${STATES[state]}${due && ` Next attempt: ${inTime(due)}.`}</${Facts}>
    <${Facts}>${message ? `${url}, message ${message}` : url}</${Facts}>
    ${attempts.length > 0 && html`<${HeadedTable} label="Attempts to send the message" columns=${COLUMNS} rows=${attempts.map(rowOf)} />`}
  </${Section}>`;
}

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
