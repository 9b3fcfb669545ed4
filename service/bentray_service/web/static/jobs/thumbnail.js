// A small picture of what a job made, beside its name in a list: it says nothing to a screen reader, which reads the name.
import { Picture } from "../parts/key.js";
import { html, useState } from "../parts/view.js";
import { queryOf } from "../parts/views.js";

export function Thumbnail({ job: { links: { field, image } } }) {
  const [failed, setFailed] = useState(false);
  const view = field ? { width: 96, height: 96, rays: 2 } : { frame: false, size: 96 };
  return image && !failed && html`<${Picture} class="thumbnail" address=${`${image}?${queryOf(view)}`} alt="" onError=${() => setFailed(true)} />`;
}
