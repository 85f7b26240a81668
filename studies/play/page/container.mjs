// One container: its load, what can be lifted, and what is seen of it, as in unload/load/substacks.py
// and in observation.py and equalization.py of unload/env. Boxes stand on a grid of 36 × 30 cells.
// `task` holds the numbers that page.py exports. Lengths are in m where no cells are named.

/** Random numbers from a seed: mulberry32. */
export class Generator {
  constructor(seed) {
    this.state = Math.imul(seed + 1, 0x9e3779b1); // neighbouring seeds start far apart
  }
  uniform() {
    this.state = (this.state + 0x6d2b79f5) | 0;
    let bits = Math.imul(this.state ^ (this.state >>> 15), this.state | 1);
    bits ^= bits + Math.imul(bits ^ (bits >>> 7), bits | 61);
    return ((bits ^ (bits >>> 14)) >>> 0) / 2 ** 32;
  }
  integer(count) {
    return Math.floor(this.uniform() * count);
  }
  normal() {
    const radius = Math.sqrt(-2 * Math.log(1 - this.uniform()));
    return radius * Math.cos(2 * Math.PI * this.uniform());
  }
}

/** Boxes of these variants of substacks, rear wall and bottom row first; edges in cells. */
export function buildLoad(variants, { columns, packages, rows, rows_high }) {
  return variants.flatMap((variant, number) => {
    const row = Math.floor(number / columns.length);
    const column = columns[number % columns.length];
    return column.variants[variant].map(([kind, y, z]) => {
      const [width, height] = packages[kind];
      const [left, lower] = [column.left + y, (row % rows) * rows_high + z];
      return { wall: Math.floor(row / rows), left, lower, width, height };
    });
  });
}

/** A random load of 800 to 1000 boxes. */
export function stackLoad(generator, task) {
  const length = task.walls * task.rows * task.columns.length;
  const boxes = buildLoad(Array.from({ length }, () => generator.integer(3)), task);
  const enough = boxes.length >= task.min_items && boxes.length <= task.max_items;
  return enough ? boxes : stackLoad(generator, task);
}

export class Container {
  /** A full one; `generator` blurs the places by `task.position_noise`, and jams boxes. */
  constructor(boxes, task, generator) {
    Object.assign(this, { boxes, task, generator, picks: 0 });
    this.present = new Uint8Array(boxes.length).fill(1);
    this.failed = new Set(); // items that failed since the last success
    const items = [...boxes.keys()];
    const walls = Array.from({ length: task.walls }, () => []);
    for (const item of items) walls[boxes[item].wall].push(item);
    // The boxes that rest on each.
    this.above = boxes.map((box) => walls[box.wall].filter((other) => rests(boxes[other], box)));
    const places = boxes.map(({ wall, left, lower, width, height }) => {
      const x = ((wall + 0.5) * task.container[0]) / task.walls;
      const [y, z] = [(left + width / 2) * task.cell, (lower + height / 2) * task.cell];
      return task.position_noise ? [x, y, z - task.sink] : [x, y, z];
    });
    const noise = () => task.position_noise * generator.normal();
    const blurred = places.map((place) => place.map((value) => value + noise()));
    const square = (value, axis) => task.distance_weights[axis] * (task.viewpoint[axis] - value) ** 2;
    const distances = blurred.map((place) => place.map(square).reduce((a, b) => a + b));
    // From -1 to 1 between the container's sides, in single precision as in Python.
    const scaled = (value, axis) => Math.fround((2 / task.container[axis]) * value - 1);
    this.seen = blurred.map((place) => place.map(scaled));
    this.exact = places.map((place) => place.map(scaled));
    // Sorted once, because no box moves: an observation picks out what is left.
    this.byDistance = items.toSorted((a, b) => distances[a] - distances[b]);
    const along = (axis) => this.byDistance.toSorted((a, b) => this.seen[a][axis] - this.seen[b][axis]);
    this.byAxis = [0, 1, 2].map(along);
  }

  /**
   * Choose what is observed: positions, ranks, whose `ties` are of a kind, or the index; and
   * whether walls are `seamless`, so that a free box jams with probability `jam`.
   */
  show({ sees, ties, seamless, jam }) {
    Object.assign(this, { sees, ties, jam: seamless ? jam : 0 });
    this.look();
  }

  /** Update which boxes are visible, nearest first, and the observation of them. */
  look() {
    const { byDistance, present, sees, task, ties } = this;
    this.visible = [];
    for (let i = 0; i < byDistance.length && this.visible.length < task.n_visible; i++) {
      if (present[byDistance[i]]) this.visible.push(byDistance[i]);
    }
    this.observation = new Float32Array(3 * this.visible.length); // the old one may be kept
    const rows = new Int16Array(present.length).fill(-1);
    this.visible.forEach((item, row) => (rows[item] = row));
    this.byAxis.forEach((order, axis) => {
      const visible = order.filter((item) => rows[item] >= 0);
      const anew = sees !== "positions" && ties === "anew";
      const sorted = anew ? this.sortAnew(visible, axis) : visible;
      const write = (row, value) => (this.observation[3 * row + axis] = value);
      if (sees === "index") {
        // As `argsort` returns it: in row r stands which row comes r-th.
        const last = sorted.length - 1 || 1;
        sorted.forEach((item, r) => write(r, (2 * rows[item] - last) / last));
      } else {
        const positions = sorted.map((item) => this.seen[item][axis]);
        const values = sees === "ranks" ? this.ranks(positions) : positions;
        sorted.forEach((item, r) => write(rows[item], values[r]));
      }
    });
  }

  /** Items sorted along an axis with noise that is drawn for this once. */
  sortAnew(items, axis) {
    const width = (2 * this.task.position_noise) / this.task.container[axis];
    const blurred = new Map(
      items.map((item) => [item, this.exact[item][axis] + width * this.generator.normal()]),
    );
    return items.toSorted((a, b) => blurred.get(a) - blurred.get(b));
  }

  /** Ranks of sorted values, even from -1 to 1; those in a tie may share their mean. */
  ranks(values) {
    const [last, levels] = [values.length - 1, []];
    for (let r = 0; r <= last; r++) {
      const tied = values[r + 1] - values[r] <= this.task.tie_tolerance;
      if (tied && this.ties === "average") continue;
      const level = (levels.length + r - last) / (last || 1); // of all since the last tie
      while (levels.length <= r) levels.push(level);
    }
    return levels;
  }

  /** Lift a box; return whether that unloads it. Whether it jams is drawn at each attempt. */
  pick(item) {
    const jams = () => this.jam > 0 && this.generator.uniform() < this.jam;
    const success = this.liftable(item) && !jams();
    this.picks++;
    this.failed.add(item);
    if (success) {
      this.present[item] = 0;
      this.failed.clear();
    }
    if (success || this.ties === "anew") this.look();
    return success;
  }

  /** Whether nothing rests on a box. In 0.4 % of random picks, what rests on it would tip aside. */
  liftable(item) {
    return this.above[item].every((other) => !this.present[other]);
  }
}

/** Whether box `a` rests on box `b`: it begins where `b` ends, and they share a stretch of width. */
function rests(a, b) {
  return a.lower === b.lower + b.height && a.left < b.left + b.width && b.left < a.left + a.width;
}
