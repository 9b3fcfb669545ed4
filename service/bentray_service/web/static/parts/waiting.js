// What a page waits for, in words: at once what it is, and soon how busy the workers are and how long it takes, if that was measured.
import { request } from "./api.js";
import { html, useRead, useRef } from "./view.js";
import { counted } from "./words.js";

// After the wait began, since most waits are shorter; and between two questions, of all that waits on a page together.
const [SOON_MS, AGAIN_MS] = [800, 1500];

let [answer, asked] = [null, -Infinity];

function cluster() {
  if (performance.now() - asked > 0.8 * AGAIN_MS) [answer, asked] = [request("/v1/cluster"), performance.now()];
  return answer;
}

// Of what workers draw or compute for a page; "" where no worker is at it.
export function drawingInWords({ workers, queue: { waiting_images: waiting, drawing_workers: busy, images_s: seconds } }) {
  if (!workers.length) return "no worker is connected";
  if (workers.every(({ compiling }) => compiling)) return "the workers compile kernels for this processor, once";
  const time = seconds === null ? "" : `, about ${Math.ceil(seconds)} s`;
  if (waiting) return `waiting for a worker: ${busy} of ${workers.length} busy${time}`;
  return busy ? `a worker computes it${time}` : "";
}

// Of a job that is queued, or whose first task has not ended.
export function jobsInWords({ workers, queue: { all_running: running } }) {
  if (!workers.length) return "no worker is connected";
  return `${counted(running, "job runs", "jobs run")} on ${counted(workers.length, "worker", "workers")}`;
}

// busyInWords: of an answer of GET /v1/cluster.
export function Waiting({ words, busyInWords = drawingInWords, ...more }) {
  const element = useRef(null);
  // What is not seen, such as a picture far below, is not asked for either.
  const seen = () => element.current.getBoundingClientRect().top < innerHeight;
  const [found] = useRead(() => (seen() ? cluster() : null), { settle: SOON_MS, waitOf: () => AGAIN_MS });
  return html`<p class="facts" ref=${element} ...${more}>${[words, found && busyInWords(found)].filter(Boolean).join(" · ")}</p>`;
}
