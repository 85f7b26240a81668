// Tests of the parts of the page that trains in a browser. test_page.py runs them, and compares
// what the parts share with the package. From the repository:
//
//     node tests/studies/play/page_parts.mjs

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { createContext, runInContext } from "node:vm";

import { Container, Generator, stackLoad } from "../../../studies/play/page/container.mjs";
import { ARROWS, Drawing, nearest, towards } from "../../../studies/play/page/drawing.mjs";
import { PEQNetwork } from "../../../studies/play/page/network.mjs";
import * as plots from "../../../studies/play/page/plots.mjs";
import * as policy from "../../../studies/play/page/policy.mjs";
import { CHOICES, PRESETS, fromText, toText } from "../../../studies/play/page/state.mjs";
import { Training } from "../../../studies/play/page/training.mjs";
import * as words from "../../../studies/play/page/words.mjs";

const ROOT = new URL("../../../", import.meta.url);
const PAGE = readFileSync(new URL("figures/train_it_yourself.html", ROOT), "utf8");
const inPage = (id) => PAGE.match(new RegExp(`<script[^>]* id="${id}">([^]+?)</script>`))[1];
const TASK = JSON.parse(inPage("task"));
const SMALL = { ...TASK, num_envs: 4, max_picks: 20 };
const DEFAULTS = {
  sees: "positions", mask: true, replay: "as_is", ties: "noise", use: "mask", picks: 32_000,
  learning_rate: 0.003, batch_size: 64, seamless: false, jam: 0.4, seed: 2,
};

const range = (count) => [...Array(count).keys()];
const mean = (values) => values.reduce((a, b) => a + b, 0) / values.length;
function near(got, expected, by = 1e-9) {
  assert.equal(got.length, expected.length);
  const far = got.some((value, i) => Math.abs(value - expected[i]) > by);
  assert.ok(!far, `${[...got]}; expected ${expected}`);
}

/** A network whose scores are z + 2 and, times the given numbers, x + 2 and y + 2. */
function prefers(x, y, z) {
  const network = new PEQNetwork(3, new Generator(0));
  network.parameters.fill(0);
  network.extractor.set([1, 0, 0, 2, 0, 1, 0, 2, 0, 0, 1, 2]);
  network.scorer.set([x, y, z]);
  return network;
}

// ------------------------------------------------------------------------- container and network

test("random numbers are uniform, whole or normal, and others for each seed", () => {
  const generator = new Generator(3);
  const [uniform, whole, normal] = [
    () => generator.uniform(), () => generator.integer(5), () => generator.normal(),
  ].map((draw) => range(4000).map(draw));
  const tenths = range(10).map((k) => uniform.filter((u) => Math.floor(10 * u) === k).length);
  near(tenths, Array(10).fill(400), 80);
  assert.equal(mean(tenths), 400, "all lie between 0 and 1");
  assert.deepEqual([...new Set(whole)].sort(), [0, 1, 2, 3, 4]);
  const next = normal.slice(1).map((value, i) => value * normal[i]);
  near([mean(normal), mean(normal.map((value) => value ** 2)), mean(next)], [0, 1, 0], 0.05);
  const first = range(4).map((seed) => new Generator(seed).uniform());
  assert.equal(new Set(first).size, 4);
  assert.equal(first[3], uniform[0]);
});

test("loads have 800 to 1000 boxes", () => {
  const counts = (task) => range(30).map((seed) => stackLoad(new Generator(seed), task).length);
  const [all, few] = [counts(TASK), counts({ ...TASK, min_items: 905, max_items: 915 })];
  assert.ok(all.every((count) => 800 <= count && count <= 1000) && new Set(all).size > 10);
  assert.ok(few.every((count) => 905 <= count && count <= 915));
});

const JAMS = [[false, 0.4, 0], [true, 0, 0], [true, 0.4, 0.4]];
for (const [seamless, jam, share] of JAMS) {
  test(`of free boxes ${share} jam if seamless is ${seamless} and jam ${jam}`, () => {
    const generator = new Generator(0);
    const container = new Container(stackLoad(generator, TASK), TASK, generator);
    container.show({ ...DEFAULTS, seamless, jam });
    const { state } = generator;
    const failures = range(400).map(() => {
      const free = container.visible.find((item) => container.liftable(item));
      const success = container.pick(free);
      assert.equal(container.failed.has(free), !success);
      assert.equal(container.failed.size === 0, success);
      return !success;
    });
    near([mean(failures)], [share], share ? 0.07 : 0);
    assert.equal(generator.state !== state, share > 0, "nothing is drawn where nothing jams");
    const before = generator.state;
    assert.ok(!container.pick(container.visible.find((item) => !container.liftable(item))));
    assert.equal(generator.state, before, "a blocked box fails in any case");
  });
}

