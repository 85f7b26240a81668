// Choosing boxes by keys. Places are those of `container.seen`, from -1 to 1 along each axis.

/** Directions of keys, across and upwards. */
export const ARROWS = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};
const AHEAD = 0.01; // a box that is nearer in an arrow's direction lies at the same place

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
