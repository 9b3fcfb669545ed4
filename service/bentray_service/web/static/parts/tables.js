// Tables in frames of their own that scroll sideways, and bars of shares.
import { html } from "./view.js";

// label: of the frame, another one than that of the section; columns: headings, if there are any; rows: lists of texts or elements, with keys if
// they move; chosen: the number of the row that is marked.
export function HeadedTable({ label, columns = [], rows, keys = [], className = "headed", chosen = -1 }) {
  return html`<div class="scroll" tabindex="0" role="region" aria-label=${label}>
    <table class=${className}>
      ${columns.length > 0 && html`<thead><tr>${columns.map((name) => html`<th scope="col">${name}</th>`)}</tr></thead>`}
      <tbody>${rows.map(([first, ...others], number) => html`<tr key=${keys[number] ?? number} class=${number === chosen ? "chosen" : ""}>
        <th scope="row">${first}</th>
        ${others.map((cell) => html`<td>${cell}</td>`)}
      </tr>`)}</tbody>
    </table>
  </div>`;
}

// Names and values.
export function Pairs({ rows, className = "pairs", caption }) {
  return html`<table class=${className}>
    ${caption && html`<caption class="caption">${caption}</caption>`}
    <tbody>${rows.map(([name, value]) => html`<tr><th scope="row">${name}</th><td>${value}</td></tr>`)}</tbody>
  </table>`;
}

// A bar for a part of a whole, with its numbers as text beside it.
export function Share({ part, whole, words }) {
  return html`<div class="share">
    <meter min="0" max=${whole} low=${0.75 * whole} high=${0.9 * whole} optimum="0" value=${Math.min(part, whole)} aria-label=${words}></meter>
    <span>${words}</span>
  </div>`;
}