test("first weights are those of a linear layer", () => {
  const { extractor, scorer } = new PEQNetwork(16, new Generator(0));
  for (const [weights, count, inputs] of [[extractor, 64, 3], [scorer, 65, 64]]) {
    const largest = Math.max(...weights.map(Math.abs)) * Math.sqrt(inputs);
    assert.ok(0.9 < largest && largest <= 1 && Math.min(...weights) < 0);
    assert.equal(weights.length, count);
  }
});

// ----------------------------------------------------------------------------- policy and training

test("the choice is the highest score that is allowed", () => {
  const [network, seen] = [prefers(1, 0, 1), Float32Array.from([0.5, -0.5, 0.1, -0.5, 0.5, 0.2])];
  near(policy.compared(network, seen, { use: "no_mask" }), [4.6, 3.7], 1e-6);
  near(policy.compared(network, seen, { use: "height" }), [4.1, 4.2], 1e-6);
  const container = { visible: [7, 8, 9], failed: new Set([8]) };
  const chosen = (mask) => policy.highest(Float64Array.from([-3, 5, -2]), container, mask);
  assert.deepEqual([chosen(true), chosen(false)], [2, 1]);
});

test("weights are judged by fresh picks", () => {
  const [height, side, low] = [prefers(0, 0, 1), prefers(0, 2, 1), prefers(0, 0, -1)];
  const task = { ...TASK, max_picks: 100 };
  const judged = (network, settings) =>
    policy.judge(network, { ...DEFAULTS, sees: "ranks", ...settings }, task);
  assert.deepEqual(judged(height, {}), { success_rate: 1, repeated: 0 });
  near([judged(height, { seamless: true }).success_rate], [0.6], 0.03);
  assert.ok(judged(side, {}).success_rate < TASK.errs);
  assert.deepEqual(judged(side, {}), judged(side, {}), "the containers are the same");
  assert.equal(judged(side, { use: "height" }).success_rate, 1);
  // Eight containers of 100 picks each, of which all but the first repeat the same failure.
  assert.deepEqual(judged(low, { use: "no_mask" }), { success_rate: 0, repeated: 99 / 100 });
  const masked = judged(low, {});
  assert.ok(masked.repeated === 0 && masked.success_rate < 0.1);
});

test("preferences and their limits are those of the falls", () => {
  for (const z of [2, -2]) near(policy.preferences([0.2, -0.6, z]), [0.1, -0.3]);
  for (const [sees, ties, expected] of [
    ["ranks", "noise", [0.22, 0.42]], ["ranks", "average", [Infinity, 0.42]],
    ["positions", "noise", [Infinity, Infinity]], ["index", "noise", [Infinity, Infinity]],
  ]) assert.deepEqual(policy.limits({ sees, ties }, TASK.thresholds), expected);
});

test("a run explores, learns, and fills its containers one by one", () => {
  const run = new Training({ ...DEFAULTS, picks: 480, batch_size: 10 }, SMALL);
  const gone = run.containers.map(({ present }) => present.filter((here) => !here).length);
  assert.ok(gone[0] === 0 && gone[3] > gone[0], "they begin at different ages");
  const weights = () => [...run.network.parameters];
  for (let number = 1; number <= 120; number++) {
    const before = weights();
    run.step();
    assert.deepEqual([run.picks, run.memory.length], [4 * number, 4 * number]);
    near([run.epsilon], [Math.max(0, 1 - number / 60)]);
    const ages = [0, 5, 10, 15].map((age) => ((age + number - 1) % 20) + 1);
    assert.deepEqual(run.containers.map(({ picks }) => picks), ages);
    const learned = weights().some((weight, i) => weight !== before[i]);
    assert.equal(learned, number >= 4, "the fourth step is the first that finds 10 picks");
    // A point as soon as 480 / 50 picks have been made since the last one.
    assert.equal(run.points.length, Math.floor(number / 3));
  }
  run.addPoint();
  assert.equal(run.points.length, 40, "none without picks");
  for (const { success_rate, slopes } of run.points) {
    assert.ok(Number.isInteger(12 * success_rate) && 0 <= success_rate && success_rate <= 1);
    assert.equal(slopes.length, 3);
  }
});

