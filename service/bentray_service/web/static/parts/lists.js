// Lists of records: titles, names changed in place, thumbnails, pages of a list that is newest first, and fields that search while one types.
import { go, linkTo, queryOf } from "./address.js";
import { request, send } from "./api.js";
import { Picture } from "./key.js";
import { Alert, Form, html, useAct, useLater, useLayoutEffect, useRef, useState } from "./view.js";

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

// A small picture beside the name of a scan or a job: it says nothing to a screen reader, which reads the name.
export function Thumbnail({ record: { links: { thumbnail, field, image } } }) {
  const [failed, setFailed] = useState(false);
  const view = field ? { width: 96, height: 96, rays: 2 } : { frame: false, size: 96 };
  const address = thumbnail ?? (image && `${image}?${queryOf(view)}`);
  return address && !failed && html`<${Picture} class="thumbnail" address=${address} alt="" onError=${() => setFailed(true)} />`;
}

// A name, shown by children, with a pencil that puts a field in its place: Enter saves, Escape leaves it as it was. field: of the record of a scan
// ("title") or a job ("name"); name: with which the field begins; onRename(record) gets the changed record.
export function Renamable({ record, field, name, onRename, children }) {
  // null before the first change.
  const [editing, setEditing] = useState(null);
  const [error, act, setError] = useAct();
  const [input, pencil] = [useRef(null), useRef(null)];
  // Before the next key is typed.
  useLayoutEffect(() => {
    if (editing) input.current.select();
    else if (editing !== null) pencil.current.focus();
  }, [editing]);
  const edit = (begun) => {
    setError(null);
    setEditing(begun);
  };
  const save = () => act(async () => {
    const typed = input.current.value.trim();
    if (typed !== name) {
      const changed = await send("PATCH", record.links.self, { [field]: typed });
      for (const records of Object.values(known)) if (records.has(changed.id)) records.set(changed.id, changed);
      await onRename(changed);
    }
    setEditing(false);
  });
  if (!editing) {
    return html`<span class="named" onDblClick=${() => edit(true)}>${children}
      <button type="button" class="pencil" ref=${pencil} title="Rename" aria-label=${`Rename ${name}`} onClick=${() => edit(true)}></button></span>`;
  }
  return html`<${Form} class="named" onSubmit=${save} onKeyDown=${({ key }) => key === "Escape" && edit(false)}>
    <input type="text" maxlength="200" ref=${input} defaultValue=${name} aria-label=${`New name of ${name}`} />
    <small>Enter saves, Escape leaves it</small>
    <${Alert} error=${error} />
  </${Form}>`;
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
