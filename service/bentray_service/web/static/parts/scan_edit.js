// Name, notes and water of a scan: shown, and changed in a form. The file of the scan stays as it is.
import { go } from "./address.js";
import { request } from "./api.js";
import { at, make, showError } from "./dom.js";
import { deleteStored } from "./panel.js";
import { titleOf } from "./titles.js";

const FORM = `
  <div class="links"><button id="edit" type="button" class="quiet" aria-expanded="false" aria-controls="edit-form">Edit name, notes and water</button>
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
    <p class="facts">A stored scan is in metres and seconds. If the lengths or times of its file were in other units, convert the file
      again with them stated, as in <code>bentray convert scan.mat -o scan.h5 --unit mm --unit us</code>, and upload the result.</p>
    <div class="actions"><button type="submit">Save</button> <button id="edit-cancel" type="button" class="quiet">Cancel</button></div>
    <p id="edit-error" class="error" role="alert" hidden></p>
  </form>`;

const WATER = "Empty: as in the file. A temperature replaces it in the views of this page and in reconstructions that are started later; "
  + "each of their results states both. The file is not changed.";

// Show a scan in a place; onChange(scan) gets the record after each change. Returns openWater(), which opens the form at the water.
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
  return () => toggle(true, water);
}

// A button beside the fact "Water" that opens the form.
export function correctButton(onClick) {
  const button = make("button", "quiet", "Correct");
  button.type = "button";
  button.setAttribute("aria-label", "Correct the water temperature");
  button.addEventListener("click", onClick);
  return button;
}
