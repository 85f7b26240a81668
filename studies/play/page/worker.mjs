// The training in a thread of its own, so that the page stays smooth.

const FRAME = 30; // ms of training between two messages to the page
let training, timer, goal = 0; // the run, what continues it, and after how many picks it pauses

onmessage = ({ data: { command, config, task } }) => {
  clearTimeout(timer);
  if (command === "reset") training = new Training(config, task);
  else training.change(config);
  if (command === "train") goal = (Math.floor(training.picks / config.picks) + 1) * config.picks;
  if (command === "reset" || command === "pause") goal = 0;
  if (command === "step") training.step();
  work();
};

function work() {
  const end = performance.now() + FRAME;
  while (training.picks < goal && performance.now() < end) training.step();
  const { network, points, picks } = training;
  const { boxes, present, visible, observation, failed } = training.containers[0];
  const container = { boxes, present, visible, observation, failed };
  postMessage({ container, parameters: network.parameters, points, picks, running: picks < goal });
  if (picks < goal) timer = setTimeout(work); // in between, commands are read
}
