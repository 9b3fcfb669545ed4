// The panel of meshes: upload one, build its geometry field, and render it as mirror or glass.
import { request } from "./api.js";
import { at } from "./dom.js";
import { fillSelect, imageFrame, startJob } from "./panel.js";
import { uploads } from "./uploads.js";
import { queryOf } from "./views.js";

const meshes = new Map();
// The links of the newest field of each mesh.
const fields = new Map();
const form = () => at("field");
const frame = imageFrame("field-picture", "field-error");

export function meshTitle(id) {
  return meshes.has(id) ? meshes.get(id).title || id : undefined;
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
    frame.clear("The image appears here once the field is built");
    return;
  }
  const { samples, ...view } = Object.fromEntries(new FormData(form()));
  frame.draw(`${links.image}?${queryOf({ ...view, rays: 2 })}`, `${meshTitle(mesh.id)}, ${view.mode}`);
}

export async function loadMeshes(chosen) {
  const { meshes: rows } = await request("/v1/meshes?limit=1000");
  for (const row of rows) meshes.set(row.id, row);
  if (!rows.length) return;
  fillSelect("mesh", rows, (row) => meshTitle(row.id), chosen);
  show();
}

// Jobs are listed newest first.
export function showFields(jobs) {
  const before = fields.get(at("mesh").value)?.field;
  for (const job of [...jobs].reverse()) if (job.field) fields.set(job.mesh, job.links);
  if (fields.get(at("mesh").value)?.field !== before) show();
}

export function watchMeshes(onStarted) {
  uploads("mesh", (file) => `/v1/meshes?${queryOf({ title: file.name.slice(0, 200) })}`, "application/octet-stream", ({ id }) => loadMeshes(id));
  at("mesh").addEventListener("change", show);
  form().addEventListener("change", show);
  form().addEventListener("submit", (event) => {
    event.preventDefault();
    const settings = { samples: Number(new FormData(form()).get("samples")) };
    startJob({ kind: "geometry-field", mesh: at("mesh").value, settings }, "field-error", onStarted);
  });
}
