// What is measured in a view: distances, angles and areas, a profile, a region; each can be copied and saved as CSV.
import { saveBlob } from "../parts/key.js";
import { Button, CopyButton, Facts, HeadedTable, html, useMemo } from "../parts/view.js";
import { NumberField } from "./controls.js";
import { AXES } from "./field.js";
import { flat, MEASURES, outlineOf, profileOf, regionOf, valueOf } from "./measures.js";
import { Plot } from "./plot.js";
import { shown } from "./quantities.js";

const ENDS = ["x from", "y from", "x to", "y to"];
const REGION_COLUMNS = ["image", "quantity_unit", "shape", "x0_mm", "y0_mm", "x1_mm", "y1_mm", "nodes", "area_mm2", "mean", "standard_deviation", "standard_error", "minimum", "maximum", "contrast", "uncertainty"];
const MEASURE_COLUMNS = ["kind", "value", "unit", "mean", "standard_deviation", "standard_error", "nodes", "quantity_unit", "points_mm"];

const quoted = (text) => `"${String(text).replaceAll('"', '""')}"`;
const csvOf = (rows) => `${rows.map((row) => row.join(",")).join("\r\n")}\r\n`;
const inUnit = ({ unit }) => (unit ? ` (${unit})` : "");

function profileRows(curves, quantity) {
  const head = ["distance_mm", ...curves.map(({ title }) => quoted(`${title}${inUnit(quantity)}`))];
  const rows = curves[0].x.map((distance, k) => [distance, ...curves.map(({ y }) => y[k] ?? "")]);
  return [head, ...rows];
}

function regionRows(found, { unit }, region) {
  const rows = found.map(({ title, statistics: s }) => [
    quoted(title), quoted(unit), region.shape, ...region.place, s.nodes, s.area, s.mean, s.deviation, s.standardError, s.minimum, s.maximum, s.contrast, s.uncertainty ?? "",
  ]);
  return [REGION_COLUMNS, ...rows];
}

function measureRows(measured, { unit }) {
  const rows = measured.map(({ kind, points, value, inside }) => [
    kind, value, MEASURES[kind].unit, inside?.mean ?? "", inside?.deviation ?? "", inside?.standardError ?? "", inside?.nodes ?? "", inside ? quoted(unit) : "",
    quoted(points.map((point) => point.map((one) => Number(one.toFixed(4))).join(" ")).join("; ")),
  ]);
  return [MEASURE_COLUMNS, ...rows];
}

// rows(): of the table to copy or save.
function CsvLinks({ name, rows, onClear }) {
  const save = () => saveBlob(new Blob([csvOf(rows())], { type: "text/csv" }), `${name}.csv`);
  return html`<div class="links">
    <${CopyButton} title="Copy as CSV" text=${() => csvOf(rows())} />
    <${Button} onClick=${save}>Save as CSV</${Button}>
    <${Button} onClick=${onClear}>Clear</${Button}>
  </div>`;
}

// A place that is measured, or null; onPlace(place) gets another one. hint: without a place.
function Measure({ title, hint, place, onPlace, rows, children }) {
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
      <${CsvLinks} name=${title.toLowerCase()} rows=${rows} onClear=${() => onPlace(null)} />`}
  </section>`;
}