test("the weights are judged every hundred steps, as they are then", () => {
  const run = new Training({ ...DEFAULTS, sees: "ranks", picks: 480 }, SMALL);
  for (const steps of [100, 200]) {
    while (run.picks < 4 * steps) run.step();
    const judged = policy.judge(run.network, run.config, SMALL);
    assert.deepEqual(run.frozen.at(-1), { picks: 4 * steps, ...judged });
    assert.equal(run.frozen.length, steps / 100);
  }
});

test("each seed has random numbers of its own", () => {
  const runs = range(6).map((seed) => new Training({ ...DEFAULTS, seed }, SMALL));
  for (const draw of [
    ({ choices }) => choices.uniform(), ({ loads }) => loads.uniform(),
    ({ network }) => network.parameters[0],
  ]) assert.equal(new Set(runs.map(draw)).size, 6);
});

test("the memory keeps the latest picks, and a rate of 0 the weights", () => {
  const run = new Training({ ...DEFAULTS, learning_rate: 0 }, SMALL);
  const [before, size] = [[...run.network.parameters], 2 ** 15];
  const old = { observation: new Float32Array(3), action: 0, reward: 1, old: true };
  Object.assign(run, { memory: Array(size).fill(old), picks: size - 4 });
  run.step();
  run.step();
  assert.equal(run.memory.length, size);
  const fresh = run.memory.flatMap((pick, i) => (pick.old ? [] : [i]));
  assert.deepEqual(fresh, [0, 1, 2, 3, size - 4, size - 3, size - 2, size - 1]);
  assert.deepEqual([...run.network.parameters], before);
});

test("failed boxes are picked again without the mask alone", () => {
  for (const [picks, mask, least] of [
    [0, true, 0], [32_000, true, 0], [0, false, 1], [32_000, false, 20], // random, then greedy
  ]) {
    const settings = { ...DEFAULTS, sees: "ranks", mask };
    const run = new Training(settings, { ...TASK, num_envs: 16, max_picks: 100 });
    run.optimizer.step = run.network.loss = () => {}; // nothing is learned
    run.picks = picks;
    let repeated = 0;
    for (const container of run.containers) {
      container.failed.add = function (item) {
        repeated += this.has(item);
        Set.prototype.add.call(this, item);
      };
    }
    for (let step = 0; step < 20; step++) run.step();
    assert.ok(least ? repeated >= least : repeated === 0, `${picks}, ${mask}: ${repeated} times`);
    const successes = run.memory.filter(({ reward }) => reward > 0).length;
    if (!mask && !picks) near([successes / 320], [0.26], 0.11); // of random picks
  }
});

test("other settings are taken over in the midst of a run, and hold when it goes on", () => {
  const run = new Training(DEFAULTS, SMALL);
  run.step();
  const positions = run.containers[0].observation;
  run.change({ ...DEFAULTS, sees: "ranks", seamless: true, jam: 0.3 });
  assert.notDeepEqual(run.containers[0].observation, positions);
  assert.deepEqual(run.containers.map(({ jam }) => jam), Array(4).fill(0.3));
  const { sees, jam, picks } = run.fill();
  assert.deepEqual([sees, jam, picks], ["ranks", 0.3, 0]);
});

// --------------------------------------------------------------------------------- state and words

test("the address holds all settings", () => {
  const chosen = {
    sees: "index", mask: false, replay: "mirrored", ties: "average", use: "height", picks: 384_000,
    learning_rate: 0.01, batch_size: 16, seamless: true, jam: 0.25, seed: 2 ** 32 - 1,
  };
  const settings = [{}, chosen, { seed: 5 }, ...Object.values(PRESETS)];
  for (const [text, changes] of [
    ...settings.map((each) => [toText(each), each]),
    ["seed=0&jam=0", { seed: 0, jam: 0 }], ["jam=.8", { jam: 0.8 }], ["", {}],
  ]) {
    assert.deepEqual(fromText(text), { config: { ...DEFAULTS, ...changes }, problems: [] });
  }
  assert.equal(toText({}).split("&").length, Object.keys(DEFAULTS).length);
  assert.deepEqual(Object.keys(DEFAULTS).sort(), [...Object.keys(CHOICES), "jam", "seed"].sort());
  for (const [name, [, options]] of Object.entries(CHOICES)) {
    for (const [label, value] of Object.entries(options)) {
      if (!["picks", "learning_rate", "batch_size"].includes(name)) continue;
      assert.equal(parseFloat(label.replace(",", "")), value, "it is called by its value");
    }
  }
});

