// Two to four results with one range of colours and one cursor: side by side, as difference, or with a border to swipe.
import { keepQuery } from "../parts/address.js";
import { make } from "../parts/dom.js";
import { facts } from "../parts/result_tables.js";
import { loadResult, methodOf, nameOf } from "../parts/results.js";
import { stateOf } from "../viewer/state.js";
import { viewer } from "../viewer/viewer.js";

const LETTERS = "ABCD";
const MOST = LETTERS.length;

export async function open(root, { id, query }) {
  const ids = [...new Set(id.split(","))];
  if (ids.length < 2 || ids.length > MOST) throw new Error(`A comparison needs two to ${MOST} results, not ${ids.length}`);
  const results = await Promise.all(ids.map(loadResult));
  const dimensions = new Set(results.map((one) => one.volume.shape.length));
  if (dimensions.size > 1) throw new Error("An image and a volume cannot be compared");
  document.title = "Comparison – Bentray";
  root.classList.add("wide");
  const list = make("ol", "compared");
  results.forEach((one, k) => {
    const link = make("a", "", `${LETTERS[k]}: ${nameOf(one)}, ${methodOf(one.job)}`);
    link.href = `#/jobs/${one.job.id}`;
    const item = make("li");
    item.append(link, make("p", "facts", facts(one)));
    list.append(item);
  });
  const place = make("section");
  place.setAttribute("aria-label", "Images");
  root.append(make("h1", "", "Comparison"), list, place);
  const panes = results.map((one, k) => ({ title: `${LETTERS[k]} ${methodOf(one.job)}`, values: one.values, stored: one.summary.quantities }));
  return viewer(place, panes, stateOf(query), keepQuery).close;
}
