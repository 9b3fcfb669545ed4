// Surface rendering: a mesh, with its geometry field once it has one, as clay, mirror or glass, turned by mouse, touch or keyboard, its objects moved.
import { keepQuery, queryOf } from "../parts/address.js";
import { parametersOf, propertiesOf, request } from "../parts/api.js";
import { load, titleOf } from "../parts/lists.js";
import { PlainField } from "../parts/settings_fields.js";
import { Field, html, Pairs, useEffect, useRead, useState } from "../parts/view.js";
import { counted } from "../parts/words.js";
import { objectAt, objectsOf, placeAt } from "../scenes/camera.js";
import { CAMERA, clamped, FULL_PX, PREVIEW_PX, ScenePage, useScene } from "../scenes/scene.js";

const WORDS = ["View of the scene: arrow keys turn it, plus and minus zoom, Home resets; objects on the ground are dragged", "No image yet"];
// What is it? Clay comes first, mirror and glass second.
const FIRST = { mode: "diffuse" };
const FIELDS = ["mode", "scene", "lookup", "up", "index", "share", ...CAMERA, "samples"];

function factsOf({ faces, closed, holes, genus, repairs }) {
  const form = closed ? "closed" : counted(holes, "hole", "holes");
  const mended = Object.values(repairs).some((count) => count > 0) ? " · mended" : "";
  return `${counted(faces, "face", "faces")} · ${form} · ${counted(genus, "handle", "handles")}${mended}`;
}

// Below this share rounding decides.
const SMALLEST = 1e-5;

function percent(share) {
  if (share === null) return "no ray hits the mesh";
  return share > 0 && share < SMALLEST ? `below ${100 * SMALLEST} %` : `${Number((100 * share).toPrecision(2))} %`;
}

// The errors of a field in words, lengths in per cent of the edge of its unit cube. address: of its record.
function Accuracy({ address, onError }) {
  const [record, error] = useRead(() => request(address), { key: address });
  useEffect(() => error && onError(error), [error]);
  if (!record) return null;
  const { errors, sizes, seconds, settings } = record;
  const bytes = ((sizes.outer_bytes + sizes.inner_bytes) / 2 ** 20).toPrecision(3);
  const time = Object.values(seconds).reduce((sum, part) => sum + part, 0);
  const rows = [
    ["Rays for which the field hits where the mesh is missed, or the reverse", percent(errors.lookup_wrong)],
    ["Distance between a lookup and the exact hit, half of the rays", percent(errors.lookup_median)],
    ["The same, 99 of 100 rays", percent(errors.lookup_99)],
    ["Geometry image off the surface, rms", percent(errors.image_rms)],
    ["Geometry image off the surface, at most", percent(errors.image_greatest)],
    ["Parameterisation", errors.conformal ? "conformal" : "not conformal"],
    ["Tables", `${bytes} MiB from ${settings.samples} samples per edge, ${time.toPrecision(2)} s of computing`],
  ];
  return html`<${Pairs} className="errors" caption="Error of the geometry field, per cent of the edge of its cube" rows=${rows} />`;
}

// The objects of a scene where the values of the form place them.
function placedIn(values) {
  return objectsOf(values.scene).map((object, number) => ({ ...object, x: Number(values[`x${number}`]), y: Number(values[`y${number}`]) }));
}

// The view that the values of the form state: without what the material shows nothing of, which the service refuses, and with the places of
// the objects once one of them was moved.
function viewOf({ samples, ...values }) {
  if (!values.mode.startsWith("refract")) delete values.index;
  if (values.mode === "diffuse") delete values.share;
  const [standing, places] = [objectsOf(values.scene), placedIn(values)].map((objects) => objects.flatMap(({ x, y }) => [x, y]));
  for (const name of Object.keys(values)) if (/^[xy]\d/.test(name)) delete values[name];
  return { ...values, ...(places.join() !== standing.join() && { positions_m: places }) };
}

// What moves the object that is shown at a point of the stage over the ground, as far as the pointer goes: a function of its points; null where
// there is none. values(): of the form; move(number, [x, y]) moves an object.
function grabObject(point, stage, values, move) {
  const inPicture = ([px, py]) => [px / stage.clientWidth - 0.5, py / stage.clientHeight - 0.5];
  const objects = placedIn(values());
  const number = objects.length ? objectAt(values(), objects, ...inPicture(point)) : -1;
  if (number < 0) return null;
  const at = (to) => placeAt(values(), ...inPicture(to), objects[number].size / 2);
  let last = at(point);
  return last && ((to) => {
    const place = at(to);
    if (!place) return;
    const { x, y } = placedIn(values())[number];
    move(number, [x + place[0] - last[0], y + place[1] - last[1]]);
    last = place;
  });
}