test("a bad value in the address is named", () => {
  const number = "a whole number from 0 to 4294967295";
  for (const [text, named] of [
    ...["x", "-1", "1.5", "", "4294967296", "1e3", "1e21"].map((seed) => [`seed=${seed}`, seed]),
    ["seed=1000000000000000000000", number],
    ...["0.81", "1", "0.333", "-0.1", "half", ""].map((jam) => [`jam=${jam}`, jam]),
    ["replay=gone", "as_is, mirrored, shuffled"], ["picks=5", "32000, 64000, 96000, 384000"],
    ["mask=1", "true, false"], ["toString=1", "toString"],
    ["speed=9", "No setting is named “speed”"],
  ]) {
    const { config, problems } = fromText(text);
    assert.deepEqual(config, DEFAULTS);
    assert.ok(problems.length === 1 && problems[0].includes(named), `${text}: ${problems}`);
    assert.ok(problems[0].includes(text.split("=")[0]));
  }
});

test("each step has its sentence", () => {
  const { STEPS, SENTENCES, UNTRAINED, nextStep } = words;
  const names = [...STEPS, "use", "own"];
  assert.deepEqual(STEPS.filter((step) => step in PRESETS), Object.keys(PRESETS));
  assert.deepEqual(Object.keys(SENTENCES).sort(), names.sort());
  assert.deepEqual(STEPS.filter((step) => !(step in PRESETS)), ["unload", "height"]);
  assert.ok(UNTRAINED.includes(`step ${STEPS.indexOf("ranks") + 1} `));
  assert.match(SENTENCES.unload, new RegExp(` ${TASK.n_visible} boxes`));
  assert.match(SENTENCES.positions, new RegExp(`${TASK.num_envs} containers`));
  for (const [done, next] of [
    [[], "unload"], [["unload"], "positions"], [["ranks"], "unload"],
    [["unload", "positions"], "ranks"], [STEPS, undefined],
  ]) assert.equal(nextStep(new Set(done)), next);
});

const MORE = "With these jams nothing ends above 60 %.";
const NOWHERE = "it prefers no place to height.";
const FELL = [0.95, 0.9, 0.3, 0.2];
const BEST = "It fell: best after 6,400 picks, with 95 % in new containers; 20 % at the end";

// The pattern of the line that is said, what frozen weights did, and what differs from others.
const RUNS = [
  ["57 % of its latest picks succeeded.", [], { picks: 31_999 }],
  ["57 % of its latest picks succeeded; with its weights frozen, 88 %.", [0.3, 0.88], { running: true }],
  ["It learned: 95 % of its picks in new containers succeed, after 2.0 s.", [0.3, 0.95]],
  [`It did not fall: 94 % at the end, 94 % at best; it.*`, [0.3, 0.94]],
  [`It learned: 58 %.*${MORE}`, [0.2, 0.58], { seamless: true }],
  [`It did not fall: 50 %.*${MORE}`, [0.3, 0.5], { seamless: true }],
  [`It fell.*${MORE}`, [0.6, 0.3], { seamless: true }],
  ["It did not learn: 49 % at the end, 49 % at best; it prefers no place to height.", [0.3, 0.49]],
  ["It learned in part: 59 % at the end, 62 % at best; the paper’s agent ends at 60 %.", [0.62, 0.59], { sees: "index" }],
  ["It learned in part: 59 % at the end, 62 % at best; it.*", [0.62, 0.59]],
  ["It did not fall: 90 %.*", [0.3, 0.9]],
  ["It got worse: best after 6,400 picks, with 90 % .*", [0.9, 0.69]],
  ["It got worse.*", [0.94, 0.2]],
  ["It fell.*", [0.95, 0.75]],
  [`It got worse.*${MORE}`, [0.56, 0.3], { seamless: true }],
  ["It learned in part.*", [0.9, 0.71]],
  ["It is stuck: 89 % of its picks repeat one that has just failed.", FELL, { repeated: 0.89 }],
  ["It fell.*", FELL, { repeated: 0.5 }],
  // Used in another way now than when it was judged.
  ["It learned in part: 59 % at the end, 59 % at best.*", [0.19], { rates: { mask: { success_rate: 0.59 } } }],
  ["It is stuck: 81 %.*", [0.59], { use: "no_mask", rates: { no_mask: { success_rate: 0.19, repeated: 0.81 } } }],
];
for (const [slopes, why, changes] of [
  [[0.1, -0.5, 1], "it prefers the left side to height."],
  [[0.1, 0.5, 1], "it prefers the right side to height."],
  [[-0.3, 0.5, 1], "it prefers the rear to height."],
  [[0.3, 0.5, 1], "it prefers the front to height."],
  [[0.3, 0.5, 1], "it prefers the right side to height.", { ties: "average" }],
  [[0.3, 0.4, 1], NOWHERE, { ties: "average" }],
  [[0.22, 0.42, 1], NOWHERE],
  [[0.6, 0, 3], NOWHERE],
  [[0.6, 0, -1], "it prefers low boxes."],
  [[9, 9, 1], NOWHERE, { sees: "positions" }],
]) RUNS.push([`${BEST}; ${why}`, FELL, { slopes, ...changes }]);

