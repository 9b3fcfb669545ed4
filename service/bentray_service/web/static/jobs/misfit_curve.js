// The misfit of a reconstruction after each iteration, as a curve with axes.
import { plot } from "../viewer/plot.js";
import { inNanoseconds } from "../parts/amounts.js";
import { make } from "../parts/dom.js";
import { residuals } from "./job_cards.js";

// Largest over smallest misfit above which a linear axis would show a flat line.
const STEEP = 20;

const WAITING = "The misfit of the first iteration follows";

// Whether several models are reconstructed side by side: then an iteration of a slice occurs more than once.
export function comparesModels(history) {
  const keys = history.map(({ slice, stage, sweep, of_attenuation: attenuation }) => [slice, stage, sweep, attenuation].join(" "));
  return new Set(keys).size < keys.length;
}

// Adds a figure to a place; show(history) draws it, unless nothing has changed.
export function misfitCurve(place) {
  const box = make("figure", "tile misfit");
  const hint = make("p", "hint", WAITING);
  box.append(make("figcaption", "facts", "Misfit: measured minus predicted travel time, rms; of full waveforms the equivalent time shift"), hint);
  place.append(box);
  let drawn = 0;

  return {
    show(history) {
      if (comparesModels(history)) {
        hint.textContent = "Candidate methods are compared; the curve is that of the chosen one.";
        hint.hidden = false;
        box.querySelector("svg")?.remove();
        drawn = 0;
        return;
      }
      const { values, begins } = residuals(history);
      if (values.length === drawn) return;
      drawn = values.length;
      box.querySelector("svg")?.remove();
      hint.hidden = drawn > 1;
      // One point is no curve.
      hint.textContent = drawn ? `${inNanoseconds(values[0])} in the first iteration` : WAITING;
      if (drawn < 2) return;
      const stages = begins.length ? ` in ${begins.length + 1} stages` : "";
      const label = `Misfit of ${drawn} iterations${stages}: ${inNanoseconds(values[0])} to ${inNanoseconds(values.at(-1))}`;
      const curve = { x: values.map((_, k) => k + 1), y: values.map((value) => 1e9 * value) };
      const logarithmic = Math.min(...values) > 0 && Math.max(...values) > STEEP * Math.min(...values);
      const picture = plot([curve], { across: "Iteration", up: "Misfit (ns)", label, whole: true, logarithmic });
      picture.dataset.points = drawn;
      hint.before(picture);
    },
  };
}
