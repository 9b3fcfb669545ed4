// A picture that follows a view: previews while it moves, the full picture once it rests.
import { respond } from "../parts/api.js";

// The view rests when it has not moved for this long.
const REST_MS = 150;
const MAX_WAIT_MS = 5000;
// Two requests, so that one picture is drawn while the other one travels; while pictures take long, e.g. the first ones of a
// volume, only one.
const MAX_UNDER_WAY = 2;
const QUICK_MS = 1000;
// Share of the newest interval in the mean rate of previews.
const NEWEST = 0.2;

// The rate of previews in words, behind a description of the view.
export const rateOf = (rate) => ` · preview${rate ? ` · ${Math.round(rate)} frames/s` : ""}`;

// Draws pictures of the service on a canvas. The newest view wins: a preview under way is still shown, since frames would
// never arrive otherwise, unless a newer one was; a full picture under way is cancelled. After each picture onShown is called
// with { quality, rate }: previews per second, 0 for the first one of a motion.
export function pictureStream(canvas, { onShown = () => {}, onError = () => {} } = {}) {
  const underWay = new Set();
  let wanted = null;
  let views = 0;
  let shown = 0;
  let lastMs = Infinity;
  let lastPreview = -Infinity;
  let interval = 0;
  let waitUntil = 0;
  let timer = 0;
  let closed = false;

  async function draw(view, quality, signal) {
    const begun = performance.now();
    const response = await respond(view[quality], { signal });
    const bitmap = await createImageBitmap(await response.blob());
    lastMs = performance.now() - begun;
    present(view, quality, bitmap, signal);
  }

  // Show a picture of the service, unless it comes too late.
  function present(view, quality, bitmap, signal) {
    const late = view.number < shown || view.shown === "full";
    if (closed || signal.aborted || late) {
      bitmap.close();
      return;
    }
    if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
    }
    canvas.getContext("2d").drawImage(bitmap, 0, 0);
    bitmap.close();
    note(view, quality, "service");
  }

  function note(view, quality, source) {
    shown = view.number;
    view.shown = quality;
    canvas.dataset.address = view[quality];
    canvas.dataset.quality = quality;
    canvas.dataset.source = source;
    canvas.dataset.pictures = Number(canvas.dataset.pictures || 0) + 1;
    onError(null);
    onShown({ quality, rate: quality === "preview" ? rate() : 0 });
  }

  function rate() {
    const now = performance.now();
    const since = now - lastPreview;
    lastPreview = now;
    if (since > QUICK_MS) interval = 0;
    else interval = interval ? (1 - NEWEST) * interval + NEWEST * since : since;
    return interval ? 1000 / interval : 0;
  }

  async function start(view, quality) {
    const one = { controller: new AbortController(), quality };
    underWay.add(one);
    view.requested = quality;
    try {
      await draw(view, quality, one.controller.signal);
    } catch (error) {
      if (!one.controller.signal.aborted) {
        if (error.response?.status === 429) {
          view.requested = view.shown;
          waitUntil = performance.now() + Math.min(1000 * Number(error.response.headers.get("Retry-After") || 1), MAX_WAIT_MS);
        } else {
          view.shown = "full";
          if (wanted === view && !closed) onError(error);
        }
      }
    }
    underWay.delete(one);
    next();
  }

  function next() {
    clearTimeout(timer);
    if (closed || !wanted || wanted.shown === "full" || wanted.requested === "full") return;
    const now = performance.now();
    if (now < waitUntil) {
      timer = setTimeout(next, waitUntil - now);
      return;
    }
    const left = wanted.moved + REST_MS - now;
    const free = underWay.size < (lastMs < QUICK_MS ? MAX_UNDER_WAY : 1);
    if (wanted.preview && !wanted.requested && left > 0) {
      if (wanted.drawHere?.(canvas)) {
        wanted.requested = "preview";
        note(wanted, "preview", "browser");
        timer = setTimeout(next, left);
      } else if (free) start(wanted, "preview");
    } else if (left > 0) timer = setTimeout(next, left);
    else if (free) start(wanted, "full");
  }

  function want(preview, full, moved, drawHere = null) {
    views += 1;
    wanted = { preview, full, moved, drawHere, number: views, requested: "", shown: "" };
    for (const one of underWay) if (one.quality === "full") one.controller.abort();
    next();
  }

  return {
    // The view moves: addresses of its preview and of its full picture; drawHere, if given, draws the preview on the canvas
    // and returns whether it did.
    move(preview, full, drawHere = null) {
      want(preview, full, performance.now(), drawHere);
    },
    // The view has changed at once.
    set(full) {
      if (wanted?.full === full && (wanted.shown === "full" || !wanted.preview)) return;
      want("", full, -Infinity);
    },
    close() {
      closed = true;
      clearTimeout(timer);
      for (const one of underWay) one.controller.abort();
    },
  };
}
