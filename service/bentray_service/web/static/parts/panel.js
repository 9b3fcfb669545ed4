// Parts that the pages of scans, volumes and meshes share: a list to choose from, a job to start, a record to delete.
import { inTime } from "./amounts.js";
import { request } from "./api.js";
import { at, showError } from "./dom.js";

// Offer stored records, newest first; the chosen one, else the present one, is selected.
export function fillSelect(id, records, titleOf, chosen) {
  const select = at(id);
  const before = chosen || select.value;
  if (!records.length) return;
  select.replaceChildren(...records.map((one) => new Option(`${titleOf(one)} (${inTime(one.created)})`, one.id)));
  select.disabled = false;
  if (records.some((one) => one.id === before)) select.value = before;
}

// Delete a stored record after a question; words: what goes with it. Returns whether it was deleted.
export async function deleteStored(address, words, errorId) {
  if (!confirm(`Delete ${words} for good?`)) return false;
  try {
    await request(address, { method: "DELETE" });
    return true;
  } catch (error) {
    showError(errorId, error);
    return false;
  }
}

// refused(error) may show an error elsewhere; it returns whether it did.
export async function startJob(job, errorId, onStarted, refused = () => false) {
  showError(errorId, null);
  try {
    const started = await request("/v1/jobs", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(job) });
    await onStarted(started);
  } catch (error) {
    if (!refused(error)) showError(errorId, error);
  }
}
