// Jobs in words: kinds and states, durations and times.
import { inTime } from "./amounts.js";

const KINDS = { reconstruction: "Reconstruction", simulation: "Simulated scan", refraction: "Turntable", "geometry-field": "Geometry field" };

// A word of the service as a label: a kind by its name on the page, another by itself.
export function inWords(word) {
  return KINDS[word] ?? word.charAt(0).toUpperCase() + word.slice(1).replaceAll("-", " ");
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
