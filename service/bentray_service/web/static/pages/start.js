// Start: upload a scan, and the list of scans.
import { go, keepQuery, pick } from "../parts/address.js";
import { inTime } from "../parts/amounts.js";
import { request, send } from "../parts/api.js";
import { DropZone } from "../parts/drop_zone.js";
import { Filters, ListPages, olderOf } from "../parts/lists.js";
import { titleOf } from "../parts/titles.js";
import { Alert, Button, Facts, Form, html, Labelled, Options, useAct, useAsked, useEffect, useRef, useShown, useState } from "../parts/view.js";

// Scans on one page of the list.
const PAGE_LENGTH = 25;
const ACCEPT = ".h5,.hdf5,.mat,.npz,.zip,application/x-hdf5";
const FORMATS = "HDF5 (uct-transmission, zea, openUSCT), MATLAB, NumPy, zip of k-Wave or KIT 3D USCT";

// A scan that is simulated within seconds, with traces, so that both Fast and Best apply.
const SAMPLE = {
  kind: "simulation",
  settings: { phantom: "table6", waveform: true, nodes: 64, elements: 64, emissions: 32, frequency_hz: 300000, side_m: 0.06, snr: 30 },
};

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
  return html`<section aria-labelledby="scan-title" class="panel">
    <h2 id="scan-title">Upload a scan</h2>
    <${DropZone} name="scan" accept=${ACCEPT} prompt="Choose a file" formats=${FORMATS} again=${again}
      metadataOf=${() => metadataIn(form.current)} onStored=${(scan, several) => (several ? onSeveral() : go(`/scans/${scan.id}`))}
      onBegin=${() => setState(([open]) => [open, true])} onRefused=${() => setState([true, true])} />
    <details id="scan-own" open=${opened} onToggle=${({ target }) => setState([target.open, begun])}>
      <summary>Own variables, units, water</summary>
      <${Form} id="own" ref=${form} onSubmit=${() => again.current()}>
        <${Labelled} caption="Variables, FIELD=NAME">
          <input name="map" type="text" spellcheck="false" placeholder="element_position=pos, delta_tof=dtof" />
        </${Labelled}>
        <div class="numbers">
          <${Labelled} caption="Lengths">
            <select name="unit"><${Options} entries=${[["", "m"], "mm", "cm", ["um", "µm"]]} /></select>
          </${Labelled}>
          <${Labelled} caption="Times">
            <select name="unit"><${Options} entries=${[["", "s"], ["us", "µs"], "ms", "ns"]} /></select>
          </${Labelled}>
          <${Labelled} caption="Water, °C"><input name="temperature_c" type="number" step="any" /></${Labelled}>
          <${Labelled} caption="Frequency, Hz"><input name="frequency_hz" type="number" step="any" /></${Labelled}>
        </div>
        <button id="scan-again" type="submit" class="quiet" disabled=${!begun}>Send the file again</button>
      </${Form}>
    </details>
  </section>`;
}

function Sample() {
  const [error, act] = useAct();
  const shown = useShown();
  const simulate = () => act(async () => {
    const job = await send("POST", "/v1/jobs", SAMPLE);
    if (shown.current) go(`/jobs/${job.id}?then=scan`);
  });
  return html`<section aria-labelledby="sample-title" class="panel">
    <h2 id="sample-title">No scan at hand?</h2>
    <p>Simulate a small scan of a 2-D breast phantom, with traces and the truth to compare with. It takes some seconds.</p>
    <${Button} id="sample" quiet=${false} onClick=${simulate}>Simulate a sample scan</${Button}>
    <${Alert} id="sample-error" error=${error} />
  </section>`;
}

// changes: a number that grows when the list is to be read again.
function Scans({ first, changes }) {
  const [query, setQuery] = useState(first);
  const [found, error, ask] = useAsked();
  useEffect(() => ask(async () => {
    const answer = await request(`/v1/datasets?${new URLSearchParams([...query, ["limit", PAGE_LENGTH]])}`);
    return { ...answer, query };
  }), [query, changes]);
  const search = (changed) => {
    keepQuery(changed);
    setQuery(changed);
  };
  const scans = found?.datasets ?? [];
  const none = found?.query.has("text") ? "No scan has this text." : "No scan yet. Upload one, or simulate a sample.";
  return html`<section aria-labelledby="scans-title">
    <h2 id="scans-title">Stored scans</h2>
    <${Alert} id="scans-error" error=${error} />
    <${Filters} label="Scans" id="scan-filter" hidden=${!scans.length && !query.size} onChange=${search}>
      <${Labelled} caption="Name, notes or id">
        <input name="text" type="search" maxlength="200" autocomplete="off" defaultValue=${first.get("text") ?? ""} />
      </${Labelled}>
    </${Filters}>
    <p id="several" class="links" hidden=${scans.length < 2}><a class="button" href="#/batch">Reconstruct several scans</a></p>
    <p id="empty" class="empty" role="status" hidden=${!found || scans.length > 0}>${found && !scans.length && none}</p>
    <ul id="scans" class="records">
      ${scans.map((scan) => html`<li key=${scan.id}>
        <a href=${`#/scans/${scan.id}`}>${titleOf(scan)}</a>
        <${Facts}>${scan.ntx} emitters × ${scan.nrx} receivers · ${inTime(scan.created)}</${Facts}>
      </li>`)}
    </ul>
    ${found && html`<${ListPages} id="scan-pages" path="/" query=${found.query} older=${olderOf(found.next)} words="scans" />`}
  </section>`;
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
