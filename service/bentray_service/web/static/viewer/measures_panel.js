// The profile and the region of a view: their places in mm, plot and statistics, and CSV files of both.
import { saveBlob } from "../parts/key.js";
import { HeadedTable } from "../parts/tables.js";
import { Button, Facts, html } from "../parts/view.js";
import { NumberField } from "./controls.js";
import { profileOf, regionOf } from "./measures.js";
import { Plot } from "./plot.js";
import { shown } from "./quantities.js";

const ENDS = ["x from", "y from", "x to", "y to"];
const REGION_COLUMNS = ["image", "quantity_unit", "shape", "x0_mm", "y0_mm", "x1_mm", "y1_mm", "nodes", "area_mm2", "mean", "standard_deviation", "minimum", "maximum", "contrast", "uncertainty"];

const quoted = (text) => `"${String(text).replaceAll('"', '""')}"`;
const save = (name, rows) => saveBlob(new Blob([`${rows.map((row) => row.join(",")).join("\r\n")}\r\n`], { type: "text/csv" }), name);
const inUnit = ({ unit }) => (unit ? ` (${unit})` : "");

function saveProfile(curves, quantity) {
  const head = ["distance_mm", ...curves.map(({ title }) => quoted(`${title}${inUnit(quantity)}`))];
  const rows = curves[0].x.map((distance, k) => [distance, ...curves.map(({ y }) => y[k] ?? "")]);
  save("profile.csv", [head, ...rows]);
}

function saveRegion(found, { unit }, region) {
  const rows = found.map(({ title, statistics: s }) => [
    quoted(title), quoted(unit), region.shape, ...region.place, s.nodes, s.area, s.mean, s.deviation, s.minimum, s.maximum, s.contrast, s.uncertainty ?? "",
  ]);
  save("region.csv", [REGION_COLUMNS, ...rows]);
}

// A place that is measured, or null; onPlace(place) gets another one. hint: without a place.
function Measure({ title, hint, place, onPlace, onSave, children }) {
  const change = ({ currentTarget }) => {
    const values = [...currentTarget.querySelectorAll("input")].map((input) => input.valueAsNumber);
    if (values.every(Number.isFinite)) onPlace(values);
  };
  return html`<section class=${`measure ${title.toLowerCase()}`}>
    <h2>${title}</h2>
    <${Facts} hidden=${place !== null}>${hint}</${Facts}>
    <div class="place" onChange=${change}>
      ${ENDS.map((end, k) => html`<label>${end} <${NumberField} aria-label=${`${title}: ${end}, mm`} value=${place ? Number(place[k].toFixed(3)) : ""} /></label>`)}
    </div>
    ${place && html`
      <div class="measured">${children}</div>
      <div class="links"><${Button} onClick=${onSave}>Save as CSV</${Button}><${Button} onClick=${() => onPlace(null)}>Clear</${Button}></div>`}
  </section>`;
}

function Profile({ curves, place, quantity, onPlace }) {
  const found = place ? curves.map(({ title, plane }) => ({ title, ...profileOf(plane, place) })) : [];
  const length = place && Number(found[0].x.at(-1).toFixed(2));
  return html`<${Measure} title="Profile" hint="Choose Profile and drag a line, or enter its ends in mm." place=${place} onPlace=${onPlace}
    onSave=${() => saveProfile(found, quantity)}>
    <${Plot} curves=${found} across="distance (mm)" up=${`${quantity.words}${inUnit(quantity)}`} label=${`Profile of ${quantity.words} over ${length} mm`} />
    <p class="legend">${found.length > 1 && found.map(({ title }, k) => html`<span class=${`swatch swatch-${k}`}>${title}</span>`)}</p>
  </${Measure}>`;
}

function Statistics({ found, quantity }) {
  const unit = inUnit(quantity);
  const row = (title, name) => [`${title}${unit}`, ...found.map(({ statistics }) => (name in statistics ? shown(statistics[name], quantity) : "–"))];
  const rows = [
    row("Mean", "mean"),
    ...("uncertainty" in found[0].statistics ? [row("Uncertainty of the mean", "uncertainty")] : []),
    row("Standard deviation", "deviation"),
    row("Contrast to surroundings", "contrast"),
    ["Area (mm²)", ...found.map(({ statistics }) => statistics.area.toFixed(2))],
    ["Nodes", ...found.map(({ statistics }) => statistics.nodes)],
  ];
  // Four results are wider than a telephone.
  const columns = found.length > 1 ? ["", ...found.map(({ title }) => title)] : [];
  return html`<${HeadedTable} className="statistics" label="Statistics of the region" columns=${columns} rows=${rows} />`;
}

// beside: images whose region is measured, too, such as the truth. deviations: of the nodes of the first image, or null.
function Region({ curves, region, quantity, beside, deviations, onPlace }) {
  const named = beside.length ? curves.map((curve) => ({ ...curve, title: "Result" })) : curves;
  const measured = (plane) => regionOf(plane, region.shape, region.place);
  const found = region ? [...named, ...beside].map(({ title, plane }) => ({ title, statistics: measured(plane) })) : [];
  // As if the errors of all nodes were the same: see kernels/…/tomography/regions.py.
  if (region && deviations) found[0].statistics.uncertainty = measured(deviations).mean;
  return html`<${Measure} title="Region" hint="Choose Rectangle or Ellipse and drag, or enter its corners in mm." place=${region?.place ?? null} onPlace=${onPlace}
    onSave=${() => saveRegion(found, quantity, region)}>
    <${Statistics} found=${found} quantity=${quantity} />
  </${Measure}>`;
}

// curves: titles and planes of the images at the chosen axis.
export function Measures({ curves, state, quantity, beside, deviations, change }) {
  const onRegion = (place) => change({ region: place && { shape: state.region?.shape ?? "ellipse", place } });
  return html`<div class="measures">
    <${Profile} curves=${curves} place=${state.profile} quantity=${quantity} onPlace=${(place) => change({ profile: place })} />
    <${Region} curves=${curves} region=${state.region} quantity=${quantity} beside=${beside} deviations=${deviations} onPlace=${onRegion} />
  </div>`;
}
