// How a volume is looked at: the view that suits it, and views as addresses of pictures.

// Part of the speed of water that a speed must be off it to be shown as glass.
const LEAST = 0.005;

// A reconstruction in space as glass in water, which bends light as much as it bends sound.
export function glassOf({ water_speed_mps: water, value_range: [lowest, highest] }) {
  const between = (speed) => Number(((water + speed) / 2).toPrecision(6));
  const index = (speed) => Number((water / speed).toPrecision(4));
  const slower = lowest < (1 - LEAST) * water;
  const faster = highest > (1 + LEAST) * water;
  if (!slower && !faster) return {};
  return {
    iso: [...(slower ? [between(lowest)] : []), ...(faster ? [between(highest)] : [])],
    outside: slower ? index(lowest) : 1,
    index: [...(slower ? [1] : []), ...(faster ? [index(highest)] : [])],
    surroundings: slower ? 1 : 0,
    elevation_deg: 35,
  };
}

export function queryOf(view) {
  return new URLSearchParams(Object.entries(view).flatMap(([name, value]) => [value].flat().map((one) => [name, one])));
}
