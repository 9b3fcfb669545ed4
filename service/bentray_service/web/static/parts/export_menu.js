// The menu of downloads of a result: every format, and the picture of the view.
import { make } from "./dom.js";
import { withKey } from "./key.js";
import { menuOf } from "./menu.js";
import { queryOf } from "./views.js";
import { QUANTITIES } from "../viewer/quantities.js";

const WHOLE = [["hdf5", "HDF5"], ["mat", "MATLAB"], ["vti", "VTK (ParaView)"], ["ome-zarr", "OME-Zarr"], ["dicom", "DICOM"]];
const SINGLE = [["npy", "NumPy"], ["nifti", "NIfTI"], ["nrrd", "NRRD"], ["metaimage", "MetaImage"]];
const NAMES = {
  speed: "speed (m/s)", attenuation: "attenuation (Np/m)", coverage: "coverage (m)", recovery: "resolution",
  uncertainty: "uncertainty (m/s)", reflection: "reflection (dB)", truth: "truth (m/s)",
};
const DECIBEL = "attenuation-db";

function link(title, address) {
  const anchor = make("a", "", title);
  anchor.href = address;
  anchor.download = "";
  // The key is added when it is followed; the address may change until then.
  return anchor;
}

function pictureOf({ volume }, state) {
  const [stored] = QUANTITIES[state.quantity].reads;
  if (stored === "truth") return null;
  const factor = QUANTITIES[state.quantity].factor ?? 1;
  const query = { quantity: stored, size: 1200, scale_bar: true };
  if (state.map && state.map !== "RdBu_r") query.colormap = state.map;
  if (state.window && state.quantity !== "error") [query.low, query.high] = state.window.map((one) => one / factor);
  if (volume.shape.length === 3) query.axis = state.axis;
  return `${volume.links.image}?${queryOf(query)}`;
}

export function exportMenu(result, state) {
  const { volume, summary } = result;
  const sheet = make("div");
  const menu = menuOf("Export", sheet, "export");
  const data = volume.links.data;
  const group = (title, nodes) => sheet.append(make("h2", "", title), ...nodes);
  group(summary.quantities.includes("reflection") ? "All quantities (reflection: HDF5)" : "All quantities", WHOLE.map(([format, title]) => withKey(link(title, `${data}?format=${format}`), `${data}?format=${format}`)));
  const label = make("label", "", "Quantity ");
  const choice = make("select");
  for (const one of summary.quantities) choice.append(new Option(NAMES[one], one));
  if (summary.quantities.includes("attenuation") && volume.provenance.frequency_hz) choice.append(new Option("attenuation (dB/cm/MHz)", DECIBEL));
  label.append(choice);
  const links = make("div", "single");
  const relink = () => {
    const query = choice.value === DECIBEL ? { quantity: "attenuation", attenuation: "dB/cm/MHz" } : { quantity: choice.value };
    links.replaceChildren(...SINGLE.map(([format, title]) => {
      const address = `${data}?${queryOf({ format, ...query })}`;
      return withKey(link(title, address), address);
    }));
  };
  choice.addEventListener("change", relink);
  relink();
  group("One quantity", [label, links]);
  const place = make("div");
  const address = () => pictureOf(result, state);
  menu.addEventListener("toggle", () => {
    const found = menu.open && address();
    place.replaceChildren(...(found ? [withKey(link("PNG of this quantity", found), found)] : [make("p", "facts", "No picture of this quantity")]));
  });
  group("Picture", [place]);
  return menu;
}
