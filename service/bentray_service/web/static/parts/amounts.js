// Amounts for a person: bytes, counts and times.

const UNITS = ["B", "KiB", "MiB", "GiB", "TiB"];

// 1536 is "1.50 KiB": three significant digits in the largest unit that keeps them above 1.
export function inBytes(bytes) {
  let [value, unit] = [bytes, 0];
  while (value >= 1024 && unit < UNITS.length - 1) {
    value /= 1024;
    unit += 1;
  }
  return `${unit ? Number(value.toPrecision(3)) : value} ${UNITS[unit]}`;
}

export const counted = (count, one, many) => `${count.toLocaleString("en")} ${count === 1 ? one : many}`;

// Of travel times: three significant digits, or all before the point.
export function inNanoseconds(seconds) {
  if (seconds === null) return "–";
  const value = 1e9 * seconds;
  const rounded = Math.abs(value) < 100 ? Number(value.toPrecision(3)) : Math.round(value);
  return `${rounded.toLocaleString("en")} ns`;
}

// The month by its name and 24 hours, since readers of other countries take 11/12 for another day.
const MOMENT = { day: "numeric", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit" };

// "never" without a time.
export const inTime = (text) => (text ? new Date(text).toLocaleString("en-GB", MOMENT) : "never");
