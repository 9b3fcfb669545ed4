// Name, notes and water of a scan: shown, and changed in a form; a corrected copy of a scan in wrong units. Its file stays as it is.
import { go } from "../parts/address.js";
import { request } from "../parts/api.js";
import { at, make, showError } from "../parts/dom.js";
import { deleteStored } from "../parts/panel.js";
import { titleOf } from "../parts/titles.js";

const TIMES = { s: "s", ms: "ms", us: "µs", ns: "ns" };
const LENGTHS = { m: "m", cm: "cm", mm: "mm", um: "µm" };

// Two units: that of the original file, and the one in which it was read.
function unitFields(name, words, units, si) {
  const options = (chosen) => Object.entries(units).map(([unit, shown]) => `<option value="${unit}"${unit === chosen ? " selected" : ""}>${shown}</option>`).join("");
  return `<div class="units">
    <label><span class="caption">${words} in the original file</span>
      <select name="${name}_in"><option value="" selected>as they were read</option>${options()}</select></label>
    <label><span class="caption">${words} were read as</span>
      <select name="${name}_read_as">${options(si)}</select></label></div>`;
}

const FORM = `
  <div class="links"><button id="edit" type="button" class="quiet" aria-expanded="false" aria-controls="edit-form">Edit name, notes and water</button>
    <button id="correct" type="button" class="quiet" aria-expanded="false" aria-controls="correct-form">Correct units, frequency or order</button>
    <button id="delete-scan" type="button" class="quiet">Delete</button></div>
  <p id="delete-error" class="error" role="alert" hidden></p>
  <p id="scan-notes" class="notes" hidden></p>
  <form id="edit-form" class="panel edit" hidden>
    <label><span class="caption">Name</span>
      <input name="title" type="text" maxlength="200" aria-describedby="edit-title-words"></label>
    <p id="edit-title-words" class="facts">Empty: the title in the file.</p>
    <label><span class="caption">Notes</span>
      <textarea name="notes" maxlength="4000" rows="3"></textarea></label>
    <label class="short"><span class="caption">Water temperature (°C)</span>
      <input name="water" type="number" min="0" max="95" step="any" placeholder="as in the file" aria-describedby="edit-water-words"></label>
    <p id="edit-water-words" class="facts"></p>
    <div class="actions"><button type="submit">Save</button> <button id="edit-cancel" type="button" class="quiet">Cancel</button></div>
    <p id="edit-error" class="error" role="alert" hidden></p>
  </form>
  <p id="proposed" class="notes" hidden></p>
  <form id="correct-form" class="panel edit" hidden>
    <p class="facts">If the file was read in wrong units, state the right ones. This makes a corrected copy, which is checked like an upload. The scan
      itself stays as it is, since its reconstructions were made of it.</p>
    ${unitFields("times", "Times", TIMES, "s")}
    <p class="facts">Travel times, time of the first sample, and sample interval.</p>
    ${unitFields("positions", "Lengths", LENGTHS, "m")}
    <p class="facts">Positions of the elements, and all other lengths.</p>
    <label class="short"><span class="caption">Sampling rate (MHz)</span>
      <input name="sampling" type="number" min="0.001" max="100000" step="any" placeholder="by the times"></label>
    <label class="short"><span class="caption">Centre frequency (kHz)</span>
      <input name="frequency" type="number" min="1" max="10000000" step="any" placeholder="as stored"></label>
    <label class="short"><span class="caption">Fault in the order of the elements</span>
      <input name="arrangement" type="text" maxlength="80" placeholder="none"></label>
    <div class="actions"><button type="submit">Make a corrected copy</button> <button id="correct-cancel" type="button" class="quiet">Cancel</button></div>
    <p id="correct-error" class="error" role="alert" hidden></p>
  </form>`;

const WATER = "Empty: as in the file. A temperature replaces it in the views of this page and in reconstructions that are started later; "
  + "each of their results states both. The file is not changed.";

