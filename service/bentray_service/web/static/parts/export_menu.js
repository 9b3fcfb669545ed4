// The menu of downloads of a result: every format, and the picture of the view.
import { QUANTITIES } from "../viewer/quantities.js";
import { queryOf } from "./address.js";
import { KeyLink } from "./key.js";
import { Facts, html, Menu, Options, useState } from "./view.js";

export const FORMATS = await (await fetch("/static/export_formats.json")).json();
const WHOLE = FORMATS.filter(({ single }) => !single);
const SINGLE = FORMATS.filter(({ single }) => single);
const NAMES = {
  speed: "speed (m/s)", attenuation: "attenuation (Np/m)", coverage: "coverage (m)", recovery: "resolution",
  uncertainty: "uncertainty (m/s)", reflection: "reflection (dB)", truth: "truth (m/s)",
};
const DECIBEL = "attenuation-db";

function pictureOf({ volume }, state) {
  const { reads: [stored], factor = 1 } = QUANTITIES[state.quantity];
  if (stored === "truth") return null;
  const query = { quantity: stored, size: 1200, scale_bar: true };
  if (state.map && state.map !== "RdBu_r") query.colormap = state.map;
  if (state.window && state.quantity !== "error") [query.low, query.high] = state.window.map((limit) => limit / factor);
  if (volume.shape.length === 3) query.axis = state.axis;
  return `${volume.links.image}?${queryOf(query)}`;
}

const Download = ({ href, children }) => html`<${KeyLink} href=${href} download="">${children}</${KeyLink}>`;

// state: of the viewer, which goes on changing.
export function ExportMenu({ result, state }) {
  const { volume, summary: { quantities } } = result;
  const [quantity, setQuantity] = useState(quantities[0]);
  const [picture, setPicture] = useState(null);
  const { data } = volume.links;
  const query = quantity === DECIBEL ? { quantity: "attenuation", attenuation: "dB/cm/MHz" } : { quantity };
  const entries = quantities.map((name) => [name, NAMES[name]]);
  if (quantities.includes("attenuation") && volume.provenance.frequency_hz) entries.push([DECIBEL, "attenuation (dB/cm/MHz)"]);
  return html`<${Menu} title="Export" className="export" onOpen=${() => setPicture(pictureOf(result, state))}>
    <div class="sheet">
      <h2>All quantities${quantities.includes("reflection") && " (reflection: HDF5)"}</h2>
      ${WHOLE.map(({ format, title }) => html`<${Download} href=${`${data}?format=${format}`}>${title}</${Download}>`)}
      <h2>One quantity</h2>
      <label>Quantity ${" "}
        <select onChange=${({ target }) => setQuantity(target.value)}><${Options} entries=${entries} chosen=${quantity} /></select></label>
      <div class="single">
        ${SINGLE.map(({ format, title }) => html`<${Download} href=${`${data}?${queryOf({ format, ...query })}`}>${title}</${Download}>`)}
      </div>
      <h2>Picture</h2>
      ${picture ? html`<${Download} href=${picture}>PNG of this quantity</${Download}>` : html`<${Facts}>No picture of this quantity</${Facts}>`}
    </div>
  </${Menu}>`;
}
