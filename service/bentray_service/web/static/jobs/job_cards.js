// The list of jobs: one card a job, kept and updated in place so that the focus and the pictures stay.
import { inNanoseconds } from "../parts/amounts.js";
import { inWords, request } from "../parts/api.js";
import { make } from "../parts/dom.js";
import { duration } from "../parts/job_words.js";
import { show, showOnceNear, withKey } from "../parts/key.js";
import { glassOf, queryOf, shownBy } from "../parts/views.js";

const SVG = "http://www.w3.org/2000/svg";
const RAYS = { curved: "Bent rays", straight: "Straight rays" };
const METHODS = { sart: "SART", "gauss-newton": "Gauss–Newton", auto: "automatic", waveform: "full waveform" };
const FORMATS = [
  ["hdf5", "HDF5"], ["npy", "NumPy"], ["mat", "MATLAB"], ["nifti", "NIfTI"], ["nrrd", "NRRD"], ["metaimage", "MetaImage"],
  ["vti", "VTK (ParaView)"], ["ome-zarr", "OME-Zarr"], ["dicom", "DICOM"],
];
const cards = new Map();

function link(text, address, saveAs) {
  const node = make("a", "", text);
  node.href = address;
  if (saveAs) node.download = "";
  return withKey(node, address);
}

// Mean residual of each iteration over the slices, stage by stage; and the iterations at which a stage begins.
export function residuals(history) {
  const sums = new Map();
  for (const { stage, sweep, residual_rms_s: value } of history) {
    if (value === null) continue;
    const key = `${stage} ${sweep}`;
    const one = sums.get(key) || { stage, sweep, sum: 0, count: 0 };
    one.sum += value;
    one.count += 1;
    sums.set(key, one);
  }
  const sweeps = [...sums.values()].sort((a, b) => a.stage - b.stage || a.sweep - b.sweep);
  return {
    values: sweeps.map(({ sum, count }) => sum / count),
    begins: sweeps.flatMap(({ stage }, i) => (i && stage !== sweeps[i - 1].stage ? [i] : [])),
  };
}

function sparkline({ values, begins }) {
  const picture = document.createElementNS(SVG, "svg");
  picture.setAttribute("class", "spark");
  picture.setAttribute("viewBox", "0 0 100 40");
  picture.setAttribute("preserveAspectRatio", "none");
  picture.setAttribute("role", "img");
  const stages = begins.length ? ` in ${begins.length + 1} stages` : "";
  picture.setAttribute("aria-label", `Residual of ${values.length} iterations${stages}`);
  const top = Math.max(...values);
  const base = document.createElementNS(SVG, "line");
  for (const [name, value] of [["x1", 0], ["x2", 100], ["y1", 39], ["y2", 39]]) base.setAttribute(name, value);
  const across = (i) => (100 * i) / (values.length - 1);
  const borders = begins.map((first) => {
    const border = document.createElementNS(SVG, "line");
    const x = across(first - 0.5);
    for (const [name, value] of [["class", "stage"], ["x1", x], ["x2", x], ["y1", 0], ["y2", 39]]) border.setAttribute(name, value);
    return border;
  });
  const curve = document.createElementNS(SVG, "polyline");
  const points = values.map((value, i) => `${across(i)},${39 - (36 * value) / (top || 1)}`);
  curve.setAttribute("points", points.join(" "));
  picture.append(base, ...borders, curve);
  return picture;
}

// An image that links to a larger one.
function drawn(address, words, larger = address) {
  const frame = make("div", "picture");
  const image = make("img");
  image.alt = words;
  image.onerror = () => frame.replaceChildren("The image could not be drawn.");
  showOnceNear(image, address);
  const anchor = link("", larger);
  anchor.append(image);
  frame.append(anchor);
  return frame;
}

