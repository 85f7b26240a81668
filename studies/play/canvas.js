// Boxes in a container, drawn from the back to the front on a plain canvas: no WebGL is needed.
// What to draw comes from canvas.py; a click on a box goes there.

const ABSENT = 255;
const EDGES = [0, 1, 2, 3, 4, 5, 6, 7].flatMap((corner) =>
  [1, 2, 4].filter((bit) => !(corner & bit)).map((bit) => [corner, corner | bit]),
);
// Of each axis the corners of its faces, low and high side; corner bits: 4 = x, 2 = y, 1 = z.
const FACES = [
  [[0, 1, 3, 2], [4, 5, 7, 6]],
  [[0, 1, 5, 4], [2, 3, 7, 6]],
  [[0, 2, 6, 4], [1, 3, 7, 5]],
];
const SHADES = [0.88, 0.74, 1];
const LIFT_MS = 350;

const corner = (low, high, bits) => [
  bits & 4 ? high[0] : low[0],
  bits & 2 ? high[1] : low[1],
  bits & 1 ? high[2] : low[2],
];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => a.map((value) => value / Math.hypot(...a));
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

// An eye that turns about a point; lengths in m, angles in radians.
class Camera {
  constructor(target) {
    Object.assign(this, { target, angle: -0.5, height: 0.4, distance: 9.2 });
  }
  aim(width, height) {
    const level = Math.cos(this.height) * this.distance;
    this.eye = [
      this.target[0] + level * Math.cos(this.angle),
      this.target[1] + level * Math.sin(this.angle),
      this.target[2] + this.distance * Math.sin(this.height),
    ];
    this.ahead = unit(minus(this.target, this.eye));
    this.right = unit(cross(this.ahead, [0, 0, 1]));
    this.up = cross(this.right, this.ahead);
    this.zoom = 1.15 * Math.min(width, 1.5 * height);
    this.middle = [0.53 * width, 0.48 * height]; // the legend is at the left
  }
  project(point) {
    const seen = minus(point, this.eye);
    const scale = this.zoom / Math.max(0.1, dot(seen, this.ahead));
    return [
      this.middle[0] + dot(seen, this.right) * scale,
      this.middle[1] - dot(seen, this.up) * scale,
    ];
  }
  ray(x, y) {
    const [right, up] = [(x - this.middle[0]) / this.zoom, (this.middle[1] - y) / this.zoom];
    return this.ahead.map((value, axis) => value + right * this.right[axis] + up * this.up[axis]);
  }
}

// Whether box a can hide box b: 1, the other way round: -1, neither: 0.
function hides(a, b, eye) {
  let answer = 0;
  for (let axis = 0; axis < 3; axis++) {
    let sign = 0;
    if (a.low[axis] >= b.high[axis] - 1e-6) sign = eye[axis] > a.low[axis] ? 1 : -1;
    else if (b.low[axis] >= a.high[axis] - 1e-6) sign = eye[axis] > b.low[axis] ? -1 : 1;
    if (sign && answer && sign !== answer) return 0;
    answer = answer || sign;
  }
  return answer;
}

// Boxes in an order in which none is hidden by an earlier one.
function backToFront(walls, eye) {
  const away = (wall) => Math.abs((wall[0].low[0] + wall[0].high[0]) / 2 - eye[0]);
  return [...walls].sort((a, b) => away(b) - away(a)).flatMap((wall) => {
    const behind = wall.map(() => 0);
    const before = wall.map(() => []);
    for (let i = 0; i < wall.length; i++) {
      for (let j = 0; j < i; j++) {
        const sign = hides(wall[i], wall[j], eye);
        if (sign > 0) before[j].push(i), behind[i]++;
        if (sign < 0) before[i].push(j), behind[j]++;
      }
    }
    const order = [];
    const left = new Set(wall.keys());
    while (left.size) {
      let free = [...left].filter((i) => behind[i] === 0);
      if (!free.length) free = [[...left][0]]; // boxes that hide each other in a circle
      for (const i of free) {
        left.delete(i);
        order.push(wall[i]);
        for (const j of before[i]) behind[j]--;
      }
    }
    return order;
  });
}

const bytes = (view) => new Uint8Array(view.buffer, view.byteOffset, view.byteLength);

