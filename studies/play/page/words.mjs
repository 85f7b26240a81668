// What the page says of each step and of settings between the steps, and its verdict: one line that
// says what the reader's picks or a run did, computed from what was measured.

import { limits, preferences } from "./policy.mjs";

const ROSE = 0.8; // rate of an agent that has learned, although it errs
const PART = 0.5; // rate of one that has learned in part, about twice that of random picks
const HIGH = 0.95; // rates that a fall begins at, and ends at
const LOW = 0.8;
const WORSE = 0.2; // by how much a rate has sunk that was never so high
const STUCK = 0.5; // share of picks that repeat one that has just failed
const MISLED = 0.1; // by how much a rate rises if x and y are blank
const SIDES = [["the rear", "the front"], ["the left side", "the right side"]];

/** Names of the steps in their order; those of `PRESETS` train with these settings. */
export const STEPS = ["unload", "positions", "ranks", "height", "index", "no_mask", "shuffled"];

export const SENTENCES = {
  unload:
    "A pick pulls one of the 128 boxes nearest to the entrance upwards: " +
    "click one on which no other lies.",
  positions:
    "In 64 containers an agent, which sees the boxes’ positions, " +
    "learns from its own picks which box to take.",
  ranks:
    "Now it sees only ranks: each box’s number along x, y and z. " +
    "The mask is on, also while it learns: it may not repeat what has just failed.",
  height:
    "Nothing is trained: the same weights see height alone, in the container shown and in eight " +
    "new ones, where their picks are counted.",
  index:
    "The paper’s pseudocode prints the index that sorting returns " +
    "(argsort; a rank is argsort twice): row i sees which row comes i-th. The mask stays on.",
  no_mask:
    "Ranks again, but the mask is on in use only: " +
    "the paper needs it “primarily … during the application phase”.",
  shuffled:
    "It learns anew from ranks, with shuffled places: in each remembered pick the boxes exchange " +
    "theirs, so that no place can be learned.",
  use: "Nothing is trained: the same weights, with the mask and without it, in eight new containers.",
  own: "Your own settings: Train goes on with them, Reset brings back the first weights.",
};

/** The verdict of a step that needs a trained network where there is none. */
export const UNTRAINED = "There is no trained network yet: take step 3 first.";

/** The first step that has not been done; undefined after all. */
export const nextStep = (done) => STEPS.find((step) => !done.has(step));

export const percent = (share) => `${Math.round(100 * share)} %`;
const mean = (values) => values.reduce((a, b) => a + b, 0) / values.length;

/** What no policy can exceed, because free boxes jam. */
export const ceiling = ({ seamless, jam }) => (seamless ? 1 - jam : 1);

/** What became of a pick of an item in the reader's container. */
export function pickVerdict(container, item, success) {
  const unloaded = container.present.filter((here) => !here).length;
  const blocked = !container.liftable(item);
  const failed = `Failed: ${blocked ? "a box lies on it" : "it jams, although no box lies on it"}.`;
  const how = success ? "Unloaded: no box lay on it." : failed;
  return `${how} ${unloaded} of your ${container.picks} picks succeeded.`;
}

/**
 * What a run did, by what its weights do in fresh containers where nothing is drawn at random.
 *
 * @param {object} run its `points` and judgements `frozen`, see training.mjs, `picks`, and
 *   `seconds` of training; `rates` of its weights by their use; whether it is `running`.
 * @param {object} config its settings.
 * @param {object} task its numbers `thresholds`, `errs` and `paper_msr`.
 */
