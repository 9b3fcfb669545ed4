// A drop zone for files: uploads one, and shows progress and errors.
import { at, make } from "./dom.js";
import { resumableUpload } from "./resumable_upload.js";

const SECTIONS = { scan: "scans", volume: "volumes", mesh: "meshes" };

function formatsLink(prefix) {
  const link = make("a", "", "Accepted formats");
  link.href = `/docs/formats#${SECTIONS[prefix]}`;
  return link;
}

// metadataOf(file): see resumableUpload. The drop zone replaces the element prefix-place; its data-prompt and data-formats are the texts, data-accept is that of
// the file input. An element prefix-own, if any, is opened when a file is rejected. Returns a function that sends the
// last file again.
export function uploads(prefix, metadataOf, onStored) {
  const part = (name) => at(`${prefix}-${name}`);
  const place = part("place");
  place.outerHTML = `
    <label id="${prefix}-drop" class="drop" for="${prefix}-file">
      <input id="${prefix}-file" type="file" accept="${place.dataset.accept || ""}">
      <strong>${place.dataset.prompt}</strong> or drop it here
      <small>${place.dataset.formats}</small>
    </label>
    <div id="${prefix}-upload" class="upload" hidden>
      <span id="${prefix}-name"></span>
      <progress id="${prefix}-bar" max="1" value="0" aria-label="Upload"></progress>
    </div>
    <p id="${prefix}-error" class="error" role="alert" hidden></p>`;

  let last = null;

  async function send(file) {
    last = file;
    if (part("again")) part("again").disabled = false;
    part("error").hidden = true;
    part("upload").hidden = part("bar").hidden = false;
    part("name").textContent = `Sending ${file.name}`;
    part("bar").value = 0;
    try {
      const stored = await resumableUpload(file, metadataOf(file), (share, words) => {
        // The page may be left meanwhile; the upload goes on.
        if (!part("bar")) return;
        part("bar").value = share;
        part("name").textContent = words;
      });
      if (!part("bar")) return;
      part("name").textContent = `${file.name} is stored`;
      part("bar").hidden = true;
      await onStored(stored);
    } catch (error) {
      if (!part("bar")) return;
      part("upload").hidden = true;
      part("error").textContent = error.message;
      if (error.problem) part("error").append(" ", formatsLink(prefix));
      part("error").hidden = false;
      if (part("own")) part("own").open = true;
    } finally {
      if (part("file")) part("file").value = "";
    }
  }

  const drop = part("drop");
  for (const name of ["dragenter", "dragover"]) {
    drop.addEventListener(name, (event) => {
      event.preventDefault();
      drop.classList.add("over");
    });
  }
  for (const name of ["dragleave", "drop"]) drop.addEventListener(name, () => drop.classList.remove("over"));
  drop.addEventListener("drop", (event) => {
    event.preventDefault();
    if (event.dataTransfer.files.length) send(event.dataTransfer.files[0]);
  });
  part("file").addEventListener("change", (event) => event.target.files.length && send(event.target.files[0]));
  return () => last && send(last);
}
