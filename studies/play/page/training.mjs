// The training loop of unload/agent/training.py: ε-greedy picks, replay, updates, learning curve.

import { Container, Generator, stackLoad } from "./container.mjs";
import { Adam, PEQNetwork } from "./network.mjs";
import { highest, judge, slopes } from "./policy.mjs";

export const N_FEATURES = 16;
const REPLAY_SIZE = 2 ** 15; // picks
const POINTS = 50; // of the curve of a run
const JUDGED = 100; // steps after which the weights are judged

export class Training {
  /** A run of a config, see state.mjs, in containers of the exported numbers `task`. */
  constructor(config, task) {
    Object.assign(this, { config, task, picks: 0, memory: [], points: [] });
    this.latest = []; // rewards since the last point of the curve
    this.frozen = []; // judgements of the weights, each with the picks before it
    const generators = [0, 1, 2].map((part) => new Generator(3 * config.seed + part));
    [this.loads, this.choices] = generators;
    this.network = new PEQNetwork(N_FEATURES, generators[2]);
    this.optimizer = new Adam(this.network);
    this.containers = Array.from({ length: task.num_envs }, (_, i) => this.fill(i / task.num_envs));
  }

  /**
   * A full container, or one that has had a share of its picks, at random: as the containers of a
   * run are of different ages from the first step, no point of the curve shows full ones alone.
   */
  fill(age = 0) {
    const { config, loads, task } = this;
    const container = new Container(stackLoad(loads, task), task, loads);
    container.show(config);
    while (container.picks + 1 <= age * task.max_picks) {
      container.pick(container.visible[loads.integer(container.visible.length)]);
    }
    return container;
  }

  /** Go on with other settings. */
  change(config) {
    this.config = config;
    for (const container of this.containers) container.show(config);
  }

  /** Share of random picks: from 1 to 0 over the first half of the picks. */
  get epsilon() {
    return Math.max(0, 1 - this.picks / (this.config.picks / 2));
  }

  /** Pick once in every container, and learn from the picks before. */
  step() {
    const { choices, config, epsilon, memory, network } = this;
    const last = (container) => container.picks === this.task.max_picks;
    this.containers = this.containers.map((each) => (last(each) ? this.fill() : each));
    const picks = this.containers.map((container) => {
      const { observation, visible } = container;
      const explore = choices.uniform() < epsilon;
      const draws = () => visible.map(() => choices.uniform());
      const scores = explore ? draws() : network.scores(observation);
      const action = highest(scores, container, config.mask);
      return { observation, action, reward: container.pick(visible[action]) ? 1 : -1 };
    });
    if (memory.length >= config.batch_size) {
      const draw = () => memory[choices.integer(memory.length)];
      network.loss(Array.from({ length: config.batch_size }, draw));
      this.optimizer.step(config.learning_rate);
    }
    for (const pick of picks) {
      const observation = CHANGES[config.replay](pick.observation, choices);
      memory[this.picks++ % REPLAY_SIZE] = { ...pick, observation };
      this.latest.push(pick.reward);
    }
    if (this.latest.length >= config.picks / POINTS) this.addPoint();
    if (this.picks % (JUDGED * picks.length)) return;
    this.frozen.push({ picks: this.picks, ...judge(network, config, this.task) });
  }

  /** Add what was picked since the last point to the curve, if anything was. */
  addPoint() {
    const { network, containers, epsilon, latest, picks } = this;
    if (!latest.length) return;
    const success_rate = latest.filter((reward) => reward > 0).length / latest.length;
    this.points.push({ picks, success_rate, epsilon, slopes: slopes(network, containers) });
    this.latest = [];
  }
}

/** What is remembered of an observation, by the name of the setting. */
const CHANGES = {
  as_is: (observation) => observation,
  mirrored: (observation, choices) => {
    const signs = [1 - 2 * choices.integer(2), 1 - 2 * choices.integer(2), 1];
    return observation.map((value, i) => signs[i % 3] * value);
  },
  shuffled: (observation, choices) => {
    const seen = observation.slice();
    for (let row = seen.length / 3 - 1; row > 0; row--) {
      const [i, j] = [3 * row, 3 * choices.integer(row + 1)]; // x and y change places
      [seen[i], seen[i + 1], seen[j], seen[j + 1]] = [seen[j], seen[j + 1], seen[i], seen[i + 1]];
    }
    return seen;
  },
};
