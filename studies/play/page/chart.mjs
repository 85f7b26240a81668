// A learning curve in a square of 100 by 100, and what it says at a place.

/**
 * Corners of the line of one of the points' values, from 0 to 1, over picks from 0 to `end`. The
 * first stands twice, so that a round end of the line shows it even if it is the only one.
 */
export function line(points, name, end) {
  const corners = points.map((point) => [(100 * point.picks) / end, 100 - 100 * point[name]]);
  return [...corners.slice(0, 1), ...corners].join(" ");
}

/** The point nearest to a share, 0 to 1, of the way to `end`; undefined if there is none. */
export function pointAt(points, share, end) {
  const away = ({ picks }) => Math.abs(picks - share * end);
  return points.toSorted((a, b) => away(a) - away(b))[0];
}
