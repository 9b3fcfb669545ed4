// All jobs in a table, newest first, below batches of them; with "batch" in the address those of one batch.
import { IDLE_MS, isUnfinished } from "../jobs/followed_jobs.js";
import { JobTable } from "../jobs/job_table.js";
import { duration, moment } from "../jobs/job_words.js";
import { request } from "../parts/api.js";
import { parametersOf } from "../parts/description.js";
import { Alert, Button, html, useAct, useRead } from "../parts/view.js";

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
function Batches({ id }) {
  const read = async () => (id ? [await request(`/v1/batches/${id}`)] : (await request(`/v1/batches?limit=${SHOWN}`)).batches);
  const busy = (batches) => batches?.some(isUnfinished);
  const [batches, error, refresh] = useRead(read, { waitOf: (found) => (busy(found) ? BUSY_MS : IDLE_MS) });
  const [failure, attempt] = useAct();
  const act = (address) => attempt(async () => {
    await request(address, { method: "POST" });
    await refresh();
  });
  return html`
    <${Alert} error=${failure ?? error} />
    <div class="batches">${batches?.map((batch) => html`<${Batch} key=${batch.id} batch=${batch} act=${act} />`)}</div>`;
}

export async function open({ query }) {
  const batch = query.get("batch");
  document.title = batch ? "Batch – Bentray" : "Jobs – Bentray";
  const { state, kind } = await parametersOf("/v1/jobs");
  return html`<div class="wide">
    ${batch && html`<p class="crumb"><a href="#/jobs">All jobs</a></p>`}
    <h1>${batch ? "Batch" : "Jobs"}</h1>
    <${Batches} id=${batch} />
    <${JobTable} query=${query} words=${{ state: state.enum, kind: kind.enum }} />
  </div>`;
}
