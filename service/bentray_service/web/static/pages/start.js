// Start: upload a scan, and the list of scans.
import { inTime } from "../parts/amounts.js";
import { at, make, showError } from "../parts/dom.js";
import { go, keepQuery } from "../parts/address.js";
import { request } from "../parts/api.js";
import { titleOf } from "../parts/titles.js";
import { startJob } from "../parts/panel.js";
import { uploads } from "../parts/uploads.js";

const PAGE = `
  <h1>Scans</h1>
  <section aria-labelledby="scan-title" class="panel">
    <h2 id="scan-title">Upload a scan</h2>
    <div id="scan-place" data-accept=".h5,.hdf5,.mat,.npz,.zip,application/x-hdf5" data-prompt="Choose a file" data-formats="HDF5 (uct-transmission, zea, openUSCT), MATLAB, NumPy, zip of k-Wave or KIT 3D USCT"></div>
    <details id="scan-own">
      <summary>Own variables, units, water</summary>
      <form id="own">
        <label><span class="caption">Variables, FIELD=NAME</span>
          <input name="map" type="text" spellcheck="false" placeholder="element_position=pos, delta_tof=dtof"></label>
        <div class="numbers">
          <label><span class="caption">Lengths</span>
            <select name="unit"><option value="">m</option><option>mm</option><option>cm</option><option value="um">µm</option></select></label>
          <label><span class="caption">Times</span>
            <select name="unit"><option value="">s</option><option value="us">µs</option><option>ms</option><option>ns</option></select></label>
          <label><span class="caption">Water, °C</span>
            <input name="temperature_c" type="number" step="any"></label>
          <label><span class="caption">Frequency, Hz</span>
            <input name="frequency_hz" type="number" step="any"></label>
        </div>
        <button id="scan-again" type="submit" class="quiet" disabled>Send the file again</button>
      </form>
    </details>
  </section>
  <section aria-labelledby="sample-title" class="panel">
    <h2 id="sample-title">No scan at hand?</h2>
    <p>Simulate a small scan of a 2-D breast phantom, with traces and the truth to compare with. It takes some seconds.</p>
    <button id="sample" type="button">Simulate a sample scan</button>
    <p id="sample-error" class="error" role="alert" hidden></p>
  </section>
  <section aria-labelledby="scans-title">
    <h2 id="scans-title">Stored scans</h2>
    <p id="scans-error" class="error" role="alert" hidden></p>
    <form id="scan-filter" class="filters" role="search" aria-label="Scans" hidden>
      <label><span class="caption">Name, notes or id</span>
        <input name="text" type="search" maxlength="200" autocomplete="off"></label>
    </form>
    <p id="several" class="links" hidden><a class="button" href="#/batch">Reconstruct several scans</a></p>
    <p id="empty" class="empty" role="status" hidden></p>
    <ul id="scans" class="records"></ul>
    <nav id="scan-pages" class="pages" aria-label="Pages of the list"></nav>
  </section>`;

const NONE = "No scan yet. Upload one, or simulate a sample.";
// Scans on one page of the list, and the pause in typing after which they are searched.
const PAGE_LENGTH = 25;
const TYPING_MS = 300;

// A scan that is simulated within seconds, with traces, so that both Fast and Best apply.
const SAMPLE = {
  kind: "simulation",
  settings: { phantom: "table6", waveform: true, nodes: 64, elements: 64, emissions: 32, frequency_hz: 300000, side_m: 0.06, snr: 30 },
};

// What the form states about a file of another program.
function metadata() {
  const stated = { kind: "dataset" };
  for (const [name, value] of new FormData(at("own"))) {
    const words = value.split(",").map((one) => one.trim()).filter(Boolean);
    if (words.length) stated[name] = [stated[name], ...words].filter(Boolean).join(",");
  }
  return stated;
}

function entry(scan) {
  const item = make("li");
  const link = make("a", "", titleOf(scan));
  link.href = `#/scans/${scan.id}`;
  const words = `${scan.ntx} emitters × ${scan.nrx} receivers · ${inTime(scan.created)}`;
  item.append(link, make("p", "facts", words));
  return item;
}

function pageLink(text, query, more) {
  const address = new URLSearchParams(query);
  address.delete("before");
  if (more) address.set("before", more);
  const anchor = make("a", "button", text);
  anchor.href = `#/${address.size ? `?${address}` : ""}`;
  return anchor;
}

export function open(root, { query }) {
  root.innerHTML = PAGE;
  let closed = false;
  let asked = new URLSearchParams([...query].filter(([name]) => ["text", "before"].includes(name)));
  const filter = at("scan-filter");
  const field = filter.elements.text;
  field.value = asked.get("text") ?? "";
  const sendAgain = uploads("scan", metadata, (scan, several) => closed || (several ? showScans() : go(`/scans/${scan.id}`)));
  at("sample").addEventListener("click", () => startJob(SAMPLE, "sample-error", (job) => closed || go(`/jobs/${job.id}?then=scan`)));
  at("own").addEventListener("submit", (event) => {
    event.preventDefault();
    sendAgain();
  });

  function showScans() {
    const mine = asked;
    request(`/v1/datasets?${new URLSearchParams([...mine, ["limit", PAGE_LENGTH]])}`)
      .then(({ datasets, next }) => {
        // The text may have been changed in the meantime.
        if (closed || mine !== asked) return;
        showError("scans-error", null);
        at("scans").replaceChildren(...datasets.map(entry));
        at("empty").textContent = datasets.length ? "" : mine.has("text") ? "No scan has this text." : NONE;
        at("empty").hidden = datasets.length > 0;
        at("several").hidden = datasets.length < 2;
        filter.hidden = !datasets.length && !mine.size;
        const older = next && new URLSearchParams(next.split("?")[1]).get("before");
        const links = [mine.has("before") && pageLink("Newest scans", mine, ""), older && pageLink("Older scans", mine, older)];
        at("scan-pages").replaceChildren(...links.filter(Boolean));
      })
      .catch((error) => showError("scans-error", error));
  }

  let timer = 0;
  const find = (wait) => {
    clearTimeout(timer);
    timer = setTimeout(() => {
      const text = field.value.trim();
      asked = new URLSearchParams(text ? { text } : {});
      keepQuery(asked);
      showScans();
    }, wait);
  };
  field.addEventListener("input", () => find(TYPING_MS));
  filter.addEventListener("submit", (event) => {
    event.preventDefault();
    find(0);
  });

  showScans();
  return () => {
    closed = true;
    clearTimeout(timer);
  };
}
