// What is measured of a network in its containers: see studies/falls/measures.py and fresh.py.

const STEP = 1e-3; // along an axis of the observation

/** Mean slope of the network's scores along x, y and z, over the upper half of the boxes seen. */
export function slopes(network, containers) {
  const sums = [0, 0, 0];
  for (const { observation } of containers) {
    const scores = network.scores(observation);
    const heights = observation.filter((_, i) => i % 3 === 2);
    const median = heights.toSorted()[heights.length >> 1];
    for (const axis of [0, 1, 2]) {
      const moved = observation.map((value, i) => (i % 3 === axis ? value + STEP : value));
      network.scores(moved).forEach((score, row) => {
        if (heights[row] >= median) sums[axis] += (score - scores[row]) / STEP / heights.length;
      });
    }
  }
  return sums.map((sum) => (2 * sum) / containers.length);
}

/** Preferences along x and y: the slope along each, divided by the size of that with height. */
export const preferences = ([x, y, z]) => [x / Math.abs(z), y / Math.abs(z)];

/**
 * Sizes of the preferences along x and y above which networks err. There is none (`Infinity`)
 * along x where equal x share one rank, and none is known of positions.
 */
export function limits({ equalize, ties }, [x, y]) {
  if (!equalize) return [Infinity, Infinity];
  return [ties === "average" ? Infinity : x, y];
}
