// Volumes as glass: upload one, look at it, and start a turntable.
import { request } from "./api.js";
import { show as showPicture } from "./key.js";
import { uploads } from "./uploads.js";
import { glassOf, queryOf } from "./views.js";

const at = (id) => document.getElementById(id);
const volumes = new Map();
const form = () => at("look");
let shown = "";

export function volumeTitle(id) {
  return volumes.has(id) ? volumes.get(id).title || id : undefined;
}

function say(error) {
  at("look-error").textContent = error ? error.message : "";
  at("look-error").hidden = !error;
}

// What is asked for; where nothing is, what suits the volume.
function view() {
  const volume = volumes.get(at("volume").value);
  const { iso, index, azimuth_deg: azimuth, elevation_deg: elevation } = Object.fromEntries(new FormData(form()));
  const suited = iso || index || volume.water_speed_mps === null ? {} : glassOf(volume);
  const asked = { ...(iso && { iso: [Number(iso)] }), ...(index && { index: [Number(index)] }) };
  return { ...suited, ...asked, azimuth_deg: Number(azimuth), elevation_deg: Number(elevation) };
}

function show() {
  const volume = volumes.get(at("volume").value);
  at("turn").disabled = !volume;
  if (!volume) return;
  const [lowest, highest] = volume.value_range.map((value) => Number(value.toPrecision(4)));
  const size = volume.shape.join(" × ");
  at("volume-facts").textContent = `${size} nodes · values ${lowest} to ${highest} ${volume.unit}`;
  if (!form().reportValidity()) return;
  const address = `${volume.links.refraction}?${queryOf(view())}`;
  if (address === shown) return;
  shown = address;
  say(null);
  const image = new Image();
  image.alt = `Volume rendering of ${volumeTitle(volume.id)}`;
  at("glass").className = "picture drawing";
  image.onload = () => {
    if (address === shown) at("glass").replaceChildren(image);
    if (address === shown) at("glass").className = "picture";
  };
  image.onerror = () => {
    if (address !== shown) return;
    shown = "";
    at("glass").className = "picture";
    at("glass").replaceChildren("No image");
    // The service says why in the body, which an image does not tell.
    request(address).catch(say);
  };
  showPicture(image, address);
}

export async function loadVolumes(chosen) {
  const { volumes: rows } = await request("/v1/volumes?limit=1000");
  for (const row of rows) volumes.set(row.id, row);
  const inSpace = rows.filter((row) => row.links.refraction);
  if (!inSpace.length) return;
  const select = at("volume");
  const before = chosen || select.value;
  select.replaceChildren(...inSpace.map((row) => new Option(`${volumeTitle(row.id)} (${new Date(row.created).toLocaleString()})`, row.id)));
  select.disabled = false;
  if (inSpace.some((row) => row.id === before)) select.value = before;
  show();
}

// Of a new volume other values are asked for.
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
  form().addEventListener("submit", async (event) => {
    event.preventDefault();
    say(null);
    const frames = Number(new FormData(form()).get("frames"));
    const settings = { ...view(), frames, format: "apng" };
    const body = JSON.stringify({ kind: "refraction", volume: at("volume").value, settings });
    try {
      await request("/v1/jobs", { method: "POST", headers: { "Content-Type": "application/json" }, body });
      await onStarted();
    } catch (error) {
      say(error);
    }
  });
}
