// A learning curve in a square of 100 by 100, and what it says at a place.

/** Corners of the line of one of the points' values, from 0 to 1, over picks from 0 to `end`. */
export const line = (points, name, end) =>
  points.map((point) => [(100 * point.picks) / end, 100 - 100 * point[name]]).join(" ");

/** The point nearest to a share, 0 to 1, of the way to `end`; undefined if there is none. */
export function pointAt(points, share, end) {
  const away = ({ picks }) => Math.abs(picks - share * end);
  return points.toSorted((a, b) => away(a) - away(b))[0];
}
