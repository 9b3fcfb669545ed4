// Name, notes and water of a scan: shown, and changed in a form; a corrected copy of a scan in wrong units. Its file stays as it is.
import { go } from "../parts/address.js";
import { send } from "../parts/api.js";
import { deleteRecord, titleOf } from "../parts/lists.js";
import { Alert, Button, Choice, Facts, Field, Form, html, Labelled, useAct, useEffect, useRef, useShown, useState } from "../parts/view.js";

const TIMES = { s: "s", ms: "ms", us: "µs", ns: "ns" };
const LENGTHS = { m: "m", cm: "cm", mm: "mm", um: "µm" };
const WATER = "Empty: as in the file. A temperature replaces it in the views of this page and in reconstructions that are started later; "
  + "each of their results states both. The file is not changed.";

// onSave(changes): of the record.
function EditForm({ scan, form, error, onSave, onCancel }) {
  const save = () => {
    const { title, notes, water } = form.current.elements;
    const changes = { notes: notes.value, water_temperature_c: water.value === "" ? null : Number(water.value) };
    // An unchanged name is not made one of the user.
    if (title.value.trim() !== scan.title) changes.title = title.value.trim();
    onSave(changes);
  };
  return html`<${Form} id="edit-form" class="panel edit" ref=${form} onSubmit=${save}>
    <${Field} caption="Name" name="title" type="text" maxlength="200" aria-describedby="edit-title-words" defaultValue=${scan.title} />
    <${Facts} id="edit-title-words">Empty: the title in the file.</${Facts}>
    <${Labelled} caption="Notes"><textarea name="notes" maxlength="4000" rows="3" defaultValue=${scan.notes}></textarea></${Labelled}>
    <${Field} caption="Water temperature (°C)" label=${{ class: "short" }} name="water" type="number" min="0" max="95" step="any"
      placeholder="as in the file" aria-describedby="edit-water-words" defaultValue=${scan.water_temperature_c ?? ""} />
    <${Facts} id="edit-water-words">${WATER}</${Facts}>
    <div class="actions"><button type="submit">Save</button> <${Button} id="edit-cancel" onClick=${onCancel}>Cancel</${Button}></div>
    <${Alert} id="edit-error" error=${error} />
  </${Form}>`;
}

// Two units: that of the original file, and the one in which it was read. proposed: of both, if the numbers suggest them.
function UnitFields({ name, words, units, proposed = {} }) {
  const entries = Object.entries(units);
  return html`<div class="units">
    <${Choice} caption=${`${words} in the original file`} name=${`${name}_in`} entries=${[["", "as they were read"], ...entries]} chosen=${proposed.unit} />
    <${Choice} caption=${`${words} were read as`} name=${`${name}_read_as`} entries=${entries} chosen=${proposed.read_as} />
  </div>`;
}

// Hertz of the units of these fields.
const HERTZ = { sampling_rate_hz: 1e6, frequency_hz: 1e3 };

// What the fields of the form state.
function correctionIn(form) {
  const stated = Object.fromEntries([...new FormData(form)].filter(([, value]) => value));
  for (const what of ["times", "positions"]) if (!stated[`${what}_in`]) delete stated[`${what}_read_as`];
  for (const name of Object.keys(HERTZ)) if (stated[name]) stated[name] *= HERTZ[name];
  return stated;
}