// The slice without a frame, whose text would be too small, and its range of colours; a 3-D volume is also rendered.
async function showVolume(column, job, title) {
  const volume = await request(job.links.volume);
  const [low, high] = volume.value_range;
  const range = low < high ? { low, high } : {};
  const small = `${job.links.image}?${queryOf({ frame: false, size: 320, ...range })}`;
  const words = `Sound speed, ${Math.round(low)} (dark) to ${Math.round(high)} m/s (bright)`;
  column.replaceChildren(drawn(small, `Sound speed, ${title}`, job.links.image), make("p", "caption", words));
  if (!volume.links.refraction) return;
  const address = `${volume.links.refraction}?${queryOf(glassOf(volume))}`;
  column.append(drawn(address, `Volume rendering, ${title}`), make("p", "caption", "Volume rendering"));
}

// A turntable rests at its first frame; an animated picture plays when asked.
function turntable(job, words) {
  const still = firstFrame(job);
  const frame = drawn(still, words);
  if (job.settings.format !== "apng") return [frame];
  const image = frame.querySelector("img");
  const play = make("button", "quiet", "Play");
  play.type = "button";
  play.addEventListener("click", () => {
    const plays = play.textContent === "Play";
    play.textContent = plays ? "Stop" : "Play";
    show(image, plays ? job.links.animation : still);
  });
  return [frame, play];
}

// The first picture of a turntable.
function firstFrame(job) {
  const { frames, turn_deg: turn, format, ...view } = job.settings;
  return `${job.links.volume}/refraction.png?${queryOf(shownBy(view))}`;
}

function pictures(job, title) {
  const column = make("div", "pictures");
  if (job.links.field) {
    column.append(drawn(`${job.links.image}?${queryOf({ width: 320, height: 320, rays: 2 })}`, `Surface rendering, ${title}`));
  } else if (job.links.image) {
    column.append(make("div", "picture"));
    showVolume(column, job, title).catch(() => {});
  } else if (job.links.animation) {
    column.append(...turntable(job, `Volume rendering, ${title}`));
  } else {
    const ended = job.state === "failed" || job.state === "cancelled";
    const words = job.kind === "simulation" ? "A scan; it has no image yet" : "The image follows";
    const none = ended || job.kind === "simulation";
    column.append(make("div", none ? "picture none" : "picture", ended ? "No image" : words));
  }
  return column;
}

// The request in a heading and a line.
export function summaryOf({ kind, settings }) {
  if (kind === "geometry-field") {
    return ["Geometry field", `${settings.samples} samples per edge, image of ${settings.image_size} pixels`];
  }
  if (kind === "refraction") {
    return ["Turntable", `${settings.frames} frames of ${settings.width} × ${settings.height}, index ${settings.index.join(", ")}`];
  }
  if (kind === "simulation") {
    const of = settings.phantom === "table7" ? "3-D breast phantom" : settings.phantom === "detailed" ? "Detailed 2-D breast phantom" : "2-D breast phantom";
    return ["Simulated scan", `${of}, ${settings.waveform ? "traces" : "travel times"}, ${settings.elements} elements`];
  }
  const { method, rays, nodes, iterations = settings.sweeps } = settings; // sweeps: of earlier versions
  const grid = nodes ? `${nodes} × ${nodes} nodes, ` : "";
  return [method === "auto" ? "Automatic" : RAYS[rays], `${METHODS[method]}, ${grid}${iterations} iterations`];
}

export function placeInQueue(ahead) {
  if (!ahead) return "Next in the queue";
  return ahead === 1 ? "1 job before this one" : `${ahead} jobs before this one`;
}

// The plan in a line, with details on demand.
export function planned({ tasks, largest_bytes: bytes, minutes, why }) {
  const box = make("details", "plan");
  const time = minutes ? `, about ${duration(60 * minutes)}` : "";
  box.append(make("summary", "", `Plan: ${tasks} tasks of up to ${Math.ceil(bytes / 2 ** 20)} MiB${time}`), make("p", "", why));
  return box;
}

