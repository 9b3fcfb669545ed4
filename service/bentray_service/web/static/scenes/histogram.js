// A histogram as SVG, with a line at each of some values.
import { html } from "../parts/view.js";

const HEIGHT = 60;

// Counts in bins of equal width, on a logarithmic scale: peaks of air hide everything else on a linear one.
export function Histogram({ counts, minimum, maximum, unit, marks, format }) {
  const nodes = counts.reduce((sum, count) => sum + count, 0);
  const label = `Histogram of ${nodes.toLocaleString("en")} nodes from ${format(minimum)} to ${format(maximum)} ${unit}`.trim();
  const most = Math.log1p(Math.max(...counts));
  const steps = counts.map((count, bin) => `V${(HEIGHT * (1 - Math.log1p(count) / most)).toFixed(2)}H${bin + 1}`);
  const across = (value) => (counts.length * (value - minimum)) / (maximum - minimum || 1);
  return html`<svg class="histogram" viewBox=${`0 0 ${counts.length} ${HEIGHT}`} preserveAspectRatio="none" role="img" aria-label=${label}>
    <path d=${`M0 ${HEIGHT}${steps.join("")}V${HEIGHT}Z`} />
    ${marks.map((value) => html`<line x1=${across(value)} x2=${across(value)} y1="0" y2=${HEIGHT} />`)}
  </svg>`;
}
