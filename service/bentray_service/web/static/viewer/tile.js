// One image of the viewer: a canvas that is pointed at, below it its title.
import { html, useLayoutEffect, useNewest, useRef } from "../parts/view.js";
import { ImageView } from "./image_view.js";
import { Pointing } from "./pointing.js";

// image: as for ImageView.show; actionsOf(view): what pointers and keys do, see pointing.js. grip: whether dragging does not scroll the page.
export function Tile({ title, words, image: { plane, ...look }, grip, actionsOf }) {
  const [canvas, view, actions] = [useRef(null), useRef(null), useNewest(null)];
  useLayoutEffect(() => {
    view.current = new ImageView(canvas.current);
    new Pointing(canvas.current, view.current, actions);
    return () => view.current.close();
  }, []);
  useLayoutEffect(() => {
    actions.current = actionsOf(view.current);
    view.current.show(plane, look);
  });
  const label = `Image of ${words}${title && `, ${title}`}; arrow keys move the cursor`;
  return html`<figure class="tile">
    <canvas ref=${canvas} class=${grip ? "plane grip" : "plane"} tabindex="0" role="application" aria-roledescription="image" aria-label=${label}></canvas>
    ${title && html`<figcaption>${title}</figcaption>`}
  </figure>`;
}
