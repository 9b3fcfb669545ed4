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

// "never" without a time.
export const inTime = (text) => (text ? new Date(text).toLocaleString() : "never");
