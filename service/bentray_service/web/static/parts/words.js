// Words for a person: bytes, counts and times; jobs with their kinds, settings, states and places in the queue; plans before they are started.
import { send } from "./api.js";

const UNITS = ["B", "KiB", "MiB", "GiB", "TiB"];

// 1536 is "1.50 KiB": three significant digits in the largest unit that keeps them above 1.
export function inBytes(bytes) {
  let [value, unit] = [bytes, 0];
  while (value >= 1024 && unit < UNITS.length - 1) {
    value /= 1024;
    unit += 1;
  }
  return `${unit ? Number(value.toPrecision(3)) : value} ${UNITS[unit]}`;
}

export const counted = (count, one, many) => `${count.toLocaleString("en")} ${count === 1 ? one : many}`;

// Of travel times: three significant digits, or all before the point.
export function inNanoseconds(seconds) {
  if (seconds === null) return "–";
  const value = 1e9 * seconds;
  const rounded = Math.abs(value) < 100 ? Number(value.toPrecision(3)) : Math.round(value);
  return `${rounded.toLocaleString("en")} ns`;
}

// The month by its name and 24 hours, since readers of other countries take 11/12 for another day.
const MOMENT = { day: "numeric", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit" };

// "never" without a time.
export const inTime = (text) => (text ? new Date(text).toLocaleString("en-GB", MOMENT) : "never");

const KINDS = { reconstruction: "Reconstruction", simulation: "Simulated scan", refraction: "Turntable", "geometry-field": "Geometry field" };
const METHODS = { sart: "SART", "gauss-newton": "Gauss–Newton" };
const PHANTOMS = { table7: "3-D breast phantom", detailed: "Detailed 2-D breast phantom", breast: "2-D breast with lesions" };

// A word of the service as a label: a kind by its name on the page, another by itself.
export function inWords(word) {
  return KINDS[word] ?? word.charAt(0).toUpperCase() + word.slice(1).replaceAll("-", " ");
}

// The request in a line, below the title of the job.
export function settingsOf({ kind, settings }) {
  if (kind === "geometry-field") return `${settings.samples} samples per edge, image of ${settings.image_size} pixels`;
  if (kind === "refraction") return `${settings.frames} frames of ${settings.width} × ${settings.height}, index ${settings.index.join(", ")}`;
  if (kind === "simulation") {
    const phantom = PHANTOMS[settings.phantom] ?? "2-D breast phantom";
    return `${phantom}, ${settings.waveform ? "traces" : "travel times"}, ${settings.elements} elements`;
  }
  if (kind !== "reconstruction") return "";
  const { method, rays, nodes, iterations = settings.sweeps } = settings; // sweeps: of earlier versions
  const words = { auto: "automatic", waveform: "full waveform" }[method] ?? `${METHODS[method]}, ${rays === "straight" ? "straight" : "bent"} rays`;
  const grid = nodes ? `${nodes} × ${nodes} nodes, ` : "";
  return `${words}, ${grid}${iterations} iterations`;
}

export function duration(seconds) {
  const whole = Math.round(seconds);
  if (seconds < 90) return `${seconds.toFixed(1)} s`;
  if (whole < 5400) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  return `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min`;
}

// A time of the service: of today without the date.
export function moment(text) {
  const time = new Date(text);
  const today = time.toDateString() === new Date().toDateString();
  return today ? `today, ${inTime(text).split(", ")[1]}` : inTime(text);
}

export const placeInQueue = (ahead) => (ahead ? `${counted(ahead, "job", "jobs")} before this one` : "Next in the queue");

// The plan of a job. job: as for POST /v1/jobs.
export const planOf = (job) => send("POST", "/v1/plans", job);

// Tens of seconds from half a minute on: the estimate is no better.
function roughly(minutes) {
  if (minutes < 0.5) return `${Math.max(1, Math.round(60 * minutes))} s`;
  if (minutes < 1.5) return `${10 * Math.round(6 * minutes)} s`;
  return minutes < 90 ? `${Math.round(minutes)} min` : `${(minutes / 60).toFixed(1)} h`;
}

// As ["about 2 min, rough", "after 1 queued job"].
function waitParts({ minutes, rough, ahead }) {
  const time = minutes === null ? "no estimate yet" : `about ${roughly(minutes)}${rough ? ", rough" : ""}`;
  return [time, ...(ahead ? [`after ${counted(ahead, "queued job", "queued jobs")}`] : [])];
}

// The time, and the place in the queue.
export const waitInWords = (estimate) => waitParts(estimate).join(", ");

export const tasksInWords = ({ tasks, largest_bytes: bytes }) => `${tasks} tasks of up to ${Math.ceil(bytes / 2 ** 20)} MiB`;

// The plan in a line: time, method, nodes, tasks and memory.
export function planInWords(estimate) {
  const { plan } = estimate;
  const methods = plan.methods.length > 1 ? `the best of ${plan.methods.length} candidates` : plan.methods[0];
  return [
    ...waitParts(estimate), methods, `${plan.nodes} nodes per side`, tasksInWords(plan), counted(plan.workers, "worker", "workers"),
  ].join(" · ");
}
