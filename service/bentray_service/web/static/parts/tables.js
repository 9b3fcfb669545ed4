// Tables with a header row that scroll sideways in their own frame.
import { make } from "./dom.js";

// label: of the frame, another one than that of the section; columns: headings; rows: lists of texts or elements.
export function headedTable(label, columns, rows) {
  const table = make("table", "headed");
  const head = table.createTHead().insertRow();
  for (const one of columns) {
    const cell = make("th", "", one);
    cell.scope = "col";
    head.append(cell);
  }
  const body = table.createTBody();
  for (const [first, ...others] of rows) {
    const row = body.insertRow();
    const heading = make("th");
    heading.scope = "row";
    heading.append(first);
    row.append(heading);
    for (const one of others) row.insertCell().append(one);
  }
  const frame = make("div", "scroll");
  frame.tabIndex = 0;
  frame.setAttribute("role", "region");
  frame.setAttribute("aria-label", label);
  frame.append(table);
  return frame;
}

// A bar for a part of a whole, with its numbers as text beside it.
export function share(part, whole, words) {
  const box = make("div", "share");
  const bar = make("meter");
  Object.assign(bar, { min: 0, max: whole, value: Math.min(part, whole) });
  Object.assign(bar, { low: 0.75 * whole, high: 0.9 * whole, optimum: 0 });
  bar.setAttribute("aria-label", words);
  box.append(bar, make("span", "", words));
  return box;
}
