// A curve with axes and ticks, as SVG.

const SVG = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [460, 220, 62, 12, 12, 40];

function node(name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

// Round values between two limits, about `count` of them, not nearer to each other than `least`.
export function ticks(low, high, count, least = 0) {
  const raw = Math.max(least, (high - low) / count) || 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((one) => one * power >= raw) * power;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) found.push(Number((k * step).toPrecision(10)));
  return found;
}

// Powers of ten between two limits given as logarithms, with 2 and 5 times them where they are few.
function decades(low, high) {
  const parts = high - low < 2.5 ? [1, 2, 5] : [1];
  const powers = Array.from({ length: Math.ceil(high) - Math.floor(low) + 1 }, (_, k) => 10 ** (Math.floor(low) + k));
  const values = powers.flatMap((power) => parts.map((part) => Number((part * power).toPrecision(10))));
  return values.filter((value) => Math.log10(value) >= low && Math.log10(value) <= high);
}

// curves: [{ x, y, name }]; gaps where y is not finite. whole: the values across are whole numbers. logarithmic: the values up are positive.
export function plot(curves, { across, up, label, whole = false, logarithmic = false }) {
  const scaled = logarithmic ? Math.log10 : (value) => value;
  const xs = curves.flatMap((one) => one.x);
  const ys = curves.flatMap((one) => one.y).filter(Number.isFinite).map(scaled);
  const picture = node("svg", { class: "plot", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": label });
  if (!ys.length) {
    picture.append(node("text", { x: WIDTH / 2, y: HEIGHT / 2, "text-anchor": "middle" }, "No values along this line"));
    return picture;
  }
  const [x0, x1] = [Math.min(...xs), Math.max(...xs)];
  let [y0, y1] = [Math.min(...ys), Math.max(...ys)];
  const margin = 0.06 * (y1 - y0) || Math.max(1e-9, 1e-6 * Math.abs(y0));
  [y0, y1] = [y0 - margin, y1 + margin];
  const px = (x) => LEFT + ((x - x0) / (x1 - x0 || 1)) * (WIDTH - LEFT - RIGHT);
  const py = (y) => HEIGHT - BOTTOM - ((scaled(y) - y0) / (y1 - y0)) * (HEIGHT - TOP - BOTTOM);
  for (const x of ticks(x0, x1, 6, whole ? 1 : 0)) {
    picture.append(node("line", { class: "grid", x1: px(x), x2: px(x), y1: TOP, y2: HEIGHT - BOTTOM }));
    picture.append(node("text", { x: px(x), y: HEIGHT - BOTTOM + 15, "text-anchor": "middle" }, String(x)));
  }
  for (const y of logarithmic ? decades(y0, y1) : ticks(y0, y1, 4)) {
    picture.append(node("line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: py(y), y2: py(y) }));
    picture.append(node("text", { x: LEFT - 6, y: py(y) + 4, "text-anchor": "end" }, String(y)));
  }
  curves.forEach(({ x, y }, number) => {
    let path = "";
    let pen = false;
    y.forEach((value, k) => {
      if (Number.isFinite(value)) path += `${pen ? "L" : "M"}${px(x[k]).toFixed(2)} ${py(value).toFixed(2)}`;
      pen = Number.isFinite(value);
    });
    picture.append(node("path", { class: `curve curve-${number}`, d: path }));
  });
  picture.append(node("text", { x: (LEFT + WIDTH - RIGHT) / 2, y: HEIGHT - 6, "text-anchor": "middle" }, across));
  const turned = { x: 14, y: (TOP + HEIGHT - BOTTOM) / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${(TOP + HEIGHT - BOTTOM) / 2})` };
  picture.append(node("text", turned, up));
  return picture;
}
