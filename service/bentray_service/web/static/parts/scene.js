// What the pages of volume and surface rendering share: the picture of a view, its camera, and the choice of what is rendered.
import { inTime } from "./amounts.js";
import { request } from "./api.js";
import { description } from "./description.js";
import { orbit } from "./orbit.js";
import { pictureStream, rateOf } from "./picture_stream.js";
import { titleOf } from "./titles.js";
import { Facts, html, Labelled, Options, useEffect, useNewest, useRef, useState } from "./view.js";

export const CAMERA = ["azimuth_deg", "elevation_deg", "zoom"];
const ZOOMS = [0.05, 50];

export const rounded = (value) => Number(value.toPrecision(4));
const clamped = (value, [least, most]) => Math.min(most, Math.max(least, value));

// Default values of a schema by name.
export async function defaultsOf(schema) {
  const { properties } = (await description()).components.schemas[schema];
  return Object.fromEntries(Object.entries(properties).map(([name, field]) => [name, field.default]));
}

export function NumberField({ caption, ...more }) {
  return html`<${Labelled} caption=${caption}><input type="number" step="any" ...${more} /></${Labelled}>`;
}

export function Choice({ caption, entries, chosen, ...more }) {
  return html`<${Labelled} caption=${caption}><select ...${more}><${Options} entries=${entries} chosen=${chosen} /></select></${Labelled}>`;
}

// Stored records, newest first, to choose from; none: words without any.
export function RecordSelect({ id, caption, records, chosen, none, onChoose }) {
  const entries = records.length ? records.map((record) => [record.id, `${titleOf(record)} (${inTime(record.created)})`]) : [["", none]];
  return html`
    <label for=${id} class="caption">${caption}</label>
    <select id=${id} disabled=${!records.length} value=${chosen} onChange=${({ target }) => onChoose(target.value)}><${Options} entries=${entries} /></select>`;
}

// Put the values of an address into a form.
export function fillForm(form, query) {
  for (const [name, value] of query) Object.assign(form.elements.namedItem(name) ?? {}, { value });
}

// The camera in the numbers of a form, up to an elevation, degrees; show(moving) is called after each change.
export function cameraOf(form, highest, show) {
  const field = (name) => form.current.elements[name];
  return {
    turn(right, up) {
      field("azimuth_deg").value = Number(((Number(field("azimuth_deg").value) + right) % 360).toFixed(2));
      field("elevation_deg").value = Number(clamped(Number(field("elevation_deg").value) + up, [-highest, highest]).toFixed(2));
      show(true);
    },
    zoom(factor) {
      field("zoom").value = rounded(clamped(Number(field("zoom").value) * factor, ZOOMS));
      show(true);
    },
    reset() {
      for (const name of CAMERA) field(name).value = field(name).defaultValue;
      show(true);
    },
  };
}

// The picture of a view, which is turned on it. words: label of the stage and of a canvas without a picture; hint: before the first picture;
// describe(): the view in words, { label, facts }; onShown() is called after each picture; camera: of cameraOf, with dragged() if objects can be
// moved; stream: { current } that gets the pictureStream.
export function Stage({ id, words, hint, describe, onShown = () => {}, onError, camera, stream }) {
  const [canvas, stage] = [useRef(null), useRef(null)];
  const [shown, setShown] = useState(null);
  const newest = useNewest({ describe, onShown, camera, onError });
  useEffect(() => {
    stream.current = pictureStream(canvas.current, {
      onShown({ quality, rate }) {
        const { label, facts } = newest.current.describe();
        setShown({ label, facts: `${facts}${quality === "full" ? "" : rateOf(rate)}` });
        newest.current.onShown();
      },
      onError: (problem) => newest.current.onError(problem),
    });
    orbit(stage.current, {
      turn: (...by) => newest.current.camera.turn(...by),
      zoom: (factor) => newest.current.camera.zoom(factor),
      reset: () => newest.current.camera.reset(),
      dragged: (event) => newest.current.camera.dragged?.(event),
    });
    return () => stream.current.close();
  }, []);
  return html`
    <div id="stage" class="stage" ref=${stage} tabindex="0" role="group" aria-label=${words[0]}>
      <canvas id=${id} ref=${canvas} width="512" height="512" role="img" aria-label=${shown?.label ?? words[1]}></canvas>
      <p class="hint" id="stage-hint" hidden=${shown !== null}>${hint}</p>
    </div>
    <${Facts} id="view-facts">${shown?.facts}</${Facts}>`;
}

// Delete a stored record after a question; what: it and what goes with it. Returns whether it was deleted.
export async function deleteStored(address, what) {
  if (!confirm(`Delete ${what} for good?`)) return false;
  await request(address, { method: "DELETE" });
  return true;
}
