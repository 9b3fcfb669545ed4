// What the pages of volume and surface rendering share: the picture of a view, its camera, the form of the view, and what is rendered.
import { JobList } from "../jobs/job_cards.js";
import { go, keepQuery, parse } from "../parts/address.js";
import { send } from "../parts/api.js";
import { DropZone } from "../parts/drop_zone.js";
import { deleteRecord, titleOf } from "../parts/lists.js";
import { keyHandler, usePointers } from "../parts/pointers.js";
import { Alert, Button, Choice, Facts, Form, html, Section, useAct, useEffect, useLater, useNewest, useRef, useState } from "../parts/view.js";
import { Waiting } from "../parts/waiting.js";
import { inTime } from "../parts/words.js";
import { PictureStream, rateOf } from "./picture_stream.js";

export const CAMERA = ["azimuth_deg", "elevation_deg", "zoom"];
// Sides of pictures, pixels: while the view moves, and at rest.
export const [PREVIEW_PX, FULL_PX] = [256, 512];
// After the last change until the address has the view: browsers limit how often it changes.
const KEEP_MS = 200;
const DEGREES_PER_PIXEL = 0.5;
const [KEY_DEGREES, KEY_ZOOM] = [5, 1.15];

export const rounded = (value) => Number(value.toPrecision(4));
export const clamped = (value, least, most) => Math.min(most, Math.max(least, value));

// The camera in the numbers of a form, within their limits; show(moving) is called after each change.
function cameraOf(form, show) {
  const field = (name) => form.current.elements[name];
  const put = (name, value, round) => {
    field(name).value = round(clamped(value, Number(field(name).min), Number(field(name).max)));
  };
  const hundredths = (value) => Number(value.toFixed(2));
  return {
    turn(right, up) {
      put("azimuth_deg", (Number(field("azimuth_deg").value) + right) % 360, hundredths);
      put("elevation_deg", Number(field("elevation_deg").value) + up, hundredths);
      show(true);
    },
    zoom(factor) {
      put("zoom", Number(field("zoom").value) * factor, rounded);
      show(true);
    },
    reset() {
      for (const name of CAMERA) field(name).value = field(name).defaultValue;
      show(true);
    },
  };
}

// A record that is rendered as a form says. records: to choose from, newest first; id: the first choice; query: of the address, for the form;
// pictureOf(record, values): { preview, full, drawHere, keep }, see PictureStream, keep() states the view in the address; null without a picture.
export function useScene({ records: first, id, query, pictureOf }) {
  const [records, setRecords] = useState(first);
  const [chosen, choose] = useState(id);
  const record = records.find((row) => row.id === chosen) ?? records[0];
  const [error, act, setError] = useAct();
  const [form, stream, refresh] = [useRef(null), useRef(null), useRef(null)];
  const later = useLater();
  const values = () => Object.fromEntries(new FormData(form.current));

  // Show the values of the form; moving: as one of many steps.
  function show(moving = false) {
    const valid = form.current.checkValidity();
    if (!valid && record && !moving) form.current.reportValidity();
    const picture = valid && record ? pictureOf(record, values()) : null;
    if (!picture) return;
    const { up } = values();
    if (up === "auto") localStorage.removeItem(`up ${record.id}`);
    else localStorage.setItem(`up ${record.id}`, up);
    stream.current.show(picture, moving);
    later(picture.keep, KEEP_MS);
  }

  useEffect(() => {
    for (const [name, value] of query) Object.assign(form.current.elements.namedItem(name) ?? {}, { value });
  }, []);
  // The axis that is up belongs to the record: this browser keeps it.
  useEffect(() => {
    if (record && !query.has("up")) form.current.elements.up.value = localStorage.getItem(`up ${record.id}`) ?? "auto";
  }, [record?.id]);
  return { records, setRecords, record, choose, error, act, setError, form, stream, refresh, values, show, camera: cameraOf(form, show) };
}

// Turns and zooms a view by mouse, touch and keyboard: handlers for a focusable element. turn(right, up) is called with degrees, zoom(factor) with
// a factor, and reset() for Home. grab(point) is called for a press first: it returns what follows the moves of the pointer, at points of the
// element, where it takes the pointer for itself.
function useOrbit({ turn, zoom, reset, grab }) {
  const follow = useRef(null);
  const pointers = usePointers({
    press(point) {
      follow.current = point && grab(point);
    },
    drag(point, before) {
      if (follow.current) follow.current(point);
      else turn(-DEGREES_PER_PIXEL * (point[0] - before[0]), DEGREES_PER_PIXEL * (point[1] - before[1]));
    },
    pinch: zoom,
  });
  const onKeyDown = keyHandler(({ shiftKey }) => {
    const step = (shiftKey ? 3 : 1) * KEY_DEGREES;
    return {
      ArrowLeft: () => turn(-step, 0),
      ArrowRight: () => turn(step, 0),
      ArrowUp: () => turn(0, step),
      ArrowDown: () => turn(0, -step),
      "+": () => zoom(KEY_ZOOM),
      "=": () => zoom(KEY_ZOOM),
      "-": () => zoom(1 / KEY_ZOOM),
      Home: reset,
    };
  });
  function onWheel(event) {
    // Elsewhere the wheel scrolls the page.
    if (document.activeElement !== event.currentTarget && !event.ctrlKey) return;
    event.preventDefault();
    zoom(Math.exp(-0.0015 * event.deltaY));
  }
  return { ...pointers, onKeyDown, onWheel };
}