const says = (line, expected) => assert.match(line, new RegExp(`^${expected}$`));

test("the verdict of a run", () => {
  assert.equal(words.runVerdict({ points: [], frozen: [] }, DEFAULTS, TASK), "");
  for (const [expected, success, changes] of RUNS) {
    const given = { slopes: [0, 0, 1], picks: 32_000, repeated: 0.1, rates: {}, ...changes };
    const { slopes, repeated, ...run } = given;
    const judged = (success_rate, i) => ({ success_rate, repeated, picks: 6_400 * (i + 1) });
    const points = [{ success_rate: 0.57, slopes }];
    const config = { ...DEFAULTS, sees: "ranks", ...changes, picks: 32_000 };
    says(words.runVerdict({ ...run, points, frozen: success.map(judged), seconds: 2.04 }, config, TASK), expected);
  }
});

test("what the mask shows", () => {
  const said = (masked, repeated) => words.useVerdict({
    mask: { success_rate: masked, repeated: 0 }, no_mask: { success_rate: 0.15, repeated },
  });
  const line = "With the mask these weights succeed in 54 % of picks, without it in 15 %";
  assert.equal(said(0.54, 0.4), `${line}.`);
  assert.equal(said(0.54, 0.84), `${line}; there they are stuck: 84 % repeat a pick that has just failed.`);
  assert.equal(words.useVerdict({ mask: { success_rate: 1 } }), "");
});

test("what blank coordinates show, and what of it is shared", () => {
  const start = "With height alone these weights succeed in ";
  for (const [seen, blank, line, shared, changes] of [
    [0.96, undefined, "", ""],
    [undefined, 0.96, `${start}96 % of picks.`, ""],
    [0.34, 1, `${start}.*in 34 %: they know height, but a side outweighed it.`, "34 to 100"],
    [0.34, 0.8, `${start}.*in 34 %: not only a place misled them.`, "34 to 80"],
    [0.34, 0.43, `${start}.*in 34 %: their mistakes are not those of a place.`, ""],
    [0.99, 1, `${start}100 % of picks, with x and y in 99 %: no place misleads them.`, ""],
    [0.3, 0.58, `${start}.*: they know height, .*`, "30 to 58", { seamless: true }],
  ]) {
    const judged = { rates: {} };
    if (seen) judged.rates.mask = { success_rate: seen };
    if (blank) judged.rates.height = { success_rate: blank };
    says(words.heightVerdict(judged, { ...DEFAULTS, ...changes }, TASK), line);
    const sentence = `Hide x and y: the same weights go from ${shared} %, and nothing was trained.`;
    assert.equal(words.headline(judged.rates), shared && sentence);
  }
});

test("what became of the reader's pick", () => {
  for (const [free, success, line] of [
    [true, true, "Unloaded: no box lay on it."], [false, false, "Failed: a box lies on it."],
    [true, false, "Failed: it jams, although no box lies on it."],
  ]) {
    const container = { present: Uint8Array.from([1, 0, 0, 0]), picks: 5, liftable: () => free };
    const said = words.pickVerdict(container, 0, success);
    assert.equal(said, `${line} 3 of your 5 picks succeeded.`);
  }
});

// --------------------------------------------------------------------------------------- pictures

test("the curve, and what it says at a place", () => {
  const points = [{ picks: 10, rate: 0.25 }, { picks: 20, rate: 1 }, { picks: 40, rate: 0 }];
  const lines = [3, 1, 0].map((count) => plots.line(points.slice(0, count), "rate", 80));
  assert.deepEqual(lines, ["12.5,75 12.5,75 25,0 50,100", "12.5,75 12.5,75", ""]);
  const at = [0, 0.18, 0.2, 0.4, 1].map((share) => plots.pointAt(points, share, 80).picks);
  assert.deepEqual([at, plots.pointAt([], 0.5, 80)], [[10, 10, 20, 40, 40], undefined]);
});

test("the phase diagram is seen from above", () => {
  const places = [[0.4, 1, 2], [-9, 9, 3], [1, -4, -2]].map(plots.place);
  assert.deepEqual(places, [[0.5, 0.2], [1.5, -1.5], [-1.5, 0.5]]);
  const all = "M-3 -3H3V3H-3Z";
  assert.equal(plots.region([0.22, 0.42]), `${all}M-0.42 -0.22H0.42V0.22H-0.42Z`);
  assert.equal(plots.region([Infinity, 0.42]), `${all}M-0.42 -3H0.42V3H-0.42Z`);
  assert.equal(plots.region([Infinity, Infinity]), "");
});

