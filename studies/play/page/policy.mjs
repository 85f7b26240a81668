// How a network chooses a box, how often it is right in containers that it has never seen, and what
// it prefers: see studies/falls/measures.py.

import { Container, Generator, stackLoad } from "./container.mjs";

const FRESH = 8; // containers
const STEP = 1e-3; // along an axis of the observation

/** The scores that a choice compares, (items); used by `height`, x and y count as 0. */
export function compared(network, observation, { use }) {
  const height = (value, i) => (i % 3 === 2 ? value : 0);
  return network.scores(use === "height" ? observation.map(height) : observation);
}

/** The row of the highest score; with `mask`, of those that have not failed. */
export function highest(scores, { visible, failed }, mask) {
  const masked = (row) => mask && failed.has(visible[row]);
  const allowed = scores.map((score, row) => (masked(row) ? -Infinity : score));
  return allowed.indexOf(Math.max(...allowed));
}

/**
 * What the network's own picks do in fresh containers, always the same ones, without learning, as
 * the settings say that it is used.
 *
 * @returns {{success_rate: number, repeated: number}} the share of picks that succeed, and that of
 *   picks which repeat, in the same container, one that has just failed.
 */
export function judge(network, config, task) {
  let [successes, repeated] = [0, 0];
  for (let number = 0; number < FRESH; number++) {
    const generator = new Generator(number);
    const container = new Container(stackLoad(generator, task), task, generator);
    container.show(config);
    let seen, scores; // a failed pick leaves what is seen
    for (let failed = -1; container.picks < task.max_picks; ) {
      if (seen !== container.observation) {
        seen = container.observation;
        scores = compared(network, seen, config);
      }
      const item = container.visible[highest(scores, container, config.use !== "no_mask")];
      if (item === failed) repeated++;
      const success = container.pick(item);
      if (success) successes++;
      failed = success ? -1 : item;
    }
  }
  const picks = FRESH * task.max_picks;
  return { success_rate: successes / picks, repeated: repeated / picks };
}

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
 * along x where equal x share one rank, and none is known of positions and of the index.
 */
export function limits({ sees, ties }, [x, y]) {
  if (sees !== "ranks") return [Infinity, Infinity];
  return [ties === "average" ? Infinity : x, y];
}
