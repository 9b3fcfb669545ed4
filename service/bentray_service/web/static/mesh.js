// Meshes: upload one, make its geometry field, and look at it as mirror or glass.
import { request } from "./api.js";
import { show as showPicture } from "./key.js";
import { uploads } from "./uploads.js";
import { queryOf } from "./views.js";

const at = (id) => document.getElementById(id);
const meshes = new Map();
// Of each mesh the links of its newest field.
const fields = new Map();
const form = () => at("field");
let shown = "";

export function meshTitle(id) {
  return meshes.has(id) ? meshes.get(id).title || id : undefined;
}

function say(error) {
  at("field-error").textContent = error ? error.message : "";
  at("field-error").hidden = !error;
}

function factsOf({ faces, closed, holes, genus, repairs }) {
  const form = closed ? "closed" : `${holes} ${holes === 1 ? "hole" : "holes"}`;
  const mended = Object.values(repairs).some((count) => count > 0) ? " · mended" : "";
  return `${faces} faces · ${form} · ${genus} ${genus === 1 ? "handle" : "handles"}${mended}`;
}

function show() {
  const mesh = meshes.get(at("mesh").value);
  at("make").disabled = !mesh;
  if (!mesh) return;
  at("mesh-facts").textContent = factsOf(mesh);
  const links = fields.get(mesh.id);
  if (!links) {
    shown = "";
    at("field-picture").replaceChildren("The image appears here once the field is built");
    return;
  }
  const { samples, ...view } = Object.fromEntries(new FormData(form()));
  const address = `${links.image}?${queryOf({ ...view, rays: 2 })}`;
  if (address === shown) return;
  shown = address;
  const image = new Image();
  image.alt = `${meshTitle(mesh.id)}, ${view.mode}`;
  at("field-picture").className = "picture drawing";
  image.onload = () => {
    if (address !== shown) return;
    at("field-picture").replaceChildren(image);
    at("field-picture").className = "picture";
  };
  image.onerror = () => {
    if (address !== shown) return;
    shown = "";
    at("field-picture").className = "picture";
    at("field-picture").replaceChildren("No image");
    // The service says why in the body, which an image does not tell.
    request(address).catch(say);
  };
  showPicture(image, address);
}

export async function loadMeshes(chosen) {
  const { meshes: rows } = await request("/v1/meshes?limit=1000");
  for (const row of rows) meshes.set(row.id, row);
  if (!rows.length) return;
  const select = at("mesh");
  const before = chosen || select.value;
  select.replaceChildren(...rows.map((row) => new Option(`${meshTitle(row.id)} (${new Date(row.created).toLocaleString()})`, row.id)));
  select.disabled = false;
  if (meshes.has(before)) select.value = before;
  show();
}

// Jobs come newest first.
export function showFields(jobs) {
  const before = fields.get(at("mesh").value)?.field;
  for (const job of [...jobs].reverse()) if (job.field) fields.set(job.mesh, job.links);
  if (fields.get(at("mesh").value)?.field !== before) show();
}

export function watchMeshes(onStarted) {
  uploads("mesh", (file) => `/v1/meshes?${queryOf({ title: file.name.slice(0, 200) })}`, "application/octet-stream", ({ id }) => loadMeshes(id));
  at("mesh").addEventListener("change", show);
  form().addEventListener("change", show);
  form().addEventListener("submit", async (event) => {
    event.preventDefault();
    say(null);
    const settings = { samples: Number(new FormData(form()).get("samples")) };
    const body = JSON.stringify({ kind: "geometry-field", mesh: at("mesh").value, settings });
    try {
      await request("/v1/jobs", { method: "POST", headers: { "Content-Type": "application/json" }, body });
      await onStarted();
    } catch (error) {
      say(error);
    }
  });
}
