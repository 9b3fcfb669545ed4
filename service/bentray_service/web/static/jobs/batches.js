// Batches of reconstructions above the table of jobs: one with its settings, or the newest, each with one progress.
import { request } from "../parts/api.js";
import { Alert, Button, html, useAct, useRead } from "../parts/view.js";
import { IDLE_MS, isUnfinished } from "./followed_jobs.js";
import { duration, moment } from "./job_words.js";

const SHOWN = 5;
const BUSY_MS = 2000;
const STATES = ["succeeded", "failed", "cancelled", "cancelling", "running", "queued"];

function Batch({ batch, act }) {
  const { id, state, counts, progress, seconds, created, links } = batch;
  const name = batch.name || `Batch of ${batch.size} scans`;
  const states = STATES.filter((one) => counts[one]).map((one) => `${counts[one]} ${one}`).join(", ");
  const time = seconds === null ? "" : ` · ${duration(seconds)}`;
  const cancel = () => confirm(`Cancel ${name}? Results so far stay.`) && act(links.cancel);
  return html`<section class="batch">
    <h2><a href=${`#/jobs?batch=${id}`}>${name}</a><span class=${`state ${state}`}>${state}</span></h2>
    <progress max="1" value=${progress} aria-label=${`Progress of ${name}`}></progress>
    <p class="facts">${Math.floor(100 * progress)} % · ${states} · started ${moment(created)}${time}</p>
    ${links.cancel && html`<${Button} aria-label=${`Cancel ${name}`} onClick=${cancel}>Cancel</${Button}>`}
  </section>`;
}

// One batch, or without an id the newest.
export function Batches({ id }) {
  const read = async () => (id ? [await request(`/v1/batches/${id}`)] : (await request(`/v1/batches?limit=${SHOWN}`)).batches);
  const busy = (batches) => batches?.some(isUnfinished);
  const [batches, error, refresh] = useRead(read, (found) => (busy(found) ? BUSY_MS : IDLE_MS));
  const [failure, attempt] = useAct();
  const act = (address) => attempt(async () => {
    await request(address, { method: "POST" });
    await refresh();
  });
  return html`
    <${Alert} error=${failure ?? error} />
    <div class="batches">${batches?.map((batch) => html`<${Batch} key=${batch.id} batch=${batch} act=${act} />`)}</div>`;
}