// A copy with a correction, onMake(correction, key). proposed: corrections that the numbers of the scan suggest.
function CorrectForm({ proposed, form, error, onMake, onCancel }) {
  const [sending, setSending] = useState(false);
  const last = useRef({ body: "", key: "" });
  const proposal = (name) => proposed.find(({ what }) => what === name);
  async function make() {
    const correction = correctionIn(form.current);
    const body = JSON.stringify(correction);
    // The same again, as after an answer that was lost, makes no second copy.
    if (body !== last.current.body) last.current = { body, key: crypto.getRandomValues(new Uint32Array(4)).join("-") };
    setSending(true);
    await onMake(correction, last.current.key);
    setSending(false);
  }
  const hertz = proposal("frequency")?.frequency_hz;
  return html`<${Form} id="correct-form" class="panel edit" ref=${form} onSubmit=${make}>
    <${Facts}>If the file was read in wrong units, state the right ones. This makes a corrected copy, which is checked like an upload. The scan
      itself stays as it is, since its reconstructions were made of it.</${Facts}>
    <${UnitFields} name="times" words="Times" units=${TIMES} proposed=${proposal("times")} />
    <${Facts}>Travel times, time of the first sample, and sample interval.</${Facts}>
    <${UnitFields} name="positions" words="Lengths" units=${LENGTHS} proposed=${proposal("positions")} />
    <${Facts}>Positions of the elements, and all other lengths.</${Facts}>
    <${Field} caption="Sampling rate (MHz)" label=${{ class: "short" }} name="sampling_rate_hz" type="number" min="0.001" max="100000" step="any"
      placeholder="by the times" />
    <${Field} caption="Centre frequency (kHz)" label=${{ class: "short" }} name="frequency_hz" type="number" min="1" max="10000000" step="any"
      placeholder="as stored" defaultValue=${hertz ? 1e-3 * hertz : ""} />
    <${Field} caption="Fault in the order of the elements" label=${{ class: "short" }} name="arrangement" type="text" maxlength="80"
      placeholder="none" defaultValue=${proposal("arrangement")?.arrangement ?? ""} />
    <div class="actions">
      <button type="submit" disabled=${sending}>Make a corrected copy</button> <${Button} id="correct-cancel" onClick=${onCancel}>Cancel</${Button}>
    </div>
    <${Alert} id="correct-error" error=${error} />
  </${Form}>`;
}

function proposalInWords({ what, unit, read_as: readAs, frequency_hz: hertz, arrangement, reason }) {
  if (what === "arrangement") return `${reason}. Are ${arrangement.replaceAll("-", " ")}?`;
  if (what === "frequency") return `${reason}. Was the frequency ${1e-3 * hertz} kHz?`;
  const [words, units] = what === "times" ? ["times", TIMES] : ["lengths", LENGTHS];
  return `${reason}. Were ${words} in ${units[unit]} read as ${units[readAs]}? The form “Correct units, frequency or order” is filled in with this.`;
}

// onChange(scan) gets the record after each change; proposed: corrections that the numbers of the scan suggest; openWater: { current } that
// gets a function that opens the form at the water.
export function ScanEditor({ scan, proposed, onChange, openWater }) {
  // The field with which the open form begins, "" without one.
  const [field, setField] = useState("");
  const [deleteError, attemptDelete] = useAct();
  const [error, attempt, setError] = useAct();
  const shown = useShown();
  const [form, button] = [useRef(null), useRef(null)];
  const address = `/v1/datasets/${scan.id}`;
  useEffect(() => field && form.current.elements[field].focus(), [field]);

  function open(name) {
    setError(null);
    setField(name);
  }
  function close() {
    open("");
    button.current.focus();
  }
  openWater.current = () => open("water");
  const save = (changes) => attempt(async () => {
    onChange(await send("PATCH", address, changes));
    close();
  });
  const correct = (correction, key) => attempt(async () => {
    const made = await send("POST", `${address}/corrections`, correction, { "Idempotency-Key": key });
    if (shown.current) go(`/scans/${made.id}`);
  });
  const remove = () => deleteRecord(attemptDelete, `${titleOf(scan)} and its reconstructions`, address, "/");
  const correcting = field === "times_in";
  const opener = (id, name, expanded, words) => html`<button id=${id} type="button" class="quiet" ref=${expanded ? button : null} aria-expanded=${expanded}
    aria-controls=${`${id}-form`} onClick=${() => (expanded ? close() : open(name))}>${words}</button>`;
  const shared = { scan, form, error, onCancel: close };
  return html`<div id="scan-editor">
    <div class="links">
      ${opener("edit", "title", field !== "" && !correcting, "Edit name, notes and water")}
      ${opener("correct", "times_in", correcting, "Correct units, frequency or order")}
      <${Button} id="delete-scan" onClick=${remove}>Delete</${Button}>
    </div>
    <${Alert} id="delete-error" error=${deleteError} />
    <p id="scan-notes" class="notes" hidden=${!scan.notes}>${scan.notes}</p>
    ${field && !correcting && html`<${EditForm} ...${shared} onSave=${save} />`}
    <p id="proposed" class="notes" hidden=${!proposed.length}>${proposed.map(proposalInWords).join(" ")}</p>
    ${correcting && html`<${CorrectForm} ...${shared} proposed=${proposed} onMake=${correct} />`}
  </div>`;
}
