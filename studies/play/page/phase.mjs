// The phase diagram: preferences, seen from above with the entrance below. So y is drawn to the
// right and x downwards; what is larger than MOST stands there, at the edge.

import { preferences } from "./measures.mjs";

const MOST = 1.5;
const clip = (value) => Math.max(-MOST, Math.min(MOST, value));

/** Where a network stands whose scores have these slopes along x, y and z. */
export const place = (slopes) => preferences(slopes).toReversed().map(clip);

/** Path of the region in which networks err: all but a rectangle; empty where none is known. */
export function region([x, y]) {
  if (x === Infinity && y === Infinity) return "";
  const rectangle = (right, down) => `M${-right} ${-down}H${right}V${down}H${-right}Z`;
  const most = (limit) => Math.min(limit, 2 * MOST); // beyond the edge
  return rectangle(2 * MOST, 2 * MOST) + rectangle(most(y), most(x));
}
