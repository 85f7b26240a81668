// The training in a thread of its own, so that the page stays smooth.

const FRAME = 30; // ms of training between two messages to the page
const REST = 60; // ms without a command, after which the weights are judged
let training, timer, goal = 0; // the run, what continues it, and after how many picks it pauses
let number; // of the run, as the page counts
let seconds = 0, rates = {}; // of training; what the weights do in new containers, by their use

onmessage = ({ data: { command, config, task, ...run } }) => {
  clearTimeout(timer);
  number = run.number;
  if (command === "reset") [training, seconds] = [new Training(config, task), 0];
  else training.change(config);
  if (command !== "use") rates = {}; // only that leaves the weights, and what they see
  if (command === "train") goal = (Math.floor(training.picks / config.picks) + 1) * config.picks;
  else if (command !== "change") goal = 0;
  if (command === "step") training.step(), training.addPoint();
  work();
};

/** Train until the goal; then judge the weights. */
function work() {
  const start = performance.now();
  while (training.picks < goal && performance.now() < start + FRAME) training.step();
  seconds += (performance.now() - start) / 1000;
  report();
  // In between, commands are read.
  if (training.picks < goal) timer = setTimeout(work);
  else if (training.picks) timer = setTimeout(judgeWeights, REST);
}

/** Judge the weights as they are used, one way after another; by height only if it is chosen. */
function judgeWeights() {
  const { config, network, task } = training;
  const uses = new Set([config.use, "mask", "no_mask"]);
  const [use] = [...uses].filter((each) => !rates[each]);
  if (!use) return;
  rates[use] = judge(network, { ...config, use }, task);
  report();
  timer = setTimeout(judgeWeights);
}

function report() {
  const { network, points, frozen, picks } = training;
  const { boxes, present, visible, observation, failed } = training.containers[0];
  const container = { boxes, present, visible, observation, failed };
  const run = { number, points, frozen, picks, running: picks < goal, seconds, rates };
  postMessage({ container, parameters: network.parameters, ...run });
}
