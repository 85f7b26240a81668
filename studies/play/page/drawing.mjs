// A container seen from its entrance, in perspective, drawn from the rear to the front; and how
// clicks and keys choose its boxes. Places are those of `container.seen`, -1 to 1 along each axis.

const EYE = [11.4, 1.25, 5.2]; // m
const [WIDE, TOP] = [2.7, 3.02]; // m of the entrance that the picture shows: its width, its height
const UNSEEN = [186, 186, 182];
const SHADES = { top: 1, side: 0.66, front: 0.84 };
const MARK = "#e8500c"; // seen on all other colours
const AHEAD = 0.01; // a box that is nearer in an arrow's direction lies at the same place

/** RGB of a box by its place in the agent's order, 0 to 1: dark blue to yellow, as in viridis. */
const colourOf = (p) => [68 - 200 * p + 385 * p ** 2, 5 + 225 * p, 84 + 250 * p - 300 * p ** 2];

export class Drawing {
  constructor(canvas, task) {
    Object.assign(this, { canvas, task, pen: canvas.getContext("2d"), faces: [] });
  }

  /**
   * Draw a container.
   *
   * @param {object} container its `boxes`, `present` and `failed`; boxes that failed are crossed.
   * @param {Map<number, number>} places of the boxes that are seen in the agent's order, 0 to 1.
   * @param {number} chosen a box that is outlined.
   */
  draw({ boxes, present, failed }, places, chosen) {
    const { canvas, task } = this;
    canvas.width = canvas.clientWidth * devicePixelRatio;
    canvas.height = canvas.clientHeight * devicePixelRatio;
    this.faces = []; // a later one hides the earlier
    const aside = ({ left, width }) => Math.abs(left + width / 2 - task.cells_wide / 2);
    const order = [...boxes.keys()].filter((item) => present[item]);
    order.sort((i, j) => boxes[i].lower - boxes[j].lower || aside(boxes[j]) - aside(boxes[i]));
    for (let wall = 0; wall < task.walls; wall++) {
      const items = order.filter((item) => boxes[item].wall === wall);
      for (const kinds of [["side", "top"], ["front"]]) {
        for (const item of items) {
          const colour = places.has(item) ? colourOf(places.get(item)) : UNSEEN;
          this.box(item, boxes[item], colour, kinds, failed.has(item), item === chosen);
        }
      }
    }
  }

  /** Draw faces of some kinds of a box, which may be `crossed` or `outlined`. */
  box(item, { wall, left, lower, width, height }, colour, kinds, crossed, outlined) {
    const { cell, cells_wide, container, walls } = this.task;
    const [rear, near] = [wall, wall + 1].map((each) => (each * container[0]) / walls);
    const [y0, y1, z0, z1] = [left, left + width, lower, lower + height].map((each) => each * cell);
    const inner = 2 * left + width < cells_wide ? y1 : y0; // the side that is seen
    const faces = {
      top: [[rear, y0, z1], [rear, y1, z1], [near, y1, z1], [near, y0, z1]],
      side: [[rear, inner, z0], [near, inner, z0], [near, inner, z1], [rear, inner, z1]],
      front: [[near, y0, z0], [near, y1, z0], [near, y1, z1], [near, y0, z1]],
    };
    for (const kind of kinds) {
      const [a, b, c, d] = faces[kind].map((corner) => this.project(corner));
      const path = polygon([a, b, c, d]);
      const shade = (share) => `rgb(${colour.map((value) => share * SHADES[kind] * value)})`;
      const lines = crossed && kind !== "side" ? polygon([a, c, b, d]) : path;
      this.pen.fillStyle = shade(1);
      this.pen.fill(path);
      this.pen.lineWidth = (crossed || outlined ? 3 : 0.7) * devicePixelRatio;
      this.pen.strokeStyle = crossed || outlined ? MARK : shade(0.6);
      this.pen.stroke(lines);
      this.faces.push({ item, path });
    }
  }

  /** Pixels of a point in m: lines in depth meet at the height of the eye. */
  project([x, y, z]) {
    const { width } = this.canvas;
    const zoom = (EYE[0] - this.task.container[0]) / (EYE[0] - x);
    const [aside, up] = [zoom * (y - EYE[1]), EYE[2] + zoom * (z - EYE[2])];
    return [width / 2 + (aside * width) / WIDE, ((TOP - up) * width) / WIDE];
  }

  /** The box at a place of the canvas in CSS pixels, or undefined. */
  boxAt(x, y) {
    const at = [x, y].map((value) => value * devicePixelRatio);
    return this.faces.findLast(({ path }) => this.pen.isPointInPath(path, ...at))?.item;
  }
}

const polygon = (corners) => new Path2D(`M${corners.join("L")}Z`);

/** Directions of keys, across and upwards. */
export const ARROWS = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};

/** The visible box with the least `far` of its way from a place; -1 if none is finite. */
function least({ seen, visible }, from, far) {
  const distance = (item) => far(seen[item].map((value, axis) => value - from[axis]));
  const order = visible.toSorted((a, b) => distance(a) - distance(b));
  return order.length && distance(order[0]) < Infinity ? order[0] : -1;
}

/** The next visible box in a direction, across or upwards, rather in front; else `chosen`. */
export function towards(container, chosen, [right, up]) {
  const from = container.seen[chosen] ?? container.seen[container.visible[0]];
  const next = least(container, from, ([x, y, z]) => {
    const ahead = y * right + z * up;
    return ahead > AHEAD ? ahead + 3 * Math.abs(y * up - z * right) - x : Infinity;
  });
  return next < 0 ? chosen : next;
}

/** The visible box nearest to where one is or was; -1 in an empty container. */
export const nearest = (container, item) =>
  least(container, container.seen[item], (way) => Math.hypot(...way));
