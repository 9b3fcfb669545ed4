// Previews that the graphics card of this browser draws while a view moves; the service draws where it cannot or is slow.
import { queryOf } from "../parts/address.js";
import { respond } from "../parts/api.js";
import { parseNpy } from "../viewer/npy.js";
import { hasFilter, hasGraphicsCard, MAX_ISOS, rayCaster } from "./ray_caster.js";

// Slower than 10 previews a second, by the mean of some, it is not used again.
const SLOW_MS = 100;
const JUDGED = 3;
// Before, one of fewer pixels shows that it will not be much slower.
const TRIAL_PX = 64;
const TRIAL_MS = SLOW_MS / 4;
const DEFAULT_FILTER = "bspline3";

export function localPreviews() {
  let caster = null;
  let loaded = "";
  let useless = false;
  let taken = [];

  async function load(key, volume, view, filter, smoothing) {
    loaded = key;
    useless ||= !hasGraphicsCard();
    if (useless) return;
    caster?.close();
    caster = null;
    try {
      const query = queryOf({ filter, smoothing: smoothing ?? null });
      const { values, shape } = parseNpy(await (await respond(`${volume.links.coefficients}?${query}`)).arrayBuffer());
      if (loaded !== key) return;
      const made = rayCaster(document.createElement("canvas"), { values, shape, spacing: volume.spacing_m, filter });
      // The first picture waits for the driver, and says nothing of the others.
      made.draw({ ...view, width: 1, height: 1 });
      useless = made.draw({ ...view, width: TRIAL_PX, height: TRIAL_PX }) > TRIAL_MS;
      if (useless) made.close();
      else caster = made;
      taken = [];
    } catch (error) {
      // What the service refuses says nothing of the graphics card.
      useless = !error.problem;
    }
  }

  return {
    // A function that draws a view of a volume on a canvas and returns whether it did; null where the service draws it. iso
    // and index are lists, known for sure.
    drawer(volume, { iso, index, filter = DEFAULT_FILTER, smoothing, mode, backdrop, ...camera }, pixels) {
      const can = hasFilter(filter) && iso.length > 0 && iso.length <= MAX_ISOS && (mode === "shaded" || backdrop === "checkerboard");
      if (useless || !can || !volume.links.coefficients) return null;
      const key = `${volume.id} ${filter} ${smoothing}`;
      if (loaded !== key) load(key, volume, { ...camera, mode, iso, index }, filter, smoothing);
      const ready = caster;
      if (!ready) return null;
      return (target) => {
        let ms = Infinity;
        try {
          ms = ready.draw({ ...camera, mode, iso, index, width: pixels, height: pixels });
        } catch {
          useless = true;
          return false;
        }
        target.width = pixels;
        target.height = pixels;
        target.getContext("2d").drawImage(ready.canvas, 0, 0);
        taken = [...taken.slice(1 - JUDGED), ms];
        useless = taken.length === JUDGED && taken.reduce((sum, one) => sum + one, 0) > JUDGED * SLOW_MS;
        return true;
      };
    },
    close() {
      useless = true;
      loaded = "";
      caster?.close();
    },
  };
}