// Show a scan in a place; onChange(scan) gets the record after each change. Returns openWater(), which opens the form at the water, and
// propose(corrections), which shows what the numbers of the scan suggest.
export function scanEditor(place, scan, onChange) {
  place.innerHTML = FORM;
  const [form, button] = [at("edit-form"), at("edit")];
  const { title, notes, water } = form.elements;
  at("edit-water-words").textContent = WATER;
  let shown = scan;

  function showNotes() {
    at("scan-notes").textContent = shown.notes;
    at("scan-notes").hidden = !shown.notes;
  }

  function toggle(open, field = title) {
    form.hidden = !open;
    button.setAttribute("aria-expanded", open);
    if (!open) return;
    title.value = shown.title;
    notes.value = shown.notes;
    water.value = shown.water_temperature_c ?? "";
    showError("edit-error", null);
    field.focus();
  }

  button.addEventListener("click", () => toggle(form.hidden));
  at("delete-scan").addEventListener("click", async () => {
    if (await deleteStored(`/v1/datasets/${scan.id}`, `${titleOf(shown)} and its reconstructions`, "delete-error")) go("/");
  });
  at("edit-cancel").addEventListener("click", () => {
    toggle(false);
    button.focus();
  });
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const changes = { notes: notes.value, water_temperature_c: water.value === "" ? null : Number(water.value) };
    // An unchanged name is not made one of the user.
    if (title.value.trim() !== shown.title) changes.title = title.value.trim();
    try {
      const headers = { "Content-Type": "application/json" };
      shown = await request(`/v1/datasets/${scan.id}`, { method: "PATCH", headers, body: JSON.stringify(changes) });
      if (!place.isConnected) return;
      showNotes();
      toggle(false);
      button.focus();
      onChange(shown);
    } catch (error) {
      showError("edit-error", error);
    }
  });
  showNotes();
  return { openWater: () => toggle(true, water), propose: corrector(scan) };
}

// The form of a corrected copy, which then opens.
function corrector(scan) {
  const [form, button] = [at("correct-form"), at("correct")];
  const fields = form.elements;
  let [sent, key] = ["", ""];

  function toggle(open) {
    form.hidden = !open;
    button.setAttribute("aria-expanded", open);
    showError("correct-error", null);
    (open ? fields.times_in : button).focus();
  }

  button.addEventListener("click", () => toggle(form.hidden));
  at("correct-cancel").addEventListener("click", () => toggle(false));
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const correction = {};
    for (const what of ["times", "positions"]) {
      if (!fields[`${what}_in`].value) continue;
      for (const name of [`${what}_in`, `${what}_read_as`]) correction[name] = fields[name].value;
    }
    if (fields.sampling.value) correction.sampling_rate_hz = 1e6 * fields.sampling.value;
    if (fields.frequency.value) correction.frequency_hz = 1e3 * fields.frequency.value;
    if (fields.arrangement.value) correction.arrangement = fields.arrangement.value;
    const submit = form.querySelector("[type=submit]");
    submit.disabled = true;
    const body = JSON.stringify(correction);
    // The same again, as after an answer that was lost, makes no second copy.
    if (body !== sent) [sent, key] = [body, crypto.getRandomValues(new Uint32Array(4)).join("-")];
    try {
      const headers = { "Content-Type": "application/json", "Idempotency-Key": key };
      const made = await request(`/v1/datasets/${scan.id}/corrections`, { method: "POST", headers, body });
      if (form.isConnected) go(`/scans/${made.id}`);
    } catch (error) {
      submit.disabled = false;
      showError("correct-error", error);
    }
  });
  return (corrections) => {
    at("proposed").hidden = !corrections.length;
    at("proposed").textContent = corrections.map(proposalInWords).join(" ");
    for (const { what, unit, read_as: readAs, frequency_hz: hertz, arrangement } of corrections) {
      if (what === "frequency") fields.frequency.value = 1e-3 * hertz;
      else if (what === "arrangement") fields.arrangement.value = arrangement;
      else [fields[`${what}_in`].value, fields[`${what}_read_as`].value] = [unit, readAs];
    }
  };
}

function proposalInWords({ what, unit, read_as: readAs, frequency_hz: hertz, arrangement, reason }) {
  if (what === "arrangement") return `${reason}. Are ${arrangement.replaceAll("-", " ")}?`;
  if (what === "frequency") return `${reason}. Was the frequency ${1e-3 * hertz} kHz?`;
  const [words, units] = what === "times" ? ["times", TIMES] : ["lengths", LENGTHS];
  return `${reason}. Were ${words} in ${units[unit]} read as ${units[readAs]}? The form “Correct units, frequency or order” is filled in with this.`;
}

// A button beside the fact "Water" that opens the form.
export function correctButton(onClick) {
  const button = make("button", "quiet", "Correct");
  button.type = "button";
  button.setAttribute("aria-label", "Correct the water temperature");
  button.addEventListener("click", onClick);
  return button;
}
