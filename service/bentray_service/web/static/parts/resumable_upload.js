// Uploads that go on after a broken connection, a restart of the service or a reload of the page (tus 1.0).
import { inWords, request } from "./api.js";
import { authorization } from "./key.js";

const VERSION = { "Tus-Resumable": "1.0.0" };
const PIECE = 8 * 2 ** 20;
// Waits before the next try, and the time without progress after which an upload is given up for now, ms.
const WAITS = [500, 1000, 2000, 4000, 8000];
const PATIENCE = 120_000;
// Between two questions whether a file is stored, the first and the longest; each is twice the one before.
const POLLS = [40, 300];

const NOUNS = { dataset: "a scan", volume: "a volume", mesh: "a mesh" };

const wait = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

// A failure that passes: no answer, an upload that is locked by a lost connection, a busy service.
class Passing extends Error {}

function base64(text) {
  return btoa(String.fromCharCode(...new TextEncoder().encode(text)));
}

// The address of an unfinished upload of the same file. Private windows may have no storage.
const unfinished = {
  key: (file, metadata) => `upload ${JSON.stringify([file.name, file.size, file.lastModified, metadata])}`,
  get(key) {
    try {
      return localStorage.getItem(key);
    } catch {
      return null;
    }
  },
  set(key, address) {
    try {
      if (address) localStorage.setItem(key, address);
      else localStorage.removeItem(key);
    } catch {
      // The upload can then be continued on this page only.
    }
  },
};

// One request with its progress, which fetch() does not tell.
function send(method, address, headers, body, onSent = () => {}) {
  return new Promise((resolve, reject) => {
    const sender = new XMLHttpRequest();
    sender.open(method, address);
    for (const [name, value] of Object.entries({ ...VERSION, ...headers, ...authorization() })) sender.setRequestHeader(name, value);
    sender.upload.onprogress = (event) => onSent(event.loaded);
    sender.onerror = () => reject(new Passing("The service does not answer."));
    sender.onload = () => {
      if (sender.status < 300) return resolve(sender);
      if (sender.status === 423 || sender.status === 429 || sender.status >= 500) return reject(new Passing(said(sender)));
      const error = new Error(said(sender));
      error.status = sender.status;
      return reject(error);
    };
    sender.send(body);
  });
}

function said(sender) {
  try {
    return inWords(JSON.parse(sender.responseText));
  } catch {
    return `The service answered ${sender.status}.`;
  }
}

async function create(file, metadata) {
  const pairs = Object.entries(metadata).map(([name, value]) => `${name} ${base64(value)}`);
  const answer = await send("POST", "/v1/uploads", { "Upload-Length": file.size, "Upload-Metadata": pairs.join(",") }, null);
  return new URL(answer.getResponseHeader("Location"), window.location.href).pathname;
}

async function progressOf(address) {
  const answer = await send("HEAD", address, {}, null);
  return { offset: Number(answer.getResponseHeader("Upload-Offset")), state: answer.getResponseHeader("Bentray-State") };
}

// The address of an upload that has begun and the bytes that it has, or of a new one.
async function begin(file, metadata, key) {
  const earlier = unfinished.get(key);
  if (earlier) {
    try {
      const { offset, state } = await progressOf(earlier);
      if (state === "receiving") return { address: earlier, offset };
    } catch (error) {
      // It has expired, or belongs to another key.
      if (error instanceof Passing) throw error;
    }
  }
  const address = await create(file, metadata);
  unfinished.set(key, address);
  return { address, offset: 0 };
}

// Sends a file. metadata: kind (dataset, volume or mesh), title and what the file does not state, as strings.
// onProgress(share, words): from 0 to 1. Gives the stored record; the error of a refused file has its problem.
export async function resumableUpload(file, metadata, onProgress) {
  const key = unfinished.key(file, metadata);
  let place = null;
  let tries = 0;
  let moved = Date.now();
  while (place === null || place.offset < file.size) {
    try {
      place ??= await begin(file, metadata, key);
      onProgress(place.offset / file.size, tries || place.offset ? `Continuing ${file.name}` : `Sending ${file.name}`);
      const piece = file.slice(place.offset, place.offset + PIECE);
      const headers = { "Content-Type": "application/offset+octet-stream", "Upload-Offset": place.offset };
      const before = place.offset;
      const answer = await send("PATCH", place.address, headers, piece, (sent) => onProgress((before + sent) / file.size, `Sending ${file.name}`));
      place.offset = Number(answer.getResponseHeader("Upload-Offset"));
      tries = 0;
      moved = Date.now();
    } catch (error) {
      if (!(error instanceof Passing) && error.status !== 409) throw error;
      if (Date.now() - moved > PATIENCE) throw new Error(`${error.message} Choose the same file again to continue.`);
      onProgress(place ? place.offset / file.size : 0, `${error.message} Trying again`);
      await wait(WAITS[Math.min(tries, WAITS.length - 1)]);
      tries += 1;
      if (place) ({ offset: place.offset } = await progressOf(place.address).catch(() => place));
    }
  }
  onProgress(1, `Checking ${file.name}`);
  const record = await ingested(place.address);
  unfinished.set(key, null);
  if (record.state === "refused") {
    const words = `${file.name} is not ${NOUNS[metadata.kind]} that can be read. ${inWords(record.problem)}`;
    throw Object.assign(new Error(words), { problem: record.problem });
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
    await wait(pause);
    pause = Math.min(2 * pause, POLLS[1]);
  }
}
