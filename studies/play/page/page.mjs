// The page: what the reader does goes to a container or to the worker, and what these say is shown.

const element = (id) => document.getElementById(id);
const task = JSON.parse(element("task").textContent);
const [canvas, form, steps, plot] = ["canvas", "settings", "steps", "plot"].map(element);
const drawing = new Drawing(canvas, task);
const network = new PEQNetwork(N_FEATURES, new Generator(0)); // its weights come from the worker
const code = ["library", "worker"].map((id) => element(id).textContent);
const worker = new Worker(URL.createObjectURL(new Blob(code)));
const MAP_SIDE = 12; // pixels
const done = new Set(); // steps
let config, run, mine, chosen; // settings, the worker's last report, the reader's container, a box
let number = 0; // of runs, because a report of an earlier one may come late
let frame; // that will be drawn
let [step, said] = ["unload", ""]; // the step that is told of, what the reader's last pick did

const make = (kind, fields, ...content) => {
  const made = Object.assign(document.createElement(kind), fields);
  made.append(...content);
  return made;
};
for (const [name, [text, options, title]] of Object.entries(CHOICES)) {
  if (name === "use") continue; // stands beside its numbers
  const choices = Object.entries(options).map((option) => new Option(...option));
  const select = make("select", { name }, ...choices);
  element("jams").before(make("label", { title }, text, select));
}
const tiles = Array.from({ length: N_FEATURES }, () => make("canvas", {}));
element("features").append(...tiles);

// Files beside the page: in the repository, or in its site. A copy that stands alone says where.
for (const link of document.querySelectorAll("a[data-file]")) {
  const { file } = link.dataset;
  const folder = location.pathname.split("/").at(-2);
  if (folder === "play") link.href = `../${file.replace(/\.\w+$/, ".html")}`;
  else if (folder === "figures") link.href = `../${file}`;
  else link.append(` (in the repository: ${file})`);
}

const send = (command) => worker.postMessage({ command, config, task, number });

/** Take over settings; begin from the first weights if the seed is another one, or if `anew`. */
function set(text, anew) {
  const before = config;
  const read = fromText(text);
  config = read.config;
  element("problems").textContent = read.problems.join(" ");
  element("problems").hidden = !read.problems.length;
  history.replaceState(null, "", `#${toText(config)}`);
  for (const [name, value] of Object.entries(config)) form.elements[name].value = value;
  const begin = anew || config.seed !== before?.seed;
  if (begin) {
    const generator = new Generator(config.seed);
    mine = new Container(stackLoad(generator, task), task, generator);
    [chosen, said, run] = [-1, "", undefined];
    number++;
  }
  mine.show(config);
  send(begin ? "reset" : config.use === before.use ? "change" : "use");
}

/** Settings of a step; the seed and the walls stay. */
function preset(name) {
  const { seed, seamless, jam } = config;
  return { ...PRESETS[name], seed, seamless, jam };
}

/** The step of these settings, or "own". */
function named() {
  const names = Object.keys(PRESETS);
  return names.find((name) => toText(preset(name)) === toText(config)) ?? "own";
}

/** Do what a step says. */
function begin(name) {
  step = name;
  if (name === "unload") element("mine").checked = true;
  else if (name !== "height") {
    set(toText(preset(name)), true);
    watch("train");
  } else if (run?.picks) set(toText({ ...config, use: "height" }), false);
  render();
}

function pick(item) {
  if (!element("mine").checked || !(item >= 0)) return false; // no box is there
  step = "unload";
  const seen = mine.visible.includes(item);
  const success = seen && mine.pick(item);
  said = seen ? pickVerdict(mine, item, success) : "This box is not among the 128 nearest ones.";
  if (success) done.add("unload");
  render();
  return success;
}

function verdict() {
  if (step === "unload") return said;
  if (!run.picks) return step === "height" || step === "use" ? UNTRAINED : "";
  if (step === "height") return heightVerdict(run, config, task);
  const told = step === "use" || step === "no_mask" ? useVerdict(run.rates) : "";
  return told || runVerdict(run, config, task);
}

