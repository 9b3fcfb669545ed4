// A picture that follows a view: previews while it moves, the full picture once it rests; one request at a time.
import { inWords } from "./api.js";
import { authorization } from "./key.js";

// The view rests when it has not moved for this long.
const REST_MS = 150;
const MAX_WAIT_MS = 5000;

// Draws pictures of the service on a canvas. The newest view wins: a preview under way is still shown, since frames would
// never arrive otherwise, and a full picture under way is cancelled. onShown({ quality, ms }) is called after each picture.
export function pictureStream(canvas, { onShown = () => {}, onError = () => {} } = {}) {
  let wanted = null;
  let running = null;
  let timer = 0;
  let closed = false;

  async function draw(address, quality, signal) {
    const begun = performance.now();
    const response = await fetch(address, { headers: authorization(), signal });
    if (!response.ok) {
      const problem = await response.json().catch(() => ({ title: "No image", detail: `status ${response.status}` }));
      throw Object.assign(new Error(inWords(problem)), {
        retryMs: response.status === 429 ? 1000 * Number(response.headers.get("Retry-After") || 1) : null,
      });
    }
    const bitmap = await createImageBitmap(await response.blob());
    if (closed || signal.aborted) return;
    if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
    }
    canvas.getContext("2d").drawImage(bitmap, 0, 0);
    bitmap.close();
    canvas.dataset.address = address;
    canvas.dataset.quality = quality;
    canvas.dataset.pictures = Number(canvas.dataset.pictures || 0) + 1;
    onError(null);
    onShown({ quality, ms: performance.now() - begun });
  }

  async function start(view, quality) {
    const controller = new AbortController();
    running = { controller, quality };
    try {
      await draw(view[quality], quality, controller.signal);
      view.shown = quality;
    } catch (error) {
      if (!controller.signal.aborted) {
        if (error.retryMs) await new Promise((go) => setTimeout(go, Math.min(error.retryMs, MAX_WAIT_MS)));
        else {
          view.shown = "full";
          if (wanted === view && !closed) onError(error.name === "TypeError" ? new Error("The service does not answer.") : error);
        }
      }
    }
    running = null;
    next();
  }

  function next() {
    clearTimeout(timer);
    if (closed || running || !wanted || wanted.shown === "full") return;
    const left = wanted.moved + REST_MS - performance.now();
    if (wanted.preview && !wanted.shown && left > 0) start(wanted, "preview");
    else if (left > 0) timer = setTimeout(next, left);
    else start(wanted, "full");
  }

  return {
    // The view moves: addresses of its preview and of its full picture.
    move(preview, full) {
      wanted = { preview, full, moved: performance.now(), shown: "" };
      if (running?.quality === "full") running.controller.abort();
      next();
    },
    // The view has changed at once.
    set(full) {
      if (wanted?.full === full && (wanted.shown === "full" || !wanted.preview)) return;
      wanted = { preview: "", full, moved: -Infinity, shown: "" };
      if (running?.quality === "full") running.controller.abort();
      next();
    },
    close() {
      closed = true;
      clearTimeout(timer);
      running?.controller.abort();
    },
  };
}
