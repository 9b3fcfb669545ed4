// Start: upload a scan, and the list of scans.
import { go, keepQuery, pick } from "../parts/address.js";
import { description, request, send } from "../parts/api.js";
import { DropZone } from "../parts/drop_zone.js";
import { Filters, ListPages, olderOf, Renamable, Thumbnail, titleOf } from "../parts/lists.js";
import { Alert, Button, Choice, Facts, Field, Form, html, Section, useAct, useRead, useRef, useShown, useState } from "../parts/view.js";
import { inTime } from "../parts/words.js";

// Scans on one page of the list.
const PAGE_LENGTH = 25;
const ACCEPT = ".h5,.hdf5,.mat,.npz,.zip,application/x-hdf5,.npy,.nrrd,.nii,.nii.gz,.ply,.obj,.off,.stl,.gltf,.glb";
const FORMATS = "HDF5 (uct-transmission, zea, openUSCT), MATLAB, NumPy, zip of k-Wave or KIT 3D USCT; volumes and meshes open on their own pages";

// What the form states about a file of another program.
function metadataIn(form) {
  const stated = { kind: "dataset" };
  for (const [name, value] of new FormData(form)) {
    const words = value.split(",").map((word) => word.trim()).filter(Boolean);
    if (words.length) stated[name] = [stated[name], ...words].filter(Boolean).join(",");
  }
  return stated;
}

function Upload({ onSeveral }) {
  const [[opened, begun], setState] = useState([false, false]);
  const [form, again] = [useRef(null), useRef(null)];
  return html`<${Section} id="scan" title="Upload a scan">
    <${DropZone} name="scan" accept=${ACCEPT} prompt="Choose a file" formats=${FORMATS} again=${again}
      metadataOf=${() => metadataIn(form.current)} onStored=${(scan, several) => (several ? onSeveral() : go(`/scans/${scan.id}`))}
      onBegin=${() => setState(([open]) => [open, true])} onRefused=${() => setState([true, true])} />
    <details id="scan-own" open=${opened} onToggle=${({ target }) => setState([target.open, begun])}>
      <summary>Own variables, units, water</summary>
      <${Form} id="own" ref=${form} onSubmit=${() => again.current()}>
        <${Field} caption="Variables, FIELD=NAME" name="map" type="text" spellcheck="false" placeholder="element_position=pos, delta_tof=dtof" />
        <div class="numbers">
          <${Choice} caption="Lengths" name="unit" entries=${[["", "m"], "mm", "cm", ["um", "µm"]]} />
          <${Choice} caption="Times" name="unit" entries=${[["", "s"], ["us", "µs"], "ms", "ns"]} />
          <${Field} caption="Water, °C" name="temperature_c" type="number" step="any" />
          <${Field} caption="Frequency, Hz" name="frequency_hz" type="number" step="any" />
        </div>
        <button id="scan-again" type="submit" class="quiet" disabled=${!begun}>Send the file again</button>
      </${Form}>
    </details>
  </${Section}>`;
}

function Sample() {
  const [error, act] = useAct();
  const shown = useShown();
  const simulate = () => act(async () => {
    // The service describes it, as the example of a simulation.
    const { examples } = (await description()).paths["/v1/jobs"].post.requestBody.content["application/json"];
    const job = await send("POST", "/v1/jobs", examples.simulation.value);
    if (shown.current) go(`/jobs/${job.id}?then=scan`);
  });
  return html`<${Section} id="sample" title="No scan at hand?">
    <p>Simulate traces of a 2-D breast with skin, fat, glandular tissue and four lesions, and the truth to compare with.</p>
    <${Button} id="sample" quiet=${false} onClick=${simulate}>Simulate a sample scan</${Button}>
    <${Alert} id="sample-error" error=${error} />
  </${Section}>`;
}

// changes: a number that grows when the list is to be read again.
function Scans({ first, changes }) {
  const [query, setQuery] = useState(first);
  const [found, error, refresh] = useRead(async () => {
    const answer = await request(`/v1/datasets?${new URLSearchParams([...query, ["limit", PAGE_LENGTH]])}`);
    return { ...answer, query };
  }, { key: `${query} ${changes}`, settle: 0 });
  const search = (changed) => {
    keepQuery(changed);
    setQuery(changed);
  };
  const scans = found?.datasets ?? [];
  const none = found?.query.has("text") ? "No scan has this text." : "No scan yet. Upload one, or simulate a sample.";
  return html`<${Section} id="scans" title="Stored scans" className="">
    <${Alert} id="scans-error" error=${error} />
    <${Filters} label="Scans" id="scan-filter" hidden=${!scans.length && !query.size} onChange=${search}>
      <${Field} caption="Name, notes or id" name="text" type="search" maxlength="200" defaultValue=${first.get("text") ?? ""} />
    </${Filters}>
    <p id="several" class="links" hidden=${scans.length < 2}><a class="button" href="#/batch">Reconstruct several scans</a></p>
    <p id="empty" class="empty" role="status" hidden=${!found || scans.length > 0}>${found && !scans.length && none}</p>
    <ul id="scans" class="records">
      ${scans.map((scan) => html`<li key=${scan.id}>
        <${Thumbnail} record=${scan} />
        <div>
          <${Renamable} record=${scan} field="title" name=${scan.title} onRename=${refresh}><a href=${`#/scans/${scan.id}`}>${titleOf(scan)}</a></${Renamable}>
          <${Facts}>${scan.ntx} emitters × ${scan.nrx} receivers · ${inTime(scan.created)}</${Facts}>
        </div>
      </li>`)}
    </ul>
    ${found && html`<${ListPages} id="scan-pages" path="/" query=${found.query} older=${olderOf(found.next)} words="scans" />`}
  </${Section}>`;
}

function Start({ query }) {
  const [changes, setChanges] = useState(0);
  return html`
    <h1>Scans</h1>
    <${Upload} onSeveral=${() => setChanges((count) => count + 1)} />
    <${Sample} />
    <${Scans} first=${pick(query, ["text", "before"])} changes=${changes} />`;
}

export const open = ({ query }) => html`<${Start} query=${query} />`;