function render() {
  if (!run) return; // a report will come
  const { frozen, parameters, picks, points, rates, running } = run;
  network.parameters.set(parameters);
  if (rates.height) done.add("height");
  showSteps();
  showContainer();
  element("train").textContent = running ? "Pause" : "Train";
  element("picks").textContent = `${picks.toLocaleString("en")} picks`;
  for (const use of Object.values(CHOICES.use[1])) {
    element(`rate-${use}`).textContent = rates[use] ? percent(rates[use].success_rate) : "";
  }
  showCurve({ success_rate: points, frozen }, Math.max(config.picks, picks));
  showFound(rates);
  showPreferences(points);
  showMaps();
  element("jams").hidden = !config.seamless;
  element("share").textContent = config.jam;
}

function showSteps() {
  const next = nextStep(done);
  for (const { firstChild: button } of steps.children) {
    button.ariaCurrent = button.value === step ? "step" : null;
    button.disabled = button.value === "height" && run.running; // of weights that have settled
    button.className = done.has(button.value) ? "done" : button.value === next ? "next" : "";
  }
  element("sentence").textContent = SENTENCES[step];
  element("verdict").ariaLive = run.running ? "off" : "polite"; // not at each of many changes
  element("verdict").textContent = verdict() || "\u00a0"; // a line that is empty
}

function showContainer() {
  const own = element("mine").checked;
  const container = own ? mine : run.container;
  const scores = compared(network, container.observation, config);
  const order = [...scores.keys()].sort((a, b) => scores[a] - scores[b]);
  const places = order.map((row, i) => [container.visible[row], i / (order.length - 1 || 1)]);
  drawing.draw(container, new Map(places), own ? chosen : -1);
}

function showCurve(curves, end) {
  element("epsilon").setAttribute("points", line(curves.success_rate, "epsilon", end));
  for (const [name, points] of Object.entries(curves)) {
    element(name).setAttribute("points", line(points, "success_rate", end));
  }
  const last = ([point]) => (point ? percent(point.success_rate) : "");
  element("rate").textContent = last(curves.success_rate.slice(-1));
  const [latest] = curves.success_rate.slice(-1);
  element("epsilon-rate").textContent = latest ? percent(latest.epsilon) : "";
  element("frozen-rate").textContent = last(curves.frozen.slice(-1));
  element("end").textContent = end.toLocaleString("en");
  element("ceiling").setAttribute("d", `M0 ${100 - 100 * ceiling(config)}H100`);
}

/** Offer what hiding x and y has shown, as words with a link and as a picture. */
function showFound(rates) {
  const [found, said] = [element("found"), headline(rates)];
  if (found.hidden !== !said) element("copy").textContent = "Copy link";
  found.hidden = !said;
  found.firstChild.textContent = said;
}

async function copyLink() {
  const link = `${location.href.split("#")[0]}#${toText({ ...config, use: "mask" })}`;
  const text = `${headline(run.rates)} ${link}`;
  try {
    await navigator.clipboard.writeText(text);
    element("copy").textContent = "Copied";
  } catch {
    prompt("Your browser lets no page copy. Copy this:", text);
  }
}

function savePicture() {
  const picture = make("canvas", {});
  const { mask, height } = run.rates;
  const rates = [["with x, y and height", mask], ["with height only", height]];
  const lines = ["Hide x and y", "The same weights, and nothing", "was trained: a preferred side",
    "had outweighed the height."];
  poster(picture, canvas, lines, rates);
  make("a", { href: picture.toDataURL(), download: "hide_x_and_y.png" }).click();
}

