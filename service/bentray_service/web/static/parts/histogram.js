// A histogram as SVG, with a line at each of some values.

const SVG = "http://www.w3.org/2000/svg";
const HEIGHT = 60;

function element(name, attributes) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

// Draw counts in bins of equal width, on a logarithmic scale: peaks of air hide everything else on a linear one.
export function drawHistogram(place, { counts, minimum, maximum, unit }, format) {
  const nodes = counts.reduce((sum, one) => sum + one, 0);
  const svg = element("svg", { viewBox: `0 0 ${counts.length} ${HEIGHT}`, preserveAspectRatio: "none", role: "img", class: "histogram" });
  const label = `Histogram of ${nodes.toLocaleString("en")} nodes from ${format(minimum)} to ${format(maximum)} ${unit}`.trim();
  svg.setAttribute("aria-label", label);
  const most = Math.log1p(Math.max(...counts));
  const steps = counts.map((count, bin) => {
    const y = (HEIGHT * (1 - Math.log1p(count) / most)).toFixed(2);
    return `V${y}H${bin + 1}`;
  });
  svg.append(element("path", { d: `M0 ${HEIGHT}${steps.join("")}V${HEIGHT}Z` }));
  place.replaceChildren(svg);
  return {
    mark(values) {
      for (const line of svg.querySelectorAll("line")) line.remove();
      for (const value of values) {
        const x = (counts.length * (value - minimum)) / (maximum - minimum || 1);
        svg.append(element("line", { x1: x, x2: x, y1: 0, y2: HEIGHT }));
      }
    },
  };
}
