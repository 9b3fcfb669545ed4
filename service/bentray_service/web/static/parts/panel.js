// Parts that the panels of datasets, volumes and meshes share: a list to choose from, an image, and a job to start.
import { inTime } from "./amounts.js";
import { request } from "./api.js";
import { at, showError } from "./dom.js";
import { show } from "./key.js";

// Offer stored records, newest first; the chosen one, else the present one, is selected.
export function fillSelect(id, records, titleOf, chosen) {
  const select = at(id);
  const before = chosen || select.value;
  if (!records.length) return;
  select.replaceChildren(...records.map((one) => new Option(`${titleOf(one)} (${inTime(one.created)})`, one.id)));
  select.disabled = false;
  if (records.some((one) => one.id === before)) select.value = before;
}

// A frame for one image at a time; an address that is drawn already is not drawn again.
export function imageFrame(id, errorId) {
  let shown = "";
  const finish = (content) => {
    if (!at(id)) return;
    at(id).replaceChildren(content);
    at(id).className = "picture";
  };
  return {
    clear(text) {
      shown = "";
      finish(text);
    },
    draw(address, alt) {
      if (address === shown) return;
      shown = address;
      showError(errorId, null);
      const image = new Image();
      image.alt = alt;
      at(id).className = "picture drawing";
      image.onload = () => address === shown && finish(image);
      image.onerror = () => {
        if (address !== shown) return;
        shown = "";
        finish("No image");
        // The reason is in the body of the response, which an image does not give access to.
        request(address).catch((error) => showError(errorId, error));
      };
      show(image, address);
    },
  };
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