for (const [axis, blank] of [[0, false], [1, false], [1, true]]) {
  test(`maps are what features add to the score along axis ${axis}, blank ${blank}`, () => {
    const network = new PEQNetwork(5, new Generator(1));
    const [side, at] = [4, (number) => (number + 0.5) / 2 - 1];
    const scores = range(16).map((i) => {
      const seen = new Float32Array(3);
      if (!blank) seen[axis] = at(i % side);
      seen[2] = -at(Math.floor(i / side)); // the first row is the highest
      return network.scores(seen)[0];
    });
    const maps = plots.featureMaps(network, axis, blank, side);
    const sum = scores.map((_, i) => maps.reduce((total, map) => total + map[i], 0));
    near(sum, scores, 1e-6);
    near(plots.sumMap(maps), sum.map((value) => value - mean(sum)));
    assert.equal(maps.length, 5);
    assert.ok(Math.max(...sum) - Math.min(...sum) > 0.01);
    assert.equal(Math.abs(sum[0] - sum[3]) < 1e-9, blank, "a row is even if x and y are blank");
  });
}

test("pixels are blue for a box and orange against it", () => {
  const drawn = [];
  globalThis.ImageData = class { constructor(...fields) { this.fields = fields; } };
  const pen = { putImageData: (image, x, y) => drawn.push([image.fields, x, y]) };
  const canvas = { getContext: () => pen };
  plots.paint(canvas, Float64Array.from([2, -1, 0, 0.5]), 2);
  plots.paint(canvas, new Float64Array(9), 0);
  const [[[pixels, ...size], ...place], [[none]]] = drawn;
  assert.ok(pixels[0] < pixels[2] && pixels[4] > pixels[6]);
  assert.deepEqual([3, 7, 11, 15].map((i) => pixels[i]), [255, 128, 0, 64]);
  assert.deepEqual([size, place, canvas.width, none[3]], [[2, 2], [0, 0], 3, 0]);
});

// ---------------------------------------------------------------------------------------- drawing

// Items in the middle, left, right, above, below, and far in the rear and to the right.
const SEEN = [[0, 0, 0], [0, -0.3, 0], [0, 0.3, 0], [0, 0, 0.3], [0, 0, -0.3], [-0.9, 0.3, 0]];
const boxes = (...visible) => ({ seen: SEEN, visible });
const others = (...places) => ({ seen: [[0, 0, 0], ...places], visible: range(places.length + 1) });

test("arrows choose the next box in their direction", () => {
  assert.deepEqual(Object.values(ARROWS), [[-1, 0], [1, 0], [0, 1], [0, -1]]);
  const all = boxes(0, 1, 2, 3, 4, 5);
  for (const [container, chosen, way, next] of [
    [all, 0, "Left", 1], [all, 0, "Right", 2], [all, 0, "Up", 3], [all, 0, "Down", 4],
    [boxes(0, 1), 1, "Right", 0], [boxes(0, 1, 3, 4, 5), 0, "Right", 5],
    [all, -1, "Up", 3], [all, 2, "Right", 2], [boxes(1, 2), 0, "Left", 1], // none, last, gone
    [others([0, 0.5, 0.1], [0, 0.85, 0]), 0, "Right", 1], // a step aside counts three times
    [others([0, 0.5, 0.15], [0, 0.85, 0]), 0, "Right", 2],
    [others([0, 0.2, 0.3], [0, 0.5, 0]), 0, "Right", 2],
    [others([0.5, 0.005, 0]), 0, "Right", 0], // at the same place
    [others([-0.5, 0.2, 0], [0.5, 0.25, 0]), 0, "Right", 2], // rather in front
    [boxes(), -1, "Up", -1], [boxes(), 3, "Up", 3],
  ]) assert.equal(towards(container, chosen, ARROWS[`Arrow${way}`]), next, `${chosen} ${way}`);
  const nearby = [[boxes(1, 5), 0], [boxes(1, 3), 5], [all, 3], [boxes(), 0]];
  assert.deepEqual(nearby.map((given) => nearest(...given)), [1, 3, 3, -1]);
});

globalThis.devicePixelRatio = 2;
globalThis.Path2D = class {
  constructor(text) {
    const numbers = text.match(/-?[\d.]+(e-?\d+)?/g).map(Number);
    this.corners = numbers.flatMap((x, i) => (i % 2 ? [] : [[x, numbers[i + 1]]]));
  }
};

