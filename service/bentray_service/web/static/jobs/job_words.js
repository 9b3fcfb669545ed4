// Jobs in words: kinds, settings and states, durations, times and places in the queue.
import { inTime } from "../parts/amounts.js";

const KINDS = { reconstruction: "Reconstruction", simulation: "Simulated scan", refraction: "Turntable", "geometry-field": "Geometry field" };
const METHODS = { sart: "SART", "gauss-newton": "Gauss–Newton", auto: "Automatic", waveform: "Full waveform" };
const PHANTOMS = { table7: "3-D breast phantom", detailed: "Detailed 2-D breast phantom" };

// A word of the service as a label: a kind by its name on the page, another by itself.
export function inWords(word) {
  return KINDS[word] ?? word.charAt(0).toUpperCase() + word.slice(1).replaceAll("-", " ");
}

export function methodOf({ settings: { method, rays } }) {
  if (method === "auto" || method === "waveform") return METHODS[method];
  return `${METHODS[method] ?? method}, ${rays === "straight" ? "straight" : "bent"} rays`;
}

// The request in a heading and a line.
export function summaryOf({ kind, settings }) {
  if (kind === "geometry-field") return [KINDS[kind], `${settings.samples} samples per edge, image of ${settings.image_size} pixels`];
  if (kind === "refraction") return [KINDS[kind], `${settings.frames} frames of ${settings.width} × ${settings.height}, index ${settings.index.join(", ")}`];
  if (kind === "simulation") {
    const phantom = PHANTOMS[settings.phantom] ?? "2-D breast phantom";
    return [KINDS[kind], `${phantom}, ${settings.waveform ? "traces" : "travel times"}, ${settings.elements} elements`];
  }
  if (kind !== "reconstruction") return [inWords(kind), ""];
  const { method, rays, nodes, iterations = settings.sweeps } = settings; // sweeps: of earlier versions
  const words = { auto: "automatic", waveform: "full waveform" }[method] ?? METHODS[method];
  const grid = nodes ? `${nodes} × ${nodes} nodes, ` : "";
  return [method === "auto" ? METHODS.auto : rays === "straight" ? "Straight rays" : "Bent rays", `${words}, ${grid}${iterations} iterations`];
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

export function placeInQueue(ahead) {
  if (!ahead) return "Next in the queue";
  return ahead === 1 ? "1 job before this one" : `${ahead} jobs before this one`;
}