function readBoxes(model) {
  const numbers = new Float32Array(bytes(model.get("boxes")).slice().buffer);
  const walls = new Map();
  for (let item = 0; item < numbers.length / 6; item++) {
    const [low, high] = [numbers.slice(6 * item, 6 * item + 3), numbers.slice(6 * item + 3, 6 * item + 6)];
    const key = Math.round((low[0] + high[0]) * 500);
    if (!walls.has(key)) walls.set(key, []);
    walls.get(key).push({ item, low, high, covers: [[], [], [], [], [], []] });
  }
  const boxes = [...walls.values()].flat();
  for (const box of boxes) for (const other of boxes) cover(box, other);
  return [...walls.values()];
}

// Note which share of a face of one box another box covers, because most faces are covered whole
// and need not be drawn. Faces are numbered 2 · axis + side, side 1 being the high one.
function cover(box, other) {
  for (let axis = 0; axis < 3; axis++) {
    if (Math.abs(box.high[axis] - other.low[axis]) > 1e-3) continue;
    let share = 1;
    let back = 1;
    for (const across of [(axis + 1) % 3, (axis + 2) % 3]) {
      const low = Math.max(box.low[across], other.low[across]);
      const both = Math.max(0, Math.min(box.high[across], other.high[across]) - low);
      share *= both / (box.high[across] - box.low[across]);
      back *= both / (other.high[across] - other.low[across]);
    }
    if (share > 0) box.covers[2 * axis + 1].push([other.item, share]);
    if (back > 0) other.covers[2 * axis].push([box.item, back]);
  }
}

