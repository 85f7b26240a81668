// The page: what the reader does goes to a container or to the worker, and what these say is shown.

const element = (id) => document.getElementById(id);
const task = JSON.parse(element("task").textContent);
const [canvas, form, presets] = ["canvas", "settings", "presets"].map(element);
const drawing = new Drawing(canvas, task);
const network = new PEQNetwork(N_FEATURES, new Generator(0)); // its weights come from the worker
const code = ["library", "worker"].map((id) => element(id).textContent);
const worker = new Worker(URL.createObjectURL(new Blob(code)));
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
let config, run, mine, chosen; // settings, the worker's last report, the reader's container, a box

for (const [name, [text, choices]] of Object.entries(SETTINGS)) {
  const [label, select] = ["label", "select"].map((kind) => document.createElement(kind));
  select.name = name;
  select.append(...Object.entries(choices).map((choice) => new Option(...choice)));
  label.append(text, select);
  form.lastElementChild.before(label); // the seed stands last
}

const send = (command) => worker.postMessage({ command, config, task });

/** Take over settings; begin from the first weights if the seed is another one, or if `anew`. */
function set(text, anew) {
  const seed = config?.seed;
  config = fromText(text);
  history.replaceState(null, "", `#${toText(config)}`);
  for (const [name, value] of Object.entries(config)) form.elements[name].value = value;
  for (const button of presets.children) {
    const preset = { ...PRESETS[button.value], seed: config.seed };
    button.ariaPressed = toText(preset) === toText(config);
  }
  const begin = anew || config.seed !== seed;
  if (begin) {
    const generator = new Generator(config.seed);
    mine = new Container(stackLoad(generator, task), task, generator);
    [chosen, element("status").textContent] = [-1, "\u00a0"]; // a line that is empty
  }
  mine.show(config);
  send(begin ? "reset" : "change");
}

function pick(item) {
  if (!element("mine").checked || !(item >= 0)) return; // no box is there
  if (!mine.visible.includes(item)) {
    element("status").textContent = "This box is not among the 128 nearest ones.";
    return;
  }
  const how = mine.pick(item) ? "Unloaded." : "Failed: a box lies on it.";
  const unloaded = mine.present.filter((here) => !here).length;
  element("status").textContent = `${how} ${unloaded} of ${mine.picks} picks succeeded.`;
  render();
}

/** Choose, by an arrow key, the next box in its direction, across or upwards, rather in front. */
function move([right, up]) {
  const from = mine.seen[chosen] ?? mine.seen[mine.visible[0]];
  const far = (item) => {
    const [x, y, z] = mine.seen[item].map((value, axis) => value - from[axis]);
    const ahead = y * right + z * up;
    return ahead > 0.01 ? ahead + 3 * Math.abs(y * up - z * right) - x : Infinity;
  };
  const next = mine.visible.reduce((best, item) => (far(item) < far(best) ? item : best));
  if (far(next) < Infinity) chosen = next;
  render();
}

function render() {
  const own = element("mine").checked;
  const container = own ? mine : run.container;
  network.parameters.set(run.parameters);
  const scores = compared(network, container.observation, config);
  const order = [...scores.keys()].sort((a, b) => scores[a] - scores[b]);
  const places = order.map((row, i) => [container.visible[row], i / (order.length - 1)]);
  drawing.draw(container, new Map(places), own ? chosen : -1);
  element("train").textContent = run.running ? "Pause" : "Train";
  element("picks").textContent = `${run.picks.toLocaleString("en")} picks`;
  const end = Math.max(config.picks, run.picks);
  for (const name of ["success_rate", "epsilon"]) {
    const corner = (point) => [(100 * point.picks) / end, 100 - 100 * point[name]];
    element(name).setAttribute("points", run.points.map(corner).join(" "));
  }
  const last = run.points.at(-1);
  element("rate").textContent = last ? `${Math.round(100 * last.success_rate)} %` : "";
  ["x", "y"].forEach((name, axis) => {
    const turn = (kind, radians) =>
      Object.assign(element(`${kind}-${name}`).style, { rotate: `${radians}rad`, opacity: last ? 1 : 0 });
    turn("needle", last ? Math.atan2(last.slopes[axis], last.slopes[2]) : 0);
    turn("surface", last ? Math.atan(2 * last.tilts[axis]) : 0);
  });
}

/** Give the worker a command, and show what it does to the agent's container. */
function watch(command) {
  element("agents").checked = true;
  send(command);
}

worker.onmessage = ({ data }) => {
  run = data;
  requestAnimationFrame(render);
};
onresize = element("mine").onchange = element("agents").onchange = () => run && render();
onhashchange = () => set(location.hash.slice(1), true);
form.onchange = () => set(new URLSearchParams(new FormData(form)), false);
form.onsubmit = (event) => event.preventDefault(); // Enter in a field applies it, no more
presets.onclick = ({ target }) => {
  if (!target.value) return;
  set(toText({ ...PRESETS[target.value], seed: config.seed }), true);
  watch("train");
};
element("train").onclick = () => watch(run?.running ? "pause" : "train");
element("step").onclick = () => watch("step");
element("reset").onclick = () => set(toText(config), true);
canvas.onclick = ({ offsetX, offsetY }) => pick(drawing.boxAt(offsetX, offsetY));
canvas.onkeydown = (event) => {
  if (event.key in ARROWS) move(ARROWS[event.key]);
  else if (event.key === "Enter" || event.key === " ") pick(chosen);
  else return;
  event.preventDefault(); // the page would scroll
};
set(location.hash.slice(1), true);
