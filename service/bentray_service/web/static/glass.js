// The panel of volumes: upload one, render it with refraction, and start a turntable.
import { request } from "./api.js";
import { at } from "./dom.js";
import { fillSelect, imageFrame, startJob } from "./panel.js";
import { uploads } from "./uploads.js";
import { glassOf, queryOf } from "./views.js";

const volumes = new Map();
const form = () => at("look");
const frame = imageFrame("glass", "look-error");

export function volumeTitle(id) {
  return volumes.has(id) ? volumes.get(id).title || id : undefined;
}

// The values of the form; without iso-value and index, those that suit the volume.
function view() {
  const volume = volumes.get(at("volume").value);
  const { iso, index, azimuth_deg: azimuth, elevation_deg: elevation } = Object.fromEntries(new FormData(form()));
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
  if (!form().reportValidity()) return;
  frame.draw(`${volume.links.refraction}?${queryOf(view())}`, `Volume rendering of ${volumeTitle(volume.id)}`);
}

export async function loadVolumes(chosen) {
  const { volumes: rows } = await request("/v1/volumes?limit=1000");
  for (const row of rows) volumes.set(row.id, row);
  const inSpace = rows.filter((row) => row.links.refraction);
  if (!inSpace.length) return;
  fillSelect("volume", inSpace, (row) => volumeTitle(row.id), chosen);
  show();
}

// The values of the form belong to the volume before it.
async function stored({ id, links }) {
  if (!links.refraction) throw new Error("The volume is stored, but it cannot be rendered: its spacing is not uniform.");
  form().reset();
  await loadVolumes(id);
}

export function watchGlass(onStarted) {
  uploads("volume", (file) => `/v1/volumes?${queryOf({ title: file.name.slice(0, 200) })}`, "application/octet-stream", stored);
  at("volume").addEventListener("change", () => {
    form().reset();
    show();
  });
  form().addEventListener("change", show);
  form().addEventListener("submit", (event) => {
    event.preventDefault();
    const frames = Number(new FormData(form()).get("frames"));
    const settings = { ...view(), frames, format: "apng" };
    startJob({ kind: "refraction", volume: at("volume").value, settings }, "look-error", onStarted);
  });
}