/** Draw boxes with their places in the order: what is filled and stroked, and the drawing. */
function draw(changes, places = [], chosen = -1) {
  const [fills, strokes] = [[], []];
  const pen = {
    fill() { fills.push(this.fillStyle.match(/[\d.]+/g).map(Number)); },
    stroke({ corners }) { strokes.push([this.strokeStyle, corners, this.lineWidth]); },
    isPointInPath({ corners }, x, y) {
      let inside = false;
      corners.forEach(([ax, ay], i) => {
        const [bx, by] = corners.at(i - 1);
        if (ay > y !== by > y && x < ax + ((y - ay) * (bx - ax)) / (by - ay)) inside = !inside;
      });
      return inside;
    },
  };
  const canvas = { clientWidth: 270, clientHeight: 306, getContext: () => pen };
  const drawing = new Drawing(canvas, TASK);
  // A large box, and one two walls in front of it, which leaves its upper half to be seen.
  const { cells_wide: width, rows_high, rows, walls } = TASK;
  const box = (wall, height) => ({ wall, left: 0, lower: 0, width, height });
  const two = [box(walls - 3, rows * rows_high), box(walls - 1, (rows * rows_high) / 2)];
  const container = { boxes: two, present: [1, 1], failed: new Set(), ...changes };
  drawing.draw(container, new Map(places), chosen);
  return { canvas, drawing, fills, marked: strokes.filter(([colour]) => colour.startsWith("#")) };
}

test("a click finds the box that is seen there", () => {
  const { canvas, drawing } = draw({});
  assert.deepEqual([canvas.width, canvas.height], [540, 612]);
  // From the front of the near box upwards: its top, the far box, and beside both.
  const found = [[135, 242], [135, 152], [135, 62], [1, 1]].map((place) => drawing.boxAt(...place));
  assert.deepEqual(found, [1, 1, 0, undefined]);
  const alone = draw({ present: [1, 0] }).drawing;
  assert.ok(alone.faces.every(({ item }) => item === 0));
});

test("boxes are drawn from the rear upwards and inwards, of a wall all fronts at last", () => {
  const box = (wall, left, lower) => ({ wall, left, lower, width: 4, height: 4 });
  const some = [box(5, 0, 4), box(5, 0, 0), box(5, 14, 4), box(5, 30, 4), box(4, 0, 0)];
  const { faces } = draw({ boxes: some, present: some.map(() => 1) }).drawing;
  const items = faces.map(({ item }) => item);
  assert.deepEqual([...new Set(items)], [4, 1, 0, 3, 2]);
  assert.deepEqual(items.filter((item) => item === 1 || item === 2), [1, 1, 2, 2, 1, 2]);
});

