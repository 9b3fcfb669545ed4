// The menu of downloads of a result: every format, and a figure of the view with caption and citation.
import { figureOf, pngOf, svgOf } from "../viewer/figure.js";
import { queryOf } from "./address.js";
import { KeyLink, saveBlob } from "./key.js";
import { captionOf } from "./result_tables.js";
import { Alert, Button, CopyButton, html, Menu, Options, useAct, useState } from "./view.js";

export const FORMATS = await (await fetch("/static/export_formats.json")).json();
const WHOLE = FORMATS.filter(({ single }) => !single);
const SINGLE = FORMATS.filter(({ single }) => single);
const NAMES = {
  speed: "speed (m/s)", attenuation: "attenuation (Np/m)", coverage: "coverage (m)", recovery: "resolution",
  uncertainty: "uncertainty (m/s)", reflection: "reflection (dB)", truth: "truth (m/s)",
};
const DECIBEL = "attenuation-db";

// As in CITATION.cff, with the version that made a result.
const bibtexOf = (version) => `@software{bentray,
  author = {{The Bentray founders}},
  title = {Bentray: refraction-corrected ultrasound computed tomography as a distributed service},
  version = {${version}},
}
@phdthesis{li2008refraction,
  author = {Li, Shengying},
  title = {Refraction in Graphics and Medical Imaging},
  school = {Stony Brook University},
  year = {2008},
}
`;

// What stands in for the function of a viewer, see there, until it has its values.
export const undrawn = () => ({
  current() {
    throw new Error("The values are not read yet");
  },
});

// The figure of what a viewer shows. drawn: of it; results: that it shows; name: of the files.
export function FigureExport({ drawn, results, name }) {
  const [marked, setMarked] = useState(true);
  const [error, act] = useAct();
  const letter = (k) => (results.length > 1 ? `${"ABCD"[k]}: ` : "");
  const caption = () => `${drawn.current().words}. ${results.map((result, k) => letter(k) + captionOf(result)).join(" ")}`;
  const save = (ending, blobOf) => act(async () => saveBlob(await blobOf(figureOf(drawn.current(), caption(), marked)), `${name}.${ending}`));
  return html`
    <h2>Figure of this view, with caption</h2>
    <label><input type="checkbox" name="marked" checked=${marked} onChange=${({ target }) => setMarked(target.checked)} /> With what is measured, and a scale bar</label>
    <div class="links">
      <${Button} onClick=${() => save("svg", svgOf)}>SVG</${Button}>
      <${Button} onClick=${() => save("png", pngOf)}>PNG, 300 dpi</${Button}>
      <${CopyButton} title="Copy caption" text=${caption} />
      <${CopyButton} title="Copy BibTeX" text=${() => bibtexOf(results[0].volume.provenance.bentray)} />
    </div>
    <${Alert} error=${error} />`;
}

const Download = ({ href, children }) => html`<${KeyLink} href=${href} download="">${children}</${KeyLink}>`;

// drawn: see Viewer.
export function ExportMenu({ result, drawn }) {
  const { volume, summary: { quantities } } = result;
  const [quantity, setQuantity] = useState(quantities[0]);
  const { data } = volume.links;
  const query = quantity === DECIBEL ? { quantity: "attenuation", attenuation: "dB/cm/MHz" } : { quantity };
  const entries = quantities.map((name) => [name, NAMES[name]]);
  if (quantities.includes("attenuation") && volume.provenance.frequency_hz) entries.push([DECIBEL, "attenuation (dB/cm/MHz)"]);
  return html`<${Menu} title="Export" className="export">
    <div class="sheet">
      <h2>All quantities${quantities.includes("reflection") && " (reflection: HDF5)"}</h2>
      <div class="formats">
        ${WHOLE.map(({ format, title }) => html`<${Download} href=${`${data}?format=${format}`}>${title}</${Download}>`)}
      </div>
      <h2>One quantity</h2>
      <label>Quantity ${" "}
        <select onChange=${({ target }) => setQuantity(target.value)}><${Options} entries=${entries} chosen=${quantity} /></select></label>
      <div class="formats">
        ${SINGLE.map(({ format, title }) => html`<${Download} href=${`${data}?${queryOf({ format, ...query })}`}>${title}</${Download}>`)}
      </div>
      <${FigureExport} drawn=${drawn} results=${[result]} name=${volume.id} />
    </div>
  </${Menu}>`;
}
