// Volume rendering: upload a volume, render it with refraction, and start a turntable.
import { go } from "../parts/address.js";
import { fillDefaults } from "../parts/defaults.js";
import { at, showError } from "../parts/dom.js";
import { jobList } from "../parts/job_list.js";
import { fillSelect, imageFrame, startJob } from "../parts/panel.js";
import { load, titleOf } from "../parts/titles.js";
import { uploads } from "../parts/uploads.js";
import { glassOf, queryOf } from "../parts/views.js";

const PAGE = `
  <h1>Volume rendering</h1>
  <section aria-label="Volume rendering" class="panel glass">
    <div>
      <div id="volume-place" data-prompt="Choose a volume" data-formats="NumPy, NRRD, NIfTI or HDF5 of Bentray"></div>
      <label for="volume" class="caption">Volume to render</label>
      <select id="volume" disabled><option value="">No 3-D volume yet</option></select>
      <p id="volume-facts" class="facts"></p>
      <form id="look">
        <div class="numbers">
          <label><span class="caption">Iso-value</span>
            <input name="iso" type="number" step="any" placeholder="the middle"></label>
          <label><span class="caption">Refractive index</span>
            <input name="index" type="number" min="0.01" max="100" step="any" placeholder="1.5"></label>
          <label><span class="caption">Azimuth, degrees</span>
            <input name="azimuth_deg" type="number" min="-36000" max="36000" step="any" required></label>
          <label><span class="caption">Elevation, degrees</span>
            <input name="elevation_deg" type="number" min="-90" max="90" step="any" required></label>
          <label><span class="caption">Frames per turn</span>
            <input name="frames" type="number" min="1" max="720" required></label>
        </div>
        <button id="turn" type="submit" disabled>Render a turntable</button>
        <p id="look-error" class="error" role="alert" hidden></p>
      </form>
    </div>
    <div id="glass" class="picture">The image appears here</div>
  </section>
  <section aria-labelledby="jobs-title" id="turntables">
    <h2 id="jobs-title">Turntables</h2>
  </section>`;

export async function open(root, { id }) {
  root.innerHTML = PAGE;
  document.title = "Volume rendering – Bentray";
  const volumes = new Map();
  const form = at("look");
  const frame = imageFrame("glass", "look-error");

  // The values of the form; without iso-value and index, those that suit the volume.
  function view() {
    const volume = volumes.get(at("volume").value);
    const { iso, index, azimuth_deg: azimuth, elevation_deg: elevation } = Object.fromEntries(new FormData(form));
    const suited = iso || index || volume.water_speed_mps === null ? {} : glassOf(volume);
    const entered = { ...(iso && { iso: [Number(iso)] }), ...(index && { index: [Number(index)] }) };
    return { ...suited, ...entered, azimuth_deg: Number(azimuth), elevation_deg: Number(elevation) };
  }

  function show() {
    const volume = volumes.get(at("volume").value);
    at("turn").disabled = !volume;
    if (!volume) return;
    const [lowest, highest] = volume.value_range.map((value) => Number(value.toPrecision(4)));
    const size = volume.shape.join(" × ");
    at("volume-facts").textContent = `${size} nodes · values ${lowest} to ${highest} ${volume.unit}`;
    if (!form.reportValidity()) return;
    frame.draw(`${volume.links.refraction}?${queryOf(view())}`, `Volume rendering of ${titleOf(volume)}`);
  }

  async function loadVolumes(chosen) {
    const inSpace = (await load("volumes")).filter((row) => row.links.refraction);
    for (const row of inSpace) volumes.set(row.id, row);
    if (!inSpace.length || !root.isConnected) return;
    fillSelect("volume", inSpace, titleOf, chosen);
    show();
  }

  // The values of the form belong to the volume before it.
  async function stored({ id: name, links }) {
    if (!links.refraction) throw new Error("The volume is stored, but it cannot be rendered: its spacing is not uniform.");
    form.reset();
    await loadVolumes(name);
  }

  uploads("volume", (file) => `/v1/volumes?${queryOf({ title: file.name.slice(0, 200) })}`, "application/octet-stream", stored);
  at("volume").addEventListener("change", () => go(`/rendering/${at("volume").value}`));
  form.addEventListener("change", show);
  const jobs = jobList(at("turntables"), { empty: "No turntable yet", wanted: (job) => job.kind === "refraction" });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const frames = Number(new FormData(form).get("frames"));
    const settings = { ...view(), frames, format: "apng" };
    startJob({ kind: "refraction", volume: at("volume").value, settings }, "look-error", jobs.refresh);
  });
  fillDefaults(form, "Turntable")
    .then(() => loadVolumes(id))
    .catch((error) => showError("look-error", error));
  return jobs.close;
}
