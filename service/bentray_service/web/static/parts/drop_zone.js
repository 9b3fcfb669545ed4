// A drop zone for files: uploads them one after the other, and shows progress and errors.
import { resumableUpload } from "./resumable_upload.js";
import { html, useEffect, useNewest, useRef, useShown, useState } from "./view.js";

const DRAGS = ["dragover", "dragleave", "drop"];
const SECTIONS = { scan: "scans", volume: "volumes", mesh: "meshes" };

// Files that are dragged anywhere on the page; onFiles(files) once they are dropped. Returns whether some are over it.
function useDrops(onFiles) {
  const [over, setOver] = useState(false);
  const newest = useNewest(onFiles);
  useEffect(() => {
    const onDrag = (event) => {
      if (!event.dataTransfer?.types.includes("Files")) return;
      event.preventDefault();
      setOver(event.type === "dragover");
      if (event.type === "drop" && event.dataTransfer.files.length) newest.current([...event.dataTransfer.files]);
    };
    for (const name of DRAGS) document.addEventListener(name, onDrag);
    return () => {
      for (const name of DRAGS) document.removeEventListener(name, onDrag);
    };
  }, []);
  return over;
}

// name: "scan", "volume" or "mesh", which begins the ids; metadataOf(file): see resumableUpload. onStored(record, several) is called after
// the last file, onRefused() when one is rejected, onBegin() when there is something to send again: by again.current().
export function DropZone({ name, accept = "", prompt, formats, again = {}, ...handlers }) {
  const { metadataOf, onStored, onRefused, onBegin } = useNewest(handlers).current;
  const [{ words, share, errors }, setState] = useState({ words: "", share: null, errors: [] });
  const change = (part) => setState((before) => ({ ...before, ...part }));
  const shown = useShown();
  const input = useRef(null);
  const last = useRef([]);

  // One after the other, so that a slow line finishes some of them first.
  async function sendAll(files) {
    last.current = files;
    onBegin?.();
    change({ errors: [] });
    const [refused, found] = [[], []];
    let stored = null;
    for (const [number, file] of files.entries()) {
      const before = files.length > 1 ? `${number + 1} of ${files.length}: ` : "";
      change({ words: `${before}Sending ${file.name}`, share: 0 });
      try {
        stored = await resumableUpload(file, metadataOf(file), (done, text) => change({ words: before + text, share: done }));
        change({ words: `${before}${file.name} is stored` });
      } catch (error) {
        found.push(error);
        refused.push(file);
      }
      // The page may be left meanwhile; the upload goes on.
      if (!shown.current) return;
    }
    input.current.value = "";
    if (refused.length) last.current = refused;
    change({ share: null, errors: found, ...(!stored && { words: "" }) });
    if (found.length) onRefused?.();
    try {
      if (stored) await onStored(stored, files.length > 1);
    } catch (error) {
      change({ errors: [error] });
    }
  }

  const over = useDrops(sendAll);
  again.current = () => last.current.length && sendAll(last.current);
  return html`
    <label id=${`${name}-drop`} class=${`drop ${over ? "over" : ""}`} for=${`${name}-file`}>
      <input id=${`${name}-file`} ref=${input} type="file" multiple accept=${accept}
        onChange=${({ target }) => target.files.length && sendAll([...target.files])} />
      <strong>${prompt}</strong> or drop it here
      <small>${formats}</small>
    </label>
    <div id=${`${name}-upload`} class="upload" hidden=${!words}>
      <span id=${`${name}-name`}>${words}</span>
      <progress id=${`${name}-bar`} max="1" value=${share ?? 0} hidden=${share === null} aria-label="Upload"></progress>
    </div>
    <p id=${`${name}-error`} class="error" role="alert" hidden=${!errors.length}>
      ${errors.map((error) => error.message).join(" · ")}
      ${errors.some((error) => error.problem) && html` <a href=${`/docs/formats#${SECTIONS[name]}`}>Accepted formats</a>`}
    </p>`;
}
