// The webhook of a job: state of its message, every attempt to send it with the answer, and the time of the next one.
import { inTime } from "../parts/amounts.js";
import { request } from "../parts/api.js";
import { HeadedTable } from "../parts/tables.js";
import { Facts, html, useRead } from "../parts/view.js";

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
export function WebhookPanel({ id }) {
  const ended = (job) => job && (!job.webhook || ["delivered", "failed"].includes(job.webhook.state));
  const [job] = useRead(() => request(`/v1/jobs/${id}`), (found) => (ended(found) ? null : FRESH_MS));
  if (!job?.webhook) return null;
  const { url, state, attempts, due, message } = job.webhook;
  return html`<section class="panel webhook" aria-labelledby="webhook-title">
    <h2 id="webhook-title">Webhook<span class=${`state ${COLOURS[state] ?? state}`}>${state}</span></h2>
    <${Facts}>${STATES[state]}${due && ` Next attempt: ${inTime(due)}.`}</${Facts}>
    <${Facts}>${message ? `${url}, message ${message}` : url}</${Facts}>
    ${attempts.length > 0 && html`<${HeadedTable} label="Attempts to send the message" columns=${COLUMNS} rows=${attempts.map(rowOf)} />`}
  </section>`;
}