export function runVerdict(run, config, task) {
  const { points, frozen, picks, seconds, running } = run;
  if (!points.length) return "";
  const latest = points.at(-1);
  const judged = run.rates[config.use] ?? frozen.at(-1); // by the use that is set now, if it can
  const [top, end] = [ceiling(config), judged?.success_rate];
  const rates = frozen.map((each) => each.success_rate);
  const best = Math.max(...rates, end);
  if (running || picks < config.picks || !judged) {
    const fresh = judged ? `; with its weights frozen, ${percent(end)}` : "";
    return `${percent(latest.success_rate)} of its latest picks succeeded${fresh}.`;
  }
  const limit = top < 1 ? ` With these jams nothing ends above ${percent(top)}.` : "";
  if (end >= task.errs * top) {
    const time = `after ${seconds.toFixed(1)} s`;
    return `It learned: ${percent(end)} of its picks in new containers succeed, ${time}.${limit}`;
  }
  if (judged.repeated > STUCK) {
    return `It is stuck: ${percent(judged.repeated)} of its picks repeat one that has just failed.`;
  }
  const why = remark(latest.slopes, config, task);
  const high = rates.findIndex((rate) => rate >= HIGH * top);
  const fell = high >= 0 && rates.slice(high).some((rate) => rate <= LOW * top);
  if (!fell && best - end < WORSE * top) {
    const part = end >= PART * top ? "It learned in part" : "It did not learn";
    const what = end >= ROSE * top ? "It did not fall" : part;
    return `${what}: ${percent(end)} at the end, ${percent(best)} at best; ${why}.${limit}`;
  }
  const early = frozen[rates.indexOf(best)].picks.toLocaleString("en");
  const what = `It ${fell ? "fell" : "got worse"}: best after ${early} picks`;
  const both = `with ${percent(best)} in new containers; ${percent(end)} at the end`;
  return `${what}, ${both}; ${why}.${limit}`;
}

/** What a network prefers to height, by its slopes; beside one of the index, the paper's. */
function remark(slopes, config, task) {
  if (config.sees === "index") return `the paper’s agent ends at ${percent(task.paper_msr)}`;
  if (slopes[2] <= 0) return "it prefers low boxes";
  const along = preferences(slopes);
  const known = limits(config, task.thresholds);
  const beyond = known.map((limit, axis) => Math.abs(along[axis]) / limit);
  const axis = beyond[1] > beyond[0] ? 1 : 0;
  if (beyond[axis] <= 1) return "it prefers no place to height";
  return `it prefers ${SIDES[axis][along[axis] > 0 ? 1 : 0]} to height`;
}

/** What is shared of rates with x and y and without; empty if hiding them does not help. */
export function headline(rates) {
  const [seen, blank] = [rates.mask, rates.height].map((rate) => rate?.success_rate);
  if (!(blank - seen >= MISLED)) return "";
  const change = `from ${Math.round(100 * seen)} to ${percent(blank)}`;
  return `Hide x and y: the same weights go ${change}, and nothing was trained.`;
}

/** What frozen weights do in fresh containers with the mask and without it; empty if not known. */
export function useVerdict({ mask, no_mask }) {
  if (!mask || !no_mask) return "";
  const rates = [mask, no_mask].map(({ success_rate }) => percent(success_rate));
  const both = `With the mask these weights succeed in ${rates[0]} of picks, without it in ${rates[1]}`;
  const again = `there they are stuck: ${percent(no_mask.repeated)} repeat a pick that has just failed`;
  return no_mask.repeated > STUCK ? `${both}; ${again}.` : `${both}.`;
}

/** What frozen weights do in fresh containers, with x and y and without. */
export function heightVerdict({ rates }, config, task) {
  const [seen, blank] = [rates.mask, rates.height].map((rate) => rate?.success_rate);
  if (blank === undefined) return "";
  const without = `With height alone these weights succeed in ${percent(blank)} of picks`;
  if (seen === undefined) return `${without}.`;
  const both = `${without}, with x and y in ${percent(seen)}`;
  const good = blank >= task.errs * ceiling(config);
  const [all, part] =
    blank - seen < MISLED
      ? ["no place misleads them", "their mistakes are not those of a place"]
      : ["they know height, but a side outweighed it", "not only a place misled them"];
  return `${both}: ${good ? all : part}.`;
}
