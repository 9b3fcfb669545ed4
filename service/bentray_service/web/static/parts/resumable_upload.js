// Uploads that go on after a broken connection, a restart of the service or a reload of the page (tus 1.0).
import "../vendor/tus.min.js";
import { authorization, inWords, request } from "./api.js";

const PIECE = 8 * 2 ** 20;
// Waits before the next try, ms: after two minutes without progress an upload is given up for now.
const WAITS = [500, 1000, 2000, 4000, ...Array(14).fill(8000)];
// Between two questions whether a file is stored, the first and the longest, ms; each is twice the one before.
const POLLS = [40, 300];

// Whether a failure passes: no answer, another offset, an upload that is locked by a lost connection, a busy service.
const passes = (status) => !status || [409, 423, 429].includes(status) || status >= 500;
const statusOf = (error) => error.originalResponse?.getStatus();

function wordsOf(error) {
  if (!error.originalResponse) return "The service does not answer.";
  try {
    return inWords(JSON.parse(error.originalResponse.getBody()));
  } catch {
    return `The service answered ${statusOf(error)}.`;
  }
}

// Gives the address of the upload once the service has the whole file.
function send(file, metadata, onProgress) {
  return new Promise((resolve, reject) => {
    let share = 0;
    const upload = new window.tus.Upload(file, {
      endpoint: "/v1/uploads",
      chunkSize: PIECE,
      metadata: { filename: file.name, ...metadata },
      headers: authorization(),
      retryDelays: WAITS,
      removeFingerprintOnSuccess: true,
      fingerprint: async () => `upload ${JSON.stringify([file.name, file.size, file.lastModified, metadata])}`,
      onProgress(sent, size) {
        share = sent / size;
        onProgress(share, `Sending ${file.name}`);
      },
      // Else tus-js-client begins a new upload where a proxy answers for a service that restarts.
      onAfterResponse(asked, answer) {
        if (asked.getMethod() === "HEAD" && passes(answer.getStatus())) throw new Error(`status ${answer.getStatus()}`);
      },
      onShouldRetry(error) {
        const passing = passes(statusOf(error));
        if (passing) onProgress(share, `${wordsOf(error)} Trying again`);
        return passing;
      },
      onError: (error) => reject(new Error(`${wordsOf(error)}${passes(statusOf(error)) ? " Choose the same file again to continue." : ""}`)),
      onSuccess: () => resolve(new URL(upload.url, location.href).pathname),
    });
    upload.findPreviousUploads().then(([earlier]) => {
      if (earlier) upload.resumeFromPreviousUpload(earlier);
      onProgress(0, `${earlier ? "Continuing" : "Sending"} ${file.name}`);
      upload.start();
    });
  });
}

// Sends a file. metadata: kind (dataset, volume or mesh), title and what the file does not state, as strings.
// onProgress(share, words): from 0 to 1. Gives the stored record; the error of a refused file has its problem.
export async function resumableUpload(file, metadata, onProgress) {
  const address = await send(file, metadata, onProgress);
  onProgress(1, `Checking ${file.name}`);
  const record = await ingested(address);
  if (record.state === "refused") {
    throw Object.assign(new Error(inWords(record.problem)), { problem: record.problem });
  }
  return request(record.links.result);
}

// The record of an upload once it is stored or refused; a restarted service goes on by itself.
async function ingested(address) {
  let [pause] = POLLS;
  for (let failures = 0; ; ) {
    try {
      const record = await request(address);
      if (record.state === "done" || record.state === "refused") return record;
      failures = 0;
    } catch (error) {
      failures += 1;
      if (failures > 100) throw error;
    }
    await new Promise((resolve) => setTimeout(resolve, pause));
    pause = Math.min(2 * pause, POLLS[1]);
  }
}
