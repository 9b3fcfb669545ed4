// Lists of records: titles, pages of a list that is newest first, and fields that search while one types.
import { go, linkTo } from "./address.js";
import { request } from "./api.js";
import { Form, html, useLater } from "./view.js";

const TYPING_MS = 300;

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

// Deletes a record for good after a question, and opens another page. act: of useAct.
export const deleteRecord = (act, name, address, path) => confirm(`Delete ${name} for good?`) && act(async () => {
  await request(address, { method: "DELETE" });
  go(path);
});

// Load what the jobs refer to and is not known yet.
export async function loadTitles(jobs) {
  const missing = Object.entries(FIELDS).filter(([field, what]) => jobs.some((job) => job[field] && !known[what].has(job[field])));
  await Promise.all(missing.map(([, what]) => load(what)));
}

// The parameter "before" of the next page, from its address; "" on the last one.
export const olderOf = (next) => (next ? new URLSearchParams(next.split("?")[1]).get("before") : "");

// Links to the newest and to older records. query: what the list shows; older: "before" of the next page.
export function ListPages({ path, query, older, words, ...more }) {
  const address = (before) => {
    const turned = new URLSearchParams(query);
    turned.delete("before");
    if (before) turned.set("before", before);
    return linkTo(path, turned);
  };
  return html`<nav class="pages" aria-label="Pages of the list" ...${more}>
    ${query.has("before") && html`<a class="button" href=${address("")}>Newest ${words}</a>`}
    ${older && html`<a class="button" href=${address(older)}>Older ${words}</a>`}
  </nav>`;
}

// A form of filters; onChange(query) gets its filled fields, without "before", when they change or are submitted.
export function Filters({ label, onChange, children, ...more }) {
  const later = useLater();
  const read = (form) => {
    const filled = [...new FormData(form)].map(([name, value]) => [name, value.trim()]).filter(([, value]) => value);
    onChange(new URLSearchParams(filled));
  };
  const onInput = ({ currentTarget, target }) => later(() => read(currentTarget), target.type === "search" ? TYPING_MS : 0);
  return html`<${Form} class="filters" role="search" aria-label=${label} onInput=${onInput} onSubmit=${({ currentTarget }) => read(currentTarget)} ...${more}>
    ${children}
  </${Form}>`;
}
