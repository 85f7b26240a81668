// The page's state: all settings in one object, by their names in `TrainConfig` where it has them,
// and how they stand in the page's address, so that an experiment can be sent as a link.

const SEED = 2; // its run leans to one side, so that one sees what is told
/** Label of each setting, and the value of each choice; the first is the default. */
export const SETTINGS = {
  equalize: ["Agent sees", { ranks: true, positions: false }],
  mask: ["Failed boxes", { masked: true, allowed: false }],
  replay: ["Replay", { "as it is": "as_is", mirrored: "mirrored", "places dealt anew": "shuffled" }],
  ties: ["Equal heights", { "noise decides": "noise", averaged: "average" }],
  blank: ["Chooses by", { "x, y, z": false, "z alone": true }],
  picks: ["Picks", { "96,000": 96_000, "32,000": 32_000, "64,000": 64_000, "384,000": 384_000 }],
  learning_rate: ["Learning rate", { 0.003: 0.003, 0.001: 0.001, 0.01: 0.01 }],
  batch_size: ["Batch", { "64 picks": 64, "16 picks": 16, "256 picks": 256 }],
};

/** What experiments change in the defaults. */
export const PRESETS = {
  positions: { equalize: false, picks: 32_000 },
  stuck: { mask: false, picks: 64_000 },
  paper: {},
  place: { replay: "shuffled" },
};

/** Settings from a text such as an address holds; what it lacks or misnames has its default. */
export function fromText(text) {
  const given = new URLSearchParams(text);
  const config = { seed: [Number.parseInt(given.get("seed")), SEED].find(Number.isInteger) };
  for (const [name, [, choices]] of Object.entries(SETTINGS)) {
    const values = Object.values(choices);
    config[name] = values.find((value) => String(value) === given.get(name)) ?? values[0];
  }
  return config;
}

/** Settings as a text, completed by the defaults. */
export const toText = (config) => `${new URLSearchParams(fromText(new URLSearchParams(config)))}`;
