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
// never arrive otherwise, unless a newer one was; a full picture under way is cancelled. handlers: { current } with onShown, called after each
// picture with { quality, rate }: previews per second, 0 for the first one of a motion; and onError(error), null after a picture.
export class PictureStream {
  constructor(canvas, handlers) {
    Object.assign(this, { canvas, handlers, underWay: new Set(), wanted: null, views: 0, shown: 0, waitUntil: 0, timer: 0 });
    // The time of the last picture, and of previews: when the last one came, and the mean interval; ms.
    Object.assign(this, { lastMs: Infinity, lastPreview: -Infinity, interval: 0 });
  }

  // Shows a view, which moves or has changed at once. preview, full: addresses of its pictures; drawHere, if given, draws the preview on the
  // canvas and returns whether it did.
  show({ preview, full, drawHere }, moving) {
    const { wanted } = this;
    if (!moving && wanted?.full === full && (wanted.shown === "full" || !wanted.moves)) return;
    this.views += 1;
    this.wanted = { preview, full, drawHere, moves: moving, moved: moving ? performance.now() : -Infinity, number: this.views, requested: "", shown: "" };
    for (const { quality, controller } of this.underWay) if (quality === "full") controller.abort();
    this.next();
  }

  close() {
    this.wanted = null;
    clearTimeout(this.timer);
    for (const { controller } of this.underWay) controller.abort();
  }

  next() {
    const { wanted } = this;
    clearTimeout(this.timer);
    if (!wanted || wanted.shown === "full" || wanted.requested === "full") return;
    const nextIn = (milliseconds) => {
      this.timer = setTimeout(() => this.next(), milliseconds);
    };
    const now = performance.now();
    const left = wanted.moved + REST_MS - now;
    const free = this.underWay.size < (this.lastMs < QUICK_MS ? MAX_UNDER_WAY : 1);
    if (now < this.waitUntil) nextIn(this.waitUntil - now);
    else if (wanted.moves && !wanted.requested && left > 0) {
      if (wanted.drawHere?.(this.canvas)) {
        wanted.requested = "preview";
        this.note(wanted, "preview", "browser");
        nextIn(left);
      } else if (free) this.start(wanted, "preview");
    } else if (left > 0) nextIn(left);
    else if (free) this.start(wanted, "full");
  }

  async start(view, quality) {
    const request = { controller: new AbortController(), quality };
    const { signal } = request.controller;
    this.underWay.add(request);
    view.requested = quality;
    const begun = performance.now();
    try {
      const bitmap = await createImageBitmap(await (await respond(view[quality], { signal })).blob());
      this.lastMs = performance.now() - begun;
      // It may come too late.
      if (!signal.aborted && view.number >= this.shown && view.shown !== "full") {
        [this.canvas.width, this.canvas.height] = [bitmap.width, bitmap.height];
        this.canvas.getContext("2d").drawImage(bitmap, 0, 0);
        this.note(view, quality, "service");
      }
      bitmap.close();
    } catch (error) {
      if (error.response?.status === 429) {
        view.requested = view.shown;
        this.waitUntil = performance.now() + Math.min(1000 * Number(error.response.headers.get("Retry-After") || 1), MAX_WAIT_MS);
      } else if (!signal.aborted) {
        view.shown = "full";
        if (this.wanted === view) this.handlers.current.onError(error);
      }
    }
    this.underWay.delete(request);
    this.next();
  }

  note(view, quality, source) {
    this.shown = view.number;
    view.shown = quality;
    Object.assign(this.canvas.dataset, { address: view[quality], quality, source, pictures: Number(this.canvas.dataset.pictures || 0) + 1 });
    this.handlers.current.onError(null);
    this.handlers.current.onShown({ quality, rate: quality === "preview" ? this.rate() : 0 });
  }

  // Previews per second.
  rate() {
    const now = performance.now();
    const since = now - this.lastPreview;
    this.lastPreview = now;
    if (since > QUICK_MS) this.interval = 0;
    else this.interval = this.interval ? (1 - NEWEST) * this.interval + NEWEST * since : since;
    return this.interval ? 1000 / this.interval : 0;
  }
}
