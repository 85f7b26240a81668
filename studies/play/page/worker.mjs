// The training in a thread of its own, so that the page stays smooth.

const FRAME = 30; // ms of training between two messages to the page
const REST = 60; // ms without a command, after which frozen weights are judged
let training, timer, goal = 0; // the run, what continues it, and after how many picks it pauses
let number; // of the run, as the page counts
let seconds = 0, rates = {}; // of training; of fresh picks, by whether x and y are blank

onmessage = ({ data: { command, config, task, ...run } }) => {
  clearTimeout(timer);
  number = run.number;
  if (command === "reset") [training, seconds] = [new Training(config, task), 0];
  else training.change(config);
  const frozen = command === "freeze";
  if (!frozen) rates = {}; // only a freeze leaves the weights, and all but what is blank
  if (command === "train") goal = (Math.floor(training.picks / config.picks) + 1) * config.picks;
  else if (command !== "change") goal = 0;
  if (command === "step") training.step(), training.addPoint();
  work(frozen ? [config.blank, !config.blank] : [config.blank]);
};

/** Train until the goal; then judge the weights, whose picks are compared in these ways. */
function work(ways) {
  const start = performance.now();
  while (training.picks < goal && performance.now() < start + FRAME) training.step();
  seconds += (performance.now() - start) / 1000;
  report();
  // In between, commands are read.
  if (training.picks < goal) timer = setTimeout(work, 0, ways);
  else if (training.picks) timer = setTimeout(judgeWeights, REST, ways);
}

/** Judge the weights with x and y blank or not: first as they choose now. */
function judgeWeights([blank, ...others]) {
  const { config, network, task } = training;
  rates[blank] ??= judge(network, { ...config, blank }, task);
  report();
  if (others.length) timer = setTimeout(judgeWeights, 0, others);
}

function report() {
  const { network, points, frozen, picks } = training;
  const { boxes, present, visible, observation, failed } = training.containers[0];
  const container = { boxes, present, visible, observation, failed };
  const run = { number, points, frozen, picks, running: picks < goal, seconds, rates };
  postMessage({ container, parameters: network.parameters, ...run });
}