function Profile({ curves, place, quantity, onPlace }) {
  const found = place ? curves.map(({ title, plane }) => ({ title, ...profileOf(plane, place) })) : [];
  const length = place && Number(found[0].x.at(-1).toFixed(2));
  return html`<${Measure} title="Profile" hint="Drag a line, or enter its ends in mm." place=${place} onPlace=${onPlace}
    rows=${() => profileRows(found, quantity)}>
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
    row("Standard error of the mean", "standardError"),
    row("Contrast to surroundings", "contrast"),
    ["Area (mm²)", ...found.map(({ statistics }) => statistics.area.toFixed(2))],
    ["Nodes", ...found.map(({ statistics }) => statistics.nodes)],
  ];
  // Four results are wider than a telephone.
  const columns = found.length > 1 ? ["", ...found.map(({ title }) => title)] : [];
  return html`<${HeadedTable} className="statistics" label="Statistics of the region" columns=${columns} rows=${rows} />`;
}

// beside: images whose region is measured, too, such as the truth. deviations: of the nodes of the first image, or null.
function Region({ curves, region, quantity, beside, deviations, detail, onPlace }) {
  const named = beside.length ? curves.map((curve) => ({ ...curve, title: "Result" })) : curves;
  const measured = (plane) => regionOf(plane, region.shape, region.place, detail);
  const found = region ? [...named, ...beside].map(({ title, plane }) => ({ title, statistics: measured(plane) })) : [];
  // As if the errors of all nodes were the same: see kernels/…/tomography/regions.py.
  if (region && deviations) found[0].statistics.uncertainty = measured(deviations).mean;
  return html`<${Measure} title="Region" hint="Drag, or enter its corners in mm." place=${region?.place ?? null} onPlace=${onPlace}
    rows=${() => regionRows(found, quantity, region)}>
    <${Statistics} found=${found} quantity=${quantity} />
  </${Measure}>`;
}

// Distances, angles and areas in a list; each area with the values in it. main: the field of the first image.
function List({ measures, main, detail, quantity, change }) {
  const measured = useMemo(() => measures.map((measure) => {
    const { kind, axis, points } = measure;
    const planeOf = ([point]) => main.plane(axis, main.nearest(axis, point[AXES.indexOf(axis)]));
    const inside = kind === "area" ? outlineOf(planeOf(points), flat(points, axis), detail) : null;
    return { ...measure, value: valueOf(measure), inside: inside?.nodes ? inside : null };
  }), [measures, main]);
  if (!measures.length) return null;
  const wordsOf = ({ kind, value, inside }) => html`${value.toFixed(kind === "angle" ? 1 : 2)} ${MEASURES[kind].unit}
    ${inside && html`<small>${[
      `${shown(inside.mean, quantity)} ± ${shown(inside.deviation, quantity)} ${quantity.unit}`, `standard error ${shown(inside.standardError, quantity)}`,
      `${inside.nodes} nodes`,
    ].join(", ")}</small>`}`;
  const remove = (number) => change({ measures: measures.filter((_, k) => k !== number) });
  return html`<section class="measure list">
    <h2>Measured</h2>
    <${HeadedTable} className="statistics" label="What is measured" rows=${measured.map((measure, number) => [
      `${number + 1} ${MEASURES[measure.kind].title}`, wordsOf(measure),
      html`<${Button} aria-label=${`Remove measure ${number + 1}`} onClick=${() => remove(number)}>×</${Button}>`,
    ])} />
    <${CsvLinks} name="measures" rows=${() => measureRows(measured, quantity)} onClear=${() => change({ measures: [] })} />
  </section>`;
}

const HINTS = {
  distance: "Drag, or click two points; the second may lie in another slice or plane.",
  angle: "Click three points, the second is the vertex.",
  area: "Drag around it, or click points, the last one at the first.",
};

// curves: titles and planes of the images at the chosen axis. detail: the resolution width, mm, if it is known.
export function Measures({ curves, state, quantity, beside, deviations, detail, main, change }) {
  const onRegion = (place) => change({ region: place && { shape: state.region?.shape ?? (state.tool === "rectangle" ? "rectangle" : "ellipse"), place } });
  const { tool, measures, profile, region } = state;
  const isRegion = ["rectangle", "ellipse"].includes(tool);
  return html`<div class="measures">
    ${HINTS[tool] && html`<${Facts}>${HINTS[tool]}</${Facts}>`}
    <${List} measures=${measures} main=${main} detail=${detail} quantity=${quantity} change=${change} />
    ${(profile || tool === "profile") && html`<${Profile} curves=${curves} place=${profile} quantity=${quantity} onPlace=${(place) => change({ profile: place })} />`}
    ${(region || isRegion) && html`<${Region} curves=${curves} detail=${detail} region=${region} quantity=${quantity} beside=${beside} deviations=${deviations} onPlace=${onRegion} />`}
  </div>`;
}