// Numbers for the places of the movable objects of a scene. places: x and y of each, by default where they stand; limits: of a place.
function Objects({ scene, places, limits: { minimum, maximum } }) {
  return html`<div id="objects" class="numbers">
    ${objectsOf(scene).flatMap((object, number) => ["x", "y"].map((axis, k) => html`<${Field} key=${`${scene} ${axis}${number}`} type="number" step="any"
      caption=${`${object.name}, ${axis}, m`} name=${`${axis}${number}`} min=${minimum} max=${maximum} required
      defaultValue=${places[2 * number + k] ?? object[axis]} />`))}
  </div>`;
}

// built: links of the newest field of each mesh, by the id of the mesh; fields: of the form, as schemas by name.
function Surfaces({ meshes, built, id, query, fields }) {
  const [links, setLinks] = useState(built);
  const [{ standing, places }, setStanding] = useState({ standing: query.get("scene") ?? "object", places: query.getAll("positions_m").map(Number) });
  const scene = useScene({ records: meshes, id, query, pictureOf });
  const { record: mesh, form, values, show } = scene;
  const field = mesh && links[mesh.id];
  const image = field?.image ?? mesh?.links.image;
  const limits = fields.positions_m.items;

  function pictureOf(_, given) {
    const view = viewOf(given);
    const address = (rest) => `${image}?${queryOf({ ...view, ...rest })}`;
    return {
      preview: address({ width: PREVIEW_PX, height: PREVIEW_PX }),
      full: address({ rays: 2, width: FULL_PX, height: FULL_PX }),
      keep: () => keepQuery(queryOf(view)),
    };
  }

  // Another scene has other objects, once they are drawn.
  useEffect(() => show(), [mesh?.id, field?.field, standing]);

  // Objects of the scene: [x, y] of each, m.
  function place(objects) {
    objects.forEach((metres, number) => ["x", "y"].forEach((axis, k) => {
      form.current.elements[`${axis}${number}`].value = Number(clamped(metres[k], limits.minimum, limits.maximum).toFixed(3));
    }));
  }

  function onChange() {
    if (values().scene === standing) show();
    else setStanding({ standing: values().scene, places: [] });
  }
  const camera = {
    ...scene.camera,
    reset() {
      place(objectsOf(standing).map(({ x, y }) => [x, y]));
      scene.camera.reset();
    },
    grab: (point, stage) => grabObject(point, stage, values, (number, metres) => {
      place(Object.assign([], { [number]: metres }));
      show(true);
    }),
  };
  const describe = () => {
    const { mode, azimuth_deg: azimuth, elevation_deg: elevation } = values();
    const turned = `azimuth ${azimuth}°, elevation ${elevation}°`;
    return { facts: turned, label: `${titleOf(mesh)}, ${mode}, ${turned}` };
  };
  const onJobs = (jobs) => {
    const made = jobs.filter((job) => job.field).reverse().map((job) => [job.mesh, job.links]);
    if (made.length) setLinks((before) => ({ ...before, ...Object.fromEntries(made) }));
  };
  const onStored = async (made) => {
    scene.setRecords(await load("meshes"));
    scene.choose(made.id);
  };
  const job = () => ({ kind: "geometry-field", mesh: mesh.id, settings: { samples: Number(values().samples) } });
  return html`<${ScenePage} scene=${{ ...scene, camera }} title="Surface rendering" name="mesh" path="/surfaces" onStored=${onStored} onChange=${onChange}
    stage=${{ id: "field-picture", words: WORDS, hint: "The image appears here", describe }} formats="PLY, OBJ, OFF, STL, glTF or GLB" none="No mesh uploaded yet" form="field"
    below=${html`<div id="accuracy">${field && html`<${Accuracy} address=${field.field} onError=${scene.setError} />`}</div>`}
    facts=${mesh && factsOf(mesh)} products="geometry fields"
    fields=${html`
      <div class="numbers">${FIELDS.map((name) => html`<${PlainField} name=${name} given=${fields[name]} value=${FIRST[name]} required
        disabled=${name === "lookup" && !field} />`)}</div>
      <${Objects} scene=${standing} places=${places} limits=${limits} />`}
    begin=${{ id: "make", title: "Build the geometry field", job }}
    jobs=${{ title: "Geometry fields", kind: "geometry-field", empty: "No geometry field yet", onJobs }} />`;
}

export async function open({ id, query }) {
  document.title = "Surface rendering – Bentray";
  const [meshes, { geometry_fields: records }, { samples }, view] = await Promise.all([
    load("meshes"), request("/v1/geometry-fields?limit=1000"), propertiesOf("FieldSettings"), parametersOf("/v1/geometry-fields/{field_id}/image.png"),
    id && request(`/v1/meshes/${id}`),
  ]);
  // Records are the newest first.
  const built = Object.fromEntries(records.reverse().map(({ mesh, links }) => [mesh, { ...links, field: links.self }]));
  return html`<${Surfaces} meshes=${meshes} built=${built} id=${id} query=${query} fields=${{ ...view, samples }} />`;
}
