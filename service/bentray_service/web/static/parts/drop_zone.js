// A drop zone for files: uploads them one after the other as what they are, and shows progress and errors.
import { go } from "./address.js";
import { resumableUpload } from "./resumable_upload.js";
import { html, useEffect, useNewest, useRef, useShown, useState } from "./view.js";

const DRAGS = ["dragover", "dragleave", "drop"];
// What is stored: its name, its section of the formats, its page, and the names and first bytes of its files.
const KINDS = {
  dataset: { noun: "a scan", section: "scans", path: "/scans", names: /\.mat$/i, starts: /^(\x89HDF|PK|MATLAB)/ },
  volume: {
    noun: "a volume", section: "volumes", path: "/rendering", names: /\.(npy|nrrd|nii|nii\.gz)$/i,
    starts: /^(\x89HDF|PK|\x93NUMPY|NRRD|\x1f\x8b|[^]{344}n\+1|[^]{4}n\+2)/,
  },
  mesh: { noun: "a mesh", section: "meshes", path: "/surfaces", names: /\.(ply|obj|off|stl|gltf|glb)$/i, starts: /^(ply|C?N?OFF|glTF|solid)\b/ },
};
const START_BYTES = 400;

// The kinds that a file may be of, by its name, else by its first bytes, those of its page first; none for an unknown file.
async function kindsOf(file, own) {
  const all = Object.keys(KINDS).sort((a, b) => (b === own) - (a === own));
  const named = all.filter((kind) => KINDS[kind].names.test(file.name));
  if (named.length) return named;
  const start = String.fromCharCode(...new Uint8Array(await file.slice(0, START_BYTES).arrayBuffer()));
  return all.filter((kind) => KINDS[kind].starts.test(start));
}

// Stores a file: { kind, record }. metadata: of a file of the kind that it states.
async function store(file, metadata, onProgress) {
  if (!file.size) throw new Error(`${file.name} is empty.`);
  const kinds = await kindsOf(file, metadata.kind);
  let refusal = null;
  for (const kind of kinds.length ? kinds : [metadata.kind]) {
    try {
      return { kind, record: await resumableUpload(file, kind === metadata.kind ? metadata : { kind }, onProgress) };
    } catch (error) {
      if (!error.problem) throw error;
      refusal ??= error;
    }
  }
  const noun = kinds.length === 1 ? KINDS[kinds[0]].noun : "a scan, a volume or a mesh";
  throw Object.assign(new Error(`${file.name} is not ${noun} that can be read. ${refusal.message}`), { problem: refusal.problem });
}

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
// the last file, onRefused() when one is rejected, onBegin() when there is something to send again: by again.current(). A file of another kind
// is stored, too, and its page opened if there is none of this kind, and no error to read.
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
    let [stored, elsewhere] = [null, null];
    for (const [number, file] of files.entries()) {
      const before = files.length > 1 ? `${number + 1} of ${files.length}: ` : "";
      change({ words: `${before}Sending ${file.name}`, share: 0 });
      try {
        const metadata = metadataOf(file);
        const { kind, record } = await store(file, metadata, (done, text) => change({ words: before + text, share: done }));
        if (kind === metadata.kind) stored = record;
        else elsewhere = `${KINDS[kind].path}/${record.id}`;
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
    change({ share: null, errors: found, ...(!stored && !elsewhere && { words: "" }) });
    if (found.length) onRefused?.();
    try {
      if (stored) await onStored(stored, files.length > 1);
      else if (elsewhere && !found.length) go(elsewhere);
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
      ${errors.some((error) => error.problem) && html` <a href=${`/docs/formats#${KINDS[name === "scan" ? "dataset" : name].section}`}>Accepted formats</a>`}
    </p>`;
}