// The picture of a view, which is turned on it. words: label of the stage and of a canvas without a picture; hint: before the first picture;
// describe(values): the view in words, { label, facts }; onShown() is called after each picture; camera: of useScene, with grab() if objects can
// be moved.
function Stage({ id, words, hint, describe, onShown = () => {}, onError, camera, stream }) {
  const [canvas, stage] = [useRef(null), useRef(null)];
  const [shown, setShown] = useState(null);
  const handlers = useNewest({
    onShown({ quality, rate }) {
      const { label, facts } = describe();
      setShown({ label, facts: `${facts}${quality === "full" ? "" : rateOf(rate)}` });
      onShown();
    },
    onError,
  });
  useEffect(() => {
    stream.current = new PictureStream(canvas.current, handlers);
    return () => stream.current.close();
  }, []);
  const orbit = useOrbit({ ...camera, grab: (point) => camera.grab?.(point, stage.current) });
  return html`
    <div id="stage" class="stage" ref=${stage} tabindex="0" role="group" aria-label=${words[0]} ...${orbit}>
      <canvas id=${id} ref=${canvas} width=${FULL_PX} height=${FULL_PX} role="img" aria-label=${shown?.label ?? words[1]}></canvas>
      <div class="hint" id="stage-hint" hidden=${shown !== null}>${hint}</div>
    </div>
    <${Facts} id="view-facts">${shown?.facts}</${Facts}>`;
}

// A whole page. scene: of useScene; name: of the kind of record; path: of the page; stage: see Stage; above, below: the picture; instead: what is
// shown in place of the picture and the fields; formats, none: of files, and without a record; onStored(record): after an upload; facts: of the record; form: its id; onChange(): of the form; fields: in it; begin:
// { id, title, job() } of the button that starts a job; actions: beside it; products: what is deleted with a record, null if it is not deleted
// here; jobs: { title, kind, empty, onJobs } of the jobs below.
export function ScenePage(props) {
  const { scene, title, name, path, stage, above, instead, below, formats, none, onStored, facts, form, onChange, fields, begin, products, actions, jobs, children } = props;
  const { record, records, act, camera } = scene;
  // The newest one is shown by a page that was opened without an id, and after an upload.
  useEffect(() => record && keepQuery(parse(location.hash).query, `${path}/${record.id}`), [record?.id]);
  const entries = records.length ? records.map((one) => [one.id, `${titleOf(one)} (${inTime(one.created)})`]) : [["", none]];
  const start = () => act(async () => {
    await send("POST", "/v1/jobs", begin.job());
    await scene.refresh.current();
  });
  const remove = () => deleteRecord(act, `${titleOf(record)} and its ${products}`, record.links.self, path);
  return html`
    <h1>${title}</h1>
    <section aria-label=${title} class="panel viewer">
      <div>
        ${above}
        <div hidden=${Boolean(instead)}>
          <${Stage} onError=${scene.setError} camera=${camera} stream=${scene.stream} ...${stage}
            hint=${record && !scene.error ? html`<${Waiting} words="Drawing the first picture" />` : stage.hint} />
        </div>
        ${instead}
        <${Alert} id=${`${form}-error`} error=${scene.error} />
        ${below}
      </div>
      <div>
        <${DropZone} name=${name} prompt=${`Choose a ${name}`} formats=${formats} onStored=${onStored}
          metadataOf=${(file) => ({ kind: name, title: file.name.slice(0, 200) })} />
        <${Choice} caption=${`${name[0].toUpperCase()}${name.slice(1)} to render`} id=${name} disabled=${!records.length} entries=${entries} chosen=${record?.id}
          onChange=${({ target }) => go(`${path}/${target.value}`)} />
        <${Facts} id=${`${name}-facts`}>${facts}</${Facts}>
        <${Form} id=${form} ref=${scene.form} onChange=${onChange} onSubmit=${start}>
          <div hidden=${Boolean(instead)}>${fields}</div>
          <div class="actions">
            <button id=${begin.id} type="submit" disabled=${!record}>${begin.title}</button>
            <${Button} id="reset-view" hidden=${Boolean(instead)} onClick=${camera.reset}>Reset the view</${Button}>
            <${Button} id=${`delete-${name}`} hidden=${!record || !products} onClick=${remove}>Delete the ${name}</${Button}>
            ${actions}
          </div>
          ${children}
        </${Form}>
      </div>
    </section>
    <${Section} id="jobs" title=${jobs.title} className="">
      <${JobList} refresh=${scene.refresh} empty=${jobs.empty} filters=${{ kind: jobs.kind }} onJobs=${jobs.onJobs} />
    </${Section}>`;
}