test("colours show the order, and lines what failed or is chosen", () => {
  const plain = draw({}, [[0, 0], [1, 1]]);
  const [side, top, front] = plain.fills; // of the rear box, the first in its order: dark blue
  assert.deepEqual([top, plain.fills[4]], [[68, 5, 84], [253, 230, 34]]); // the last is yellow
  near(front, top.map((value) => 0.84 * value));
  near(side, top.map((value) => 0.66 * value));
  assert.deepEqual(draw({}).fills[1], [186, 186, 182]); // is not seen
  const [, bar] = PAGE.match(/#scale .*linear-gradient\(90deg, (.+?)\);/);
  const colours = bar.match(/\d+, \d+, \d+/g).map((colour) => colour.split(", ").map(Number));
  assert.equal(colours.length, 5);
  colours.forEach((colour, i) => near(draw({}, [[0, i / 4]]).fills[1], colour, 1));

  // A cross goes from corner to corner; an outline goes round.
  const { marked: failed } = draw({ failed: new Set([1]) });
  const { marked: chosen } = draw({}, [], 1);
  assert.deepEqual([plain.marked.length, failed.length, chosen.length], [0, 3, 3]);
  const [[, cross, wide], [, outline]] = [failed.at(-1), chosen.at(-1)];
  assert.deepEqual([cross, wide], [[0, 2, 1, 3].map((i) => outline[i]), 6]);
});

test("what is nearer is larger", () => {
  const { drawing } = draw({});
  const places = [[0, 0, 0], [0, 2.5, 0], [5, 0, 0], [5, 0, 2.5]];
  const [left, right, nearer, upper] = places.map((place) => drawing.project(place));
  assert.ok(nearer[0] < left[0] && left[0] < right[0]);
  assert.ok(upper[1] < nearer[1] && left[1] < nearer[1]);
});

// ----------------------------------------------------------------------------------------- worker

/**
 * The page's worker: `tell` gives a command and returns what it answers at once, `rest` what it
 * does until nothing is left to do, and `some` what its next turns do; of several answers the last.
 */
function startWorker(changes) {
  let [said, queue, time] = [[], [], 0];
  const context = createContext({
    postMessage: (message) => said.push(structuredClone(message)),
    performance: { now: () => (time += 10) },
    setTimeout: (call, _, ...given) => { queue = [() => call(...given)]; },
    clearTimeout: () => { queue = []; },
  });
  runInContext(`${inPage("library")}\n${inPage("worker")}`, context);
  const brief = ({ points, frozen, rates, parameters, ...run }) => ({
    ...run, points: points.length, frozen: frozen.length, rates, judged: Object.keys(rates).sort(),
    weights: [...parameters],
  });
  const some = (count) => {
    for (let i = 0; i < count && queue.length; i++) queue.shift()();
    return said.splice(0).map(brief);
  };
  const config = { ...DEFAULTS, picks: 480, batch_size: 8, ...changes };
  const tell = (command, settings) => {
    const data = { command, config: { ...config, ...settings }, task: SMALL, number: 7 };
    context.onmessage({ data });
    return some(0).at(-1);
  };
  return { tell, some, rest: () => some(10_000) };
}

test("the worker trains until its goal, and judges", () => {
  const { tell, rest } = startWorker({});
  tell("reset", { seed: 4 });
  tell("step");
  const reset = tell("reset");
  assert.deepEqual([reset.number, reset.picks, reset.running, reset.points], [7, 0, false, 0]);
  assert.equal(rest().length, 0, "weights that never learned are not judged");
  const begun = tell("train");
  assert.ok(begun.running && 0 < begun.picks && begun.picks < 480);
  const [end, first, judged] = rest().slice(-3);
  assert.deepEqual([end.picks, end.running, end.points, end.judged], [480, false, 40, []]);
  assert.deepEqual([first.judged, judged.judged], [["mask"], ["mask", "no_mask"]]);
  assert.deepEqual([judged.picks, judged.frozen], [480, 1]);
  // The clock goes on by 0.01 s each time it is asked: once in a report, once before each step.
  assert.ok(reset.seconds === 0.01 && judged.seconds > 0.1);
  tell("train");
  assert.equal(rest().at(-1).picks, 960);
  const anew = tell("reset", { seed: 3 });
  assert.equal(anew.picks, 0);
  assert.notDeepEqual(anew.weights, reset.weights);
});

test("the worker pauses, steps, and takes over changes", () => {
  const { tell, some, rest } = startWorker({});
  tell("reset");
  tell("train");
  some(2);
  const paused = tell("pause");
  assert.ok(!paused.running && 0 < paused.picks && paused.picks < 480);
  const rested = rest().at(-1);
  assert.deepEqual([rested.picks, rested.judged], [paused.picks, ["mask", "no_mask"]]);
  const [step, again] = [tell("step"), tell("step")];
  assert.deepEqual([step.picks, step.running, step.judged], [paused.picks + 4, false, []]);
  assert.ok(step.points > paused.points && again.points === step.points + 1);
  assert.notDeepEqual(step.weights, paused.weights);
  tell("train");
  const changed = tell("change", { learning_rate: 0 });
  const end = rest().at(-1);
  assert.ok(changed.running && end.picks === 480);
  assert.deepEqual(end.weights, changed.weights);
});

test("weights are judged in each use", () => {
  const { tell, some, rest } = startWorker({ sees: "ranks", learning_rate: 0 });
  tell("reset");
  tell("train");
  rest();
  const kept = tell("use", { use: "height" });
  const all = rest().at(-1);
  const uses = ["height", "mask", "no_mask"];
  assert.deepEqual([kept.judged, all.judged], [["mask", "no_mask"], uses]);
  assert.deepEqual([all.weights, tell("use").rates], [kept.weights, all.rates]);
  assert.equal(rest().length, 0, "all is known");
  assert.equal(new Set(uses.map((use) => all.rates[use].success_rate)).size, 3);
  assert.deepEqual(tell("change", { seamless: true }).judged, []);
  // In the midst of a run it stops.
  tell("train");
  some(1);
  const stopped = tell("use", { use: "height" });
  assert.deepEqual([stopped.running, stopped.judged], [false, []]);
  const then = rest();
  assert.deepEqual([then[0].judged, then.at(-1).judged], [["height"], uses]);
  assert.equal(then.at(-1).picks, stopped.picks);
});