function render({ model, el }) {
  const frame = document.createElement("div");
  frame.style.cssText = "position:relative;background:white;border:1px solid #bbb;border-radius:4px";
  const canvas = document.createElement("canvas");
  canvas.style.cssText = "display:block;width:100%;cursor:pointer;touch-action:none";
  canvas.style.height = `${model.get("height")}px`;
  canvas.className = "unload-canvas";
  const label = document.createElement("div");
  label.style.cssText =
    "position:absolute;left:8px;bottom:6px;color:#222;font:12px sans-serif;pointer-events:none";
  frame.append(canvas, label);
  el.append(frame);

  const scene = document.createElement("canvas");
  let pen = canvas.getContext("2d");
  let stale = true; // whether the scene is to be drawn anew
  const camera = new Camera(model.get("target"));
  let walls = readBoxes(model);
  let order = null; // of drawing; null when the camera has moved
  let lift = null;
  let waiting = false;

  function polygon(points) {
    pen.beginPath();
    points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.closePath();
  }
  function visibleFaces({ low, high, covers }, rise = 0, colours = null) {
    const [from, to] = [[...low], [...high]];
    from[2] += rise;
    to[2] += rise;
    return FACES.flatMap((sides, axis) => {
      const side = camera.eye[axis] > to[axis] ? 1 : camera.eye[axis] < from[axis] ? 0 : -1;
      if (side < 0 || (colours && isCovered(covers[2 * axis + side], colours))) return [];
      return [[axis, sides[side].map((bits) => camera.project(corner(from, to, bits)))]];
    });
  }
  function isCovered(covers, colours) {
    let left = 0.999;
    for (const [item, share] of covers) if (colours[item] !== ABSENT) left -= share;
    return left <= 0;
  }
  function drawBox(box, colour, rise = 0, colours = null) {
    for (const [axis, points] of visibleFaces(box, rise, colours)) {
      const shade = (share) => `rgb(${colour.map((value) => 255 * share * value).join()})`;
      polygon(points);
      pen.fillStyle = shade(SHADES[axis]);
      pen.fill();
      pen.strokeStyle = shade(0.55 * SHADES[axis]);
      pen.lineWidth = 0.7;
      pen.stroke();
    }
  }
  function drawContainer() {
    const size = model.get("container");
    pen.strokeStyle = "#999";
    pen.lineWidth = 1;
    for (const [a, b] of EDGES) {
      polygon([a, b].map((bits) => camera.project(corner([0, 0, 0], size, bits))));
      pen.stroke();
    }
    pen.fillStyle = "#555";
    pen.font = "12px sans-serif";
    pen.textAlign = "center";
    pen.fillText("entrance", ...camera.project([size[0] + 0.4, size[1] / 2, 0]));
  }
  function drawLegend() {
    pen.font = "12px sans-serif";
    pen.textAlign = "left";
    model.get("legend").forEach(([name, colour, outlined], row) => {
      const y = 10 + 18 * row;
      pen.fillStyle = `rgb(${colour.map((value) => 255 * value).join()})`;
      pen.fillRect(10, y, 14, 12);
      pen.strokeStyle = outlined ? "black" : "#888";
      pen.lineWidth = outlined ? 2.5 : 1;
      pen.strokeRect(10, y, 14, 12);
      pen.fillStyle = "#222";
      pen.fillText(name, 30, y + 10);
    });
  }
  // All but what moves, on a canvas of its own, because drawing it takes longest.
  function drawScene(ratio) {
    scene.width = canvas.width;
    scene.height = canvas.height;
    const onScreen = pen;
    pen = scene.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    drawContainer();
    order = order || backToFront(walls, camera.eye);
    const colours = bytes(model.get("colours"));
    const palette = model.get("palette");
    for (const box of order) {
      if (colours[box.item] !== ABSENT) drawBox(box, palette[colours[box.item]], 0, colours);
    }
    pen.strokeStyle = "black";
    pen.lineWidth = 2.5;
    const outlined = new Set(model.get("outlined"));
    for (const box of order.filter((each) => outlined.has(each.item))) {
      for (const [, points] of visibleFaces(box)) polygon(points), pen.stroke();
    }
    drawLegend();
    pen = onScreen;
    stale = false;
  }
  function draw(time) {
    waiting = false;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width) return;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio)) [order, stale] = [null, true];
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    camera.aim(width, height);
    if (stale) drawScene(ratio);
    pen.drawImage(scene, 0, 0);
    if (!lift) return;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const share = Math.min(1, (time - lift.start) / LIFT_MS);
    const box = order.find((each) => each.item === lift.item);
    if (share < 1) drawBox(box, lift.colour, lift.distance * Math.max(0, share) ** 2);
    else lift = null;
    redraw();
  }
  function redraw() {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  }
  function change(what) {
    stale = true;
    if (what !== "colours") order = null; // the camera or the boxes
    redraw();
  }
  function boxAt(event) {
    if (!camera.eye) return null;
    const ray = camera.ray(event.offsetX, event.offsetY);
    const colours = bytes(model.get("colours"));
    let [found, nearest] = [null, Infinity];
    for (const box of walls.flat()) {
      if (colours[box.item] === ABSENT) continue;
      let [enter, leave] = [0, Infinity];
      for (let axis = 0; axis < 3; axis++) {
        const a = (box.low[axis] - camera.eye[axis]) / ray[axis];
        const b = (box.high[axis] - camera.eye[axis]) / ray[axis];
        enter = Math.max(enter, Math.min(a, b));
        leave = Math.min(leave, Math.max(a, b));
      }
      if (enter < leave && enter < nearest) [found, nearest] = [box.item, enter];
    }
    return found;
  }

  let pressed = null; // where the pointer went down, and whether it has been dragged since
  canvas.addEventListener("pointerdown", (event) => {
    pressed = { x: event.clientX, y: event.clientY, dragged: false };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!pressed) {
      const item = boxAt(event);
      label.textContent = item === null ? "" : model.get("labels")[item];
      return;
    }
    const [dx, dy] = [event.clientX - pressed.x, event.clientY - pressed.y];
    if (!pressed.dragged && Math.hypot(dx, dy) < 4) return;
    Object.assign(pressed, { x: event.clientX, y: event.clientY, dragged: true });
    camera.angle -= dx * 0.008;
    camera.height = Math.min(1.45, Math.max(0.05, camera.height + dy * 0.006));
    change("camera");
  });
  canvas.addEventListener("pointerup", (event) => {
    const item = pressed && !pressed.dragged ? boxAt(event) : null;
    pressed = null;
    if (item !== null) model.send({ item });
  });
  canvas.addEventListener("pointerleave", () => (label.textContent = ""));
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      camera.distance = Math.min(20, Math.max(4, camera.distance * Math.exp(event.deltaY * 0.001)));
      change("camera");
    },
    { passive: false },
  );

  model.on("change:lift", () => {
    const { item, distance, colour } = model.get("lift");
    if (item !== undefined) lift = { item, distance, colour, start: performance.now() };
    redraw();
  });
  model.on("change:boxes", () => {
    walls = readBoxes(model);
    change("boxes");
  });
  for (const name of ["colours", "outlined", "legend", "palette"]) {
    model.on(`change:${name}`, () => change("colours"));
  }
  const watcher = new ResizeObserver(redraw);
  watcher.observe(canvas);
  return () => watcher.disconnect();
}

export default { render };
