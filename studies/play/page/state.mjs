// The page's state: all settings in one object, by their names in `TrainConfig` where it has them,
// and how they stand in the page's address, so that an experiment can be sent as a link.

/** Label of each choice, what it is, and the value of each option; the first is the default. */
export const CHOICES = {
  sees: ["Agent sees", { positions: "positions", ranks: "ranks", "the index": "index" },
    "Positions of the boxes; ranks, as in the paper’s text: numbers in the order along each axis; or " +
    "the index that sorting returns, as in its pseudocode"],
  mask: ["Mask in training", { on: true, off: false },
    "On: while it learns, a box that has failed is not chosen again before another one is unloaded"],
  replay: ["Replay",
    { "as it is": "as_is", mirrored: "mirrored", "shuffled places": "shuffled" },
    "What is remembered of a pick. Mirrored: x and y get random signs. Shuffled places: the boxes " +
    "exchange their places, left – right and rear – front, at random"],
  ties: ["Ties", { "by noise": "noise", "by noise, anew": "anew", averaged: "average" },
    "Boxes of equal coordinates are ranked by noise of half a millimetre, drawn once for a load or " +
    "anew at each pick; or they share a rank"],
  // In new containers: with the mask, without it, or with it and by height only, x and y being 0.
  use: ["In use", { mask: "mask", no_mask: "no_mask", height: "height" }],
  picks: ["Picks",
    { "32,000": 32_000, "64,000": 64_000, "96,000": 96_000, "384,000": 384_000 },
    "Length of a run; random picks end after half of it"],
  learning_rate: ["Learning rate", { 0.003: 0.003, 0.001: 0.001, 0.01: 0.01 }, "Of Adam"],
  batch_size: ["Batch", { "64 picks": 64, "16 picks": 16, "256 picks": 256 },
    "Remembered picks from which each update learns"],
  seamless: ["Walls", { "with a gap": false, seamless: true },
    "Seamless: boxes touch. A free box jams between others with a probability, drawn anew each time"],
};

/** Numbers: default, highest, form, and what a valid one is called. */
export const NUMBERS = {
  jam: [0.4, 0.8, /^0$|^0?\.\d\d?$/, "a number from 0 to 0.8 with two decimals at most"],
  // The run of seed 2 prefers one side, so that one sees what is told.
  seed: [2, 2 ** 32 - 1, /^\d+$/, "a whole number from 0 to 4294967295"],
};

const RANKS = { sees: "ranks", picks: 96_000 };
/** What experiments change in the defaults. */
export const PRESETS = {
  positions: {},
  ranks: RANKS,
  index: { ...RANKS, sees: "index" },
  no_mask: { ...RANKS, mask: false },
  shuffled: { ...RANKS, replay: "shuffled" },
};

/**
 * Settings from a text such as an address holds; what it lacks has its default.
 *
 * @returns {{config: object, problems: string[]}} the settings, and a sentence for each value that
 *   is not valid, in whose place the default stands.
 */
export function fromText(text) {
  const given = new URLSearchParams(text);
  const [config, problems] = [{}, []];
  const refuse = (name, what) =>
    problems.push(`${name} is “${given.get(name)}”, which is not ${what}.`);
  for (const [name, [, options]] of Object.entries(CHOICES)) {
    const values = Object.values(options);
    const value = values.find((each) => String(each) === given.get(name));
    if (given.has(name) && value === undefined) refuse(name, `one of ${values.join(", ")}`);
    config[name] = value ?? values[0];
  }
  for (const [name, [standard, most, form, what]] of Object.entries(NUMBERS)) {
    const value = given.has(name) ? Number(given.get(name)) : standard;
    const valid = !given.has(name) || (form.test(given.get(name)) && value <= most);
    if (!valid) refuse(name, what);
    config[name] = valid ? value : standard;
  }
  for (const name of given.keys()) {
    if (!Object.hasOwn(config, name)) problems.push(`No setting is named “${name}”.`);
  }
  return { config, problems };
}

/** Settings as a text, completed by the defaults. */
export const toText = (settings) =>
  `${new URLSearchParams(fromText(new URLSearchParams(settings)).config)}`;
