// How a network chooses a box, and how often it is right in containers that it has never seen.

import { Container, Generator, stackLoad } from "./container.mjs";

const FRESH = 8; // containers

/** The scores that a choice compares, (items); with `blank`, x and y count as 0. */
export function compared(network, observation, { blank }) {
  const seen = blank ? observation.map((value, i) => (i % 3 === 2 ? value : 0)) : observation;
  return network.scores(seen);
}

/** The row of the highest score; with `mask`, of those that have not failed. */
export function highest(scores, { visible, failed }, { mask }) {
  const masked = (row) => mask && failed.has(visible[row]);
  const allowed = scores.map((score, row) => (masked(row) ? -Infinity : score));
  return allowed.indexOf(Math.max(...allowed));
}

/**
 * What the network's own picks do in fresh containers, always the same ones, without learning.
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
    for (let failed = -1; container.picks < task.max_picks; ) {
      const scores = compared(network, container.observation, config);
      const item = container.visible[highest(scores, container, config)];
      if (item === failed) repeated++;
      const success = container.pick(item);
      if (success) successes++;
      failed = success ? -1 : item;
    }
  }
  const picks = FRESH * task.max_picks;
  return { success_rate: successes / picks, repeated: repeated / picks };
}
