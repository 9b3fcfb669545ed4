// All jobs in a table, newest first, below batches of them; with "batch" in the address those of one batch.
import { IDLE_MS, isUnfinished, useJobs } from "../jobs/followed_jobs.js";
import { keepQuery, pick } from "../parts/address.js";
import { parametersOf, request } from "../parts/api.js";
import { Filters, ListPages, loadTitles, olderOf, Renamable, Thumbnail, titleOfJob } from "../parts/lists.js";
import { Alert, Button, Choice, Field, html, useAct, useNewest, useRead, useRef, useState } from "../parts/view.js";
import { counted, duration, inTime, inWords, moment } from "../parts/words.js";

// Batches that are shown, and jobs on a page of the table.
const SHOWN = 5;
const PAGE = 25;
const BUSY_MS = 2000;
const STATES = ["succeeded", "failed", "cancelled", "cancelling", "running", "queued"];
const ENDED = ["succeeded", "failed", "cancelled"];
const PLACES = { dataset: "scans", volume: "rendering", mesh: "surfaces" };
// On a small screen the name of the column stands before each text.
const COLUMNS = ["Name", "Kind", "Scan", "State", "Started by", "When", "Duration", "Actions"];

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

// What the job reads, or the scan that it made.
function source(job) {
  const field = ["mesh", "dataset", "volume"].find((name) => job[name] && !(name === "volume" && job.kind === "reconstruction"));
  return field ? html`<a href=${`#/${PLACES[field]}/${job[field]}`}>${titleOfJob(job)}</a>` : "–";
}

function State({ job }) {
  const { done, total, phase } = job.progress;
  return html`<div class="state-cell">
    <span class=${`state ${job.state}`}>${job.state}</span>
    ${job.state === "running" && total > 0 && html`
      <progress max=${total} value=${done} aria-label=${`Progress of ${job.title}`}></progress>
      <small>${phase} ${Math.floor((100 * done) / total)} %</small>`}
    ${job.error && html`<small class="reason">${job.error.detail}</small>`}
  </div>`;
}

function Actions({ job, act }) {
  const name = `${job.title} of ${moment(job.created)}`;
  function remove() {
    const made = job.kind === "simulation" ? "Its scan stays." : "What it made is deleted too.";
    if (confirm(`Delete ${name}? ${made}`)) act(job.links.self, "DELETE");
  }
  return html`<div class="row-actions">
    ${job.links.cancel && html`<${Button} aria-label=${`Cancel ${name}`} onClick=${() => act(job.links.cancel, "POST")}>Cancel</${Button}>`}
    ${ENDED.includes(job.state) && html`<${Button} aria-label=${`Delete ${name}`} onClick=${remove}>Delete</${Button}>`}
  </div>`;
}

// Roles in full, since a table that is laid out as cards is no table for a screen reader.
function Row({ job, act, refresh }) {
  const cells = [
    html`<${Thumbnail} record=${job} />
      <${Renamable} record=${job} field="name" name=${job.title} onRename=${refresh}><a href=${`#/jobs/${job.id}`}>${job.title}</a></${Renamable}>`, inWords(job.kind), source(job), html`<${State} job=${job} />`, job.started_by || "–",
    html`<time datetime=${job.created} title=${inTime(job.created)}>${moment(job.created)}</time>`,
    job.seconds === null ? "–" : duration(job.seconds), html`<${Actions} job=${job} act=${act} />`,
  ];
  return html`<tr role="row" id=${job.id}>
    ${cells.map((cell, i) => html`<td role="cell" data-column=${COLUMNS[i]}>${cell}</td>`)}
  </tr>`;
}

// words: the choices of the filters by their names.
function JobFilters({ words, query, onChange, hidden }) {
  const form = useRef(null);
  const clear = () => {
    for (const field of form.current.elements) if (field.name) field.value = "";
    form.current.elements.text.focus();
    onChange(new URLSearchParams());
  };
  const entries = (name) => [["", "All"], ...words[name].map((word) => [word, inWords(word)])];
  return html`<${Filters} ref=${form} label="Jobs" hidden=${hidden} onChange=${onChange}>
    <${Field} caption="Name, scan, notes, owner or id" name="text" type="search" maxlength="200" defaultValue=${query.get("text") ?? ""} />
    <${Choice} caption="State" name="state" entries=${entries("state")} chosen=${query.get("state")} />
    <${Choice} caption="Kind" name="kind" entries=${entries("kind")} chosen=${query.get("kind")} />
    <${Button} disabled=${!pick(query, ["text", "state", "kind"]).size} onClick=${clear}>Clear filters</${Button}>
  </${Filters}>`;
}

// query: filters and page, of the address; words: the choices of the filters by their names.
function JobTable({ query: first, words }) {
  const [query, setQuery] = useState(pick(first, ["batch", "text", "state", "kind", "before"]));
  const [older, setOlder] = useState("");
  const newest = useNewest(query);
  const [jobs, error, refresh, act] = useJobs({
    key: query.toString(),
    async read() {
      const { jobs: found, next } = await request(`/v1/jobs?${new URLSearchParams([...query, ["limit", PAGE]])}`);
      await loadTitles(found);
      // The filters may have been changed in the meantime.
      if (query === newest.current) setOlder(olderOf(next));
      return found;
    },
  });

  function change(filters) {
    // The page of a batch stays that of the batch.
    if (query.has("batch")) filters.set("batch", query.get("batch"));
    keepQuery(filters);
    setQuery(filters);
  }

  const none = jobs?.length === 0;
  const filtered = pick(query, ["text", "state", "kind"]).size > 0;
  return html`
    <${JobFilters} words=${words} query=${query} onChange=${change} hidden=${!jobs || (none && !query.size)} />
    <${Alert} error=${error} />
    <p class="facts" role="status">
      ${jobs?.length > 0 && `${counted(jobs.length, "job", "jobs")}${older ? " on this page, and older ones" : ""}`}
      ${none && filtered && "No job matches these filters."}
      ${none && !filtered && html`Nothing has run yet. Upload a scan and press Fast or Best. <a href="#/">To the scans</a>`}
    </p>
    <table class="job-table" role="table" aria-label="Jobs" hidden=${!jobs || none}>
      <thead role="rowgroup"><tr role="row">${COLUMNS.map((name) => html`<th role="columnheader">${name}</th>`)}</tr></thead>
      <tbody role="rowgroup">${jobs?.map((job) => html`<${Row} key=${job.id} job=${job} act=${act} refresh=${refresh} />`)}</tbody>
    </table>
    <${ListPages} path="/jobs" query=${query} older=${older} words="jobs" />`;
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
