// The profile and the region of a view: their places in mm, plot and statistics, and CSV files of both.
import { make } from "../parts/dom.js";
import { profileOf, regionOf } from "./measures.js";
import { plot } from "./plot.js";
import { shown } from "./quantities.js";

const ENDS = ["x from", "y from", "x to", "y to"];

export function save(name, text) {
  const link = make("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

const quoted = (text) => `"${String(text).replaceAll('"', '""')}"`;
const lines = (rows) => `${rows.map((row) => row.join(",")).join("\r\n")}\r\n`;

export function profileCsv(curves, { unit }) {
  const head = ["distance_mm", ...curves.map((one) => quoted(`${one.title}${unit ? ` (${unit})` : ""}`))];
  const { distance } = curves[0].profile;
  return lines([head, ...distance.map((one, k) => [one, ...curves.map(({ profile }) => profile.value[k] ?? "")])]);
}

export function regionCsv(found, { unit }, region) {
  const head = ["image", "quantity_unit", "shape", "x0_mm", "y0_mm", "x1_mm", "y1_mm", "nodes", "area_mm2", "mean", "standard_deviation", "minimum", "maximum", "contrast", "uncertainty"];
  const rows = found.map(({ title, statistics: s }) => [
    quoted(title), quoted(unit), region.shape, ...region.place, s.nodes, s.area, s.mean, s.deviation, s.minimum, s.maximum, s.contrast, s.uncertainty ?? "",
  ]);
  return lines([head, ...rows]);
}

// set: { setProfile(place), setRegion(region) }. Returns { show(curves, state, quantity, beside, deviations) }.
export function measuresPanel(root, set) {
  const parts = {};
  for (const [name, title] of [["profile", "Profile"], ["region", "Region"]]) {
    const box = make("section", `measure ${name}`);
    const head = make("h2", "", title);
    const none = make("p", "facts", "");
    const place = make("div", "place");
    const inputs = ENDS.map((end) => {
      const label = make("label", "", `${end} `);
      const input = make("input");
      Object.assign(input, { type: "number", step: "any" });
      input.setAttribute("aria-label", `${title}: ${end}, mm`);
      input.addEventListener("change", () => {
        const values = inputs.map((one) => one.valueAsNumber);
        if (!values.every(Number.isFinite)) return;
        if (name === "profile") set.setProfile(values);
        else set.setRegion({ shape: parts.region.shape, place: values });
      });
      label.append(input);
      place.append(label);
      return input;
    });
    const result = make("div", "measured");
    const csv = make("button", "quiet", "Save as CSV");
    const clear = make("button", "quiet", "Clear");
    csv.type = clear.type = "button";
    csv.addEventListener("click", () => parts[name].save());
    clear.addEventListener("click", () => (name === "profile" ? set.setProfile(null) : set.setRegion(null)));
    const row = make("div", "links");
    row.append(csv, clear);
    box.append(head, none, place, result, row);
    root.append(box);
    parts[name] = { box, none, place, inputs, result, row, shape: "ellipse", key: "", save: () => {} };
  }
  parts.profile.none.textContent = "Choose Profile and drag a line, or enter its ends in mm.";
  parts.region.none.textContent = "Choose Rectangle or Ellipse and drag, or enter its corners in mm.";

  function fill(part, place) {
    part.none.hidden = Boolean(place);
    part.result.hidden = part.row.hidden = !place;
    part.inputs.forEach((input, k) => {
      if (document.activeElement !== input) input.value = place ? Number(place[k].toFixed(3)) : "";
    });
  }

  return {
    // beside: images whose region is measured, too, such as the truth. deviations: of the nodes of the first image, or null.
    show(curves, { profile, region }, quantity, beside = [], deviations = null) {
      fill(parts.profile, profile);
      fill(parts.region, region?.place);
      const unit = quantity.unit ? ` (${quantity.unit})` : "";
      if (profile) {
        const found = curves.map((one) => ({ title: one.title, profile: profileOf(one.plane, profile) }));
        const drawn = found.map((one) => ({ x: one.profile.distance, y: one.profile.value }));
        const label = `Profile of ${quantity.words} over ${Number(found[0].profile.distance.at(-1).toFixed(2))} mm`;
        const legend = make("p", "legend");
        if (found.length > 1) found.forEach((one, k) => legend.append(make("span", `swatch swatch-${k}`, one.title)));
        parts.profile.result.replaceChildren(plot(drawn, { across: "distance (mm)", up: `${quantity.words}${unit}`, label }), legend);
        parts.profile.save = () => save("profile.csv", profileCsv(found, quantity));
      }
      if (region) {
        parts.region.shape = region.shape;
        const named = beside.length ? curves.map((one) => ({ ...one, title: "Result" })) : curves;
        const found = [...named, ...beside].map((one) => ({ title: one.title, statistics: regionOf(one.plane, region.shape, region.place) }));
        // As if the errors of all nodes were the same: see kernels/…/tomography/regions.py.
        if (deviations) found[0].statistics.uncertainty = regionOf(deviations, region.shape, region.place).mean;
        const table = make("table", "statistics");
        const uncertain = found.map(({ statistics: s }) => (s.uncertainty === undefined ? "–" : shown(s.uncertainty, quantity)));
        const rows = [
          ["", found.map((one) => one.title)],
          [`Mean${unit}`, found.map((one) => shown(one.statistics.mean, quantity))],
          ...(deviations ? [[`Uncertainty of the mean${unit}`, uncertain]] : []),
          [`Standard deviation${unit}`, found.map((one) => shown(one.statistics.deviation, quantity))],
          [`Contrast to surroundings${unit}`, found.map((one) => shown(one.statistics.contrast, quantity))],
          ["Area (mm²)", found.map((one) => one.statistics.area.toFixed(2))],
          ["Nodes", found.map((one) => one.statistics.nodes)],
        ].slice(found.length > 1 ? 0 : 1);
        rows.forEach(([name, cells], number) => {
          const row = table.insertRow();
          const head = make("th", "", name);
          head.scope = "row";
          row.append(head, ...cells.map((cell) => make(found.length > 1 && number === 0 ? "th" : "td", "", cell)));
        });
        // Four results are wider than a telephone.
        const frame = make("div", "scroll");
        frame.tabIndex = 0;
        frame.setAttribute("role", "region");
        frame.setAttribute("aria-label", "Statistics of the region");
        frame.append(table);
        parts.region.result.replaceChildren(frame);
        parts.region.save = () => save("region.csv", regionCsv(found, quantity, region));
      }
    },
  };
}