function showPreferences(points) {
  const most = limits(config, task.thresholds);
  const known = most.map((limit, axis) => `${limit} along ${"xy"[axis]}`);
  const above = known.filter((_, axis) => most[axis] < Infinity).join(" or ");
  element("region").setAttribute("d", region(most));
  element("trail").setAttribute("points", points.map((point) => place(point.slopes)).join(" "));
  const last = points.at(-1);
  const [x, y] = last ? preferences(last.slopes) : [];
  const [right, down] = last ? place(last.slopes) : [0, 0];
  element("dot").setAttribute("transform", `translate(${right} ${down})`);
  element("dot").style.opacity = last ? 1 : 0;
  element("preferences").textContent = last ? `x ${signed(x)}, y ${signed(y)}` : "";
  const positions = "On positions, a rule errs only above 0.67 along y.";
  const none = config.sees === "index" ? "No limits are known of the index." : positions;
  element("limits").textContent = above ? `Shaded: nearly all runs err (above ${above}).` : none;
}

const signed = (value) => value.toFixed(2).replace("-", "\u2212");

function showMaps() {
  const maps = featureMaps(network, Number(element("axis").value), config.use === "height", MAP_SIDE);
  const largest = Math.max(...maps.flatMap((map) => [...map].map(Math.abs)));
  maps.forEach((map, f) => {
    const [x, y, z] = [...network.extractor.subarray(4 * f, 4 * f + 3)].map(signed);
    const score = signed(network.scorer[f]);
    paint(tiles[f], map, largest);
    tiles[f].title = `Feature ${f + 1}: x ${x}, y ${y}, z ${z}; its weight in the score: ${score}`;
  });
  const sum = sumMap(maps);
  paint(element("sum"), sum, Math.max(...sum.map(Math.abs)));
}

/** Give the worker a command, and show what it does to the agent's container. */
function watch(command) {
  element("agents").checked = true;
  if (["unload", "height", "use"].includes(step)) step = named();
  send(command);
}

worker.onmessage = ({ data }) => {
  if (data.number !== number) return;
  if (run?.running && !data.running && data.picks >= config.picks) done.add(named());
  run = data;
  cancelAnimationFrame(frame); // one picture is drawn of all that came since the last
  frame = requestAnimationFrame(render);
};
onresize = element("axis").onchange = render;
element("mine").onchange = element("agents").onchange = render;
onhashchange = () => set(location.hash.slice(1), true);
form.onchange = ({ target }) => {
  set(new URLSearchParams(new FormData(form)), false);
  if (target.name !== "use") step = named();
  else step = config.use === "height" ? "height" : "use";
};
form.oninput = () => (element("share").textContent = form.elements.jam.value);
form.onsubmit = (event) => event.preventDefault(); // Enter in a field applies it, no more
steps.onclick = ({ target }) => target.value && begin(target.value);
element("train").onclick = () => watch(run?.running ? "pause" : "train");
element("step").onclick = () => watch("step");
element("copy").onclick = copyLink;
element("save").onclick = savePicture;
element("reset").onclick = () => set(toText(config), true);
plot.onpointermove = ({ offsetX }) => {
  if (!run) return;
  const end = Math.max(config.picks, run.picks);
  const share = offsetX / plot.clientWidth;
  const at = [run.points, run.frozen].map((points) => pointAt(points, share, end));
  const [rate, frozen] = at.map((point) => point && percent(point.success_rate));
  const also = frozen ? `, frozen ${frozen}` : "";
  const says = rate && `${at[0].picks.toLocaleString("en")} picks: ${rate}${also}`;
  element("readout").textContent = says || "picks";
};
plot.onpointerleave = () => (element("readout").textContent = "picks");
canvas.onclick = ({ offsetX, offsetY }) => pick(drawing.boxAt(offsetX, offsetY));
canvas.onkeydown = (event) => {
  if (!element("mine").checked) return;
  if (event.key in ARROWS) chosen = towards(mine, chosen, ARROWS[event.key]);
  else if (event.key !== "Enter" && event.key !== " ") return;
  else if (pick(chosen)) chosen = nearest(mine, chosen);
  event.preventDefault(); // the page would scroll
  render();
};
set(location.hash.slice(1), true);
