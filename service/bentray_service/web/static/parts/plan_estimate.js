// What a job would be and how long it would take, asked before it is started.
import { send } from "./api.js";

// job: as for POST /v1/jobs.
export function planOf(job) {
  return send("POST", "/v1/plans", job);
}

function time(minutes) {
  if (minutes < 1.5) {
    const seconds = 60 * minutes;
    // Tens of seconds from half a minute on: the estimate is no better.
    return seconds < 30 ? `${Math.max(1, Math.round(seconds))} s` : `${10 * Math.round(seconds / 10)} s`;
  }
  return minutes < 90 ? `${Math.round(minutes)} min` : `${(minutes / 60).toFixed(1)} h`;
}

// As "about 2 min, rough".
function timeInWords({ minutes, rough }) {
  if (minutes === null) return "no estimate yet";
  return `about ${time(minutes)}${rough ? ", rough" : ""}`;
}

function queueInWords({ ahead }) {
  if (!ahead) return "";
  return ahead === 1 ? "after 1 queued job" : `after ${ahead} queued jobs`;
}

// The time, and the place in the queue.
export const waitInWords = (estimate) => [timeInWords(estimate), queueInWords(estimate)].filter(Boolean).join(", ");

// The plan in a line: time, method, nodes, tasks and memory.
export function planInWords(estimate) {
  const { plan } = estimate;
  const memory = `${Math.ceil(plan.largest_bytes / 2 ** 20)} MiB`;
  const methods = plan.methods.length > 1 ? `the best of ${plan.methods.length} candidates` : plan.methods[0];
  const workers = plan.workers === 1 ? "1 worker" : `${plan.workers} workers`;
  return [timeInWords(estimate), queueInWords(estimate), methods, `${plan.nodes} nodes per side`, `${plan.tasks} tasks of up to ${memory}`, workers]
    .filter(Boolean)
    .join(" · ");
}
