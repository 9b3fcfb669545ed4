// A curve with axes and ticks, as SVG.
import { html } from "../parts/view.js";

const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [460, 220, 62, 12, 12, 40];

// Round values between two limits, about `count` of them, not nearer to each other than `least`.
export function ticks(low, high, count, least = 0) {
  const raw = Math.max(least, (high - low) / count) || 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= raw) * power;
  const values = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) values.push(Number((k * step).toPrecision(10)));
  return values;
}

// Powers of ten between two limits given as logarithms, with 2 and 5 times them where they are few.
function decades(low, high) {
  const factors = high - low < 2.5 ? [1, 2, 5] : [1];
  const powers = Array.from({ length: Math.ceil(high) - Math.floor(low) + 1 }, (_, k) => 10 ** (Math.floor(low) + k));
  const values = powers.flatMap((power) => factors.map((factor) => Number((factor * power).toPrecision(10))));
  return values.filter((value) => Math.log10(value) >= low && Math.log10(value) <= high);
}

// Grid lines, numbers and names of two axes. box: [left, top, right, bottom]; px, py: places of the values x and y; wordsOf: of a value x;
// words: of the axes.
export function Axes({ box: [left, top, right, bottom], px, py, x, y, wordsOf = String, words, height, margin }) {
  const middle = (top + bottom) / 2;
  return html`
    ${x.map((value) => html`<line class="grid" stroke="#888" x1=${px(value)} x2=${px(value)} y1=${top} y2=${bottom} />
      <text x=${px(value)} y=${bottom + 15} text-anchor="middle">${wordsOf(value)}</text>`)}
    ${y.map((value) => html`<line class="grid" stroke="#888" x1=${left} x2=${right} y1=${py(value)} y2=${py(value)} />
      <text x=${left - 6} y=${py(value) + 4} text-anchor="end">${value}</text>`)}
    <text x=${(left + right) / 2} y=${height - 6} text-anchor="middle">${words[0]}</text>
    <text x=${margin} y=${middle} text-anchor="middle" transform=${`rotate(-90 ${margin} ${middle})`}>${words[1]}</text>`;
}

// The path of a curve, with gaps where y is not finite.
function pathOf({ x, y }, px, py) {
  const points = y.map((value, k) => {
    if (!Number.isFinite(value)) return "";
    return `${Number.isFinite(y[k - 1]) ? "L" : "M"}${px(x[k]).toFixed(2)} ${py(value).toFixed(2)}`;
  });
  return points.join("");
}

// curves: [{ x, y }]. whole: the values across are whole numbers. logarithmic: the values up are positive.
export function Plot({ curves, across, up, label, whole = false, logarithmic = false, ...more }) {
  const scaled = logarithmic ? Math.log10 : (value) => value;
  const xs = curves.flatMap((curve) => curve.x);
  const ys = curves.flatMap((curve) => curve.y).filter(Number.isFinite).map(scaled);
  const shared = { class: "plot", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": label, ...more };
  if (!ys.length) return html`<svg ...${shared}><text x=${WIDTH / 2} y=${HEIGHT / 2} text-anchor="middle">No values along this line</text></svg>`;
  const [x0, x1] = [Math.min(...xs), Math.max(...xs)];
  const [least, most] = [Math.min(...ys), Math.max(...ys)];
  const margin = 0.06 * (most - least) || Math.max(1e-9, 1e-6 * Math.abs(least));
  const [y0, y1] = [least - margin, most + margin];
  const box = [LEFT, TOP, WIDTH - RIGHT, HEIGHT - BOTTOM];
  const px = (x) => LEFT + ((x - x0) / (x1 - x0 || 1)) * (box[2] - LEFT);
  const py = (y) => box[3] - ((scaled(y) - y0) / (y1 - y0)) * (box[3] - TOP);
  return html`<svg ...${shared}>
    <${Axes} box=${box} px=${px} py=${py} x=${ticks(x0, x1, 6, whole ? 1 : 0)} y=${logarithmic ? decades(y0, y1) : ticks(y0, y1, 4)}
      words=${[across, up]} height=${HEIGHT} margin="14" />
    ${curves.map((curve, number) => html`<path class=${`curve curve-${number}`} d=${pathOf(curve, px, py)} />`)}
  </svg>`;
}