function facts(job, title, onCancel) {
  const box = make("div");
  const [what, settings] = summaryOf(job);
  const heading = make("h2");
  const name = make("a", "", job.name || what);
  name.href = `#/jobs/${job.id}`;
  heading.append(name);
  heading.append(make("span", `state ${job.state}`, job.state));
  box.append(heading, make("p", "input", title), make("p", "", job.name ? `${what}: ${settings}` : settings));
  if (job.ahead !== null) box.append(make("p", "", placeInQueue(job.ahead)));
  if (job.plan) box.append(planned(job.plan));
  if (job.advice) box.append(make("p", "", job.advice));
  const { done, total, phase } = job.progress;
  if (job.state === "running" || job.state === "cancelling") {
    const bar = make("progress");
    bar.setAttribute("aria-label", "Progress");
    if (total) {
      bar.max = total;
      bar.value = done;
    }
    const share = total ? `${phase} ${Math.floor((100 * done) / total)} %` : "starting";
    box.append(bar, make("p", "", `${share} · ${duration(job.seconds || 0)}`));
  } else if (job.seconds !== null && job.finished) {
    box.append(make("p", "", `took ${duration(job.seconds)}`));
  }
  const course = residuals(job.history);
  const { values } = course;
  if (values.length) {
    const words = values.length > 1 ? `${inNanoseconds(values[0])} → ${inNanoseconds(values.at(-1))}` : inNanoseconds(values[0]);
    box.append(make("p", "", `residual ${words}`));
  }
  if (values.length > 1) box.append(sparkline(course));
  if (job.error) box.append(make("p", "error", inWords(job.error)));
  const row = make("div", "links");
  if (job.links.field) {
    row.append(link("Geometry image", job.links.geometry_image), link("Normal map", job.links.normal_map), link("Figures", job.links.field));
  }
  if (job.links.animation) row.append(link("Frames", job.links.animation, true));
  if (job.links.data) {
    const formats = make("details", "formats");
    formats.append(make("summary", "", "Download"));
    for (const [format, label] of FORMATS) formats.append(link(label, `${job.links.data}?format=${format}`, true));
    row.append(formats);
  }
  if (job.links.cancel) {
    const cancel = make("button", "quiet", "Cancel");
    cancel.type = "button";
    cancel.addEventListener("click", () => onCancel(job));
    row.append(cancel);
  }
  box.append(row);
  return box;
}

// titleOf(job): title of its input, if known.
export function showJobs(list, jobs, titleOf, onCancel) {
  const present = new Set(jobs.map((job) => job.id));
  for (const [id, card] of cards) {
    if (!present.has(id)) {
      card.node.remove();
      cards.delete(id);
    }
  }
  jobs.forEach((job, place) => {
    const title = titleOf(job) || job.dataset || job.volume || job.mesh;
    const signature = JSON.stringify([job, title]);
    let card = cards.get(job.id);
    if (!card) {
      card = { node: make("li", "job"), signature: "", state: "" };
      card.node.id = job.id;
      cards.set(job.id, card);
    }
    if (card.signature !== signature) {
      const nameOf = (control) => `${control.tagName} ${control.textContent}`;
      const focused = card.node.lastChild?.contains(document.activeElement) ? nameOf(document.activeElement) : "";
      const fresh = facts(job, title, onCancel);
      for (const open of card.node.querySelectorAll("details[open]")) {
        const same = fresh.querySelector(`details.${open.className}`);
        if (same) same.open = true;
      }
      if (card.state === job.state) card.node.lastChild.replaceWith(fresh);
      else card.node.replaceChildren(pictures(job, title), fresh);
      const controls = [...fresh.querySelectorAll("a, button, summary")];
      if (focused) (controls.find((one) => nameOf(one) === focused) ?? controls[0])?.focus();
      card.signature = signature;
      card.state = job.state;
    }
    if (list.children[place] !== card.node) list.insertBefore(card.node, list.children[place] || null);
  });
}
