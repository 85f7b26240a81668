// What is measured of a network and its containers: see studies/falls/measures.py.

const STEP = 1e-3; // along an axis of the observation
const HEIGHT_BINS = 12;

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

/**
 * How far x, and how far y, tells which of the boxes at the same height can be lifted: the slope of
 * a least-squares fit of 0 and 1, with a constant for each of 12 bins of the height.
 */
export function tilts(containers) {
  return [0, 1].map((axis) => {
    const bins = Array.from({ length: HEIGHT_BINS }, () => ({ n: 0, u: 0, l: 0, uu: 0, ul: 0 }));
    for (const container of containers) {
      container.visible.forEach((item, row) => {
        const u = container.observation[3 * row + axis];
        const height = (container.observation[3 * row + 2] + 1) / 2;
        const bin = bins[Math.min(HEIGHT_BINS - 1, Math.floor(height * HEIGHT_BINS))];
        const l = container.liftable(item) ? 1 : 0;
        const terms = { n: 1, u, l, uu: u * u, ul: u * l };
        for (const key of Object.keys(bin)) bin[key] += terms[key];
      });
    }
    const sum = (term) => bins.reduce((total, bin) => total + (bin.n && term(bin)), 0);
    return sum(({ n, u, l, ul }) => ul - (u * l) / n) / sum(({ n, u, uu }) => uu - (u * u) / n);
  });
}
