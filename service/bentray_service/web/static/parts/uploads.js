// A drop zone for files: uploads them one after the other, and shows progress and errors.
import { at, make } from "./dom.js";
import { resumableUpload } from "./resumable_upload.js";

const DRAGS = ["dragover", "dragleave", "drop"];
const SECTIONS = { scan: "scans", volume: "volumes", mesh: "meshes" };

function formatsLink(prefix) {
  const link = make("a", "", "Accepted formats");
  link.href = `/docs/formats#${SECTIONS[prefix]}`;
  return link;
}

// metadataOf(file): see resumableUpload. The drop zone replaces the element prefix-place; its data-prompt and data-formats are
// the texts, data-accept is that of the file input. Files may be dropped anywhere on the page. onStored(record, several) is
// called after the last one. An element prefix-own, if any, is opened when a file is rejected. Returns a function that sends
// the rejected files again.
export function uploads(prefix, metadataOf, onStored) {
  const part = (name) => at(`${prefix}-${name}`);
  const place = part("place");
  place.outerHTML = `
    <label id="${prefix}-drop" class="drop" for="${prefix}-file">
      <input id="${prefix}-file" type="file" multiple accept="${place.dataset.accept || ""}">
      <strong>${place.dataset.prompt}</strong> or drop it here
      <small>${place.dataset.formats}</small>
    </label>
    <div id="${prefix}-upload" class="upload" hidden>
      <span id="${prefix}-name"></span>
      <progress id="${prefix}-bar" max="1" value="0" aria-label="Upload"></progress>
    </div>
    <p id="${prefix}-error" class="error" role="alert" hidden></p>`;

  let last = [];

  // Sends a file and returns its record; words(text) says where it stands.
  function send(file, words) {
    part("upload").hidden = part("bar").hidden = false;
    part("bar").value = 0;
    words(`Sending ${file.name}`);
    return resumableUpload(file, metadataOf(file), (share, text) => {
      // The page may be left meanwhile; the upload goes on.
      if (!part("bar")) return;
      part("bar").value = share;
      words(text);
    });
  }

  function refuse(errors) {
    const shown = part("error");
    shown.textContent = errors.map((error) => error.message).join(" · ");
    if (errors.some((error) => error.problem)) shown.append(" ", formatsLink(prefix));
    shown.hidden = !errors.length;
    if (errors.length && part("own")) part("own").open = true;
  }

  // One after the other, so that a slow line finishes some of them first.
  async function sendAll(files) {
    last = files;
    if (part("again")) part("again").disabled = false;
    refuse([]);
    const errors = [];
    const refused = [];
    let stored = null;
    for (const [number, file] of files.entries()) {
      const before = files.length > 1 ? `${number + 1} of ${files.length}: ` : "";
      const words = (text) => {
        part("name").textContent = before + text;
      };
      try {
        stored = await send(file, words);
        if (!part("bar")) return;
        words(`${file.name} is stored`);
      } catch (error) {
        if (!part("bar")) return;
        errors.push(error);
        refused.push(file);
      }
    }
    part("bar").hidden = true;
    part("upload").hidden = !stored;
    part("file").value = "";
    if (refused.length) last = refused;
    refuse(errors);
    if (!stored) return;
    try {
      await onStored(stored, files.length > 1);
    } catch (error) {
      refuse([error]);
    }
  }

  const drop = part("drop");

  function onDrag(event) {
    if (!drop.isConnected) {
      for (const name of DRAGS) document.removeEventListener(name, onDrag);
      return;
    }
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    drop.classList.toggle("over", event.type === "dragover");
    if (event.type === "drop" && event.dataTransfer.files.length) sendAll([...event.dataTransfer.files]);
  }

  for (const name of DRAGS) document.addEventListener(name, onDrag);
  part("file").addEventListener("change", (event) => event.target.files.length && sendAll([...event.target.files]));
  return () => last.length && sendAll(last);
}
