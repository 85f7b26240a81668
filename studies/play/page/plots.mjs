// The pictures beside the container. The learning curve stands in a square of 100 by 100. The phase
// diagram shows preferences, seen from above with the entrance below: so y is drawn to the right
// and x downwards. The maps show what a network looks at: its features over a place and the height.

import { preferences } from "./policy.mjs";

const MOST = 1.5; // what is larger stands there, at the edge of the phase diagram
const COLOURS = [[0, 122, 194], [221, 96, 16]]; // of the maps: for the box, and against it

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

/**
 * What each feature adds to the score of a box, over x (`axis` 0) or y (1) and z.
 *
 * @returns {Float64Array[]} of each feature `side` rows, the highest z first, of `side` places;
 *   x or y that is not drawn is 0, and so are both with `blank`.
 */
export function featureMaps({ nFeatures, extractor, scorer }, axis, blank, side) {
  const at = (number) => (2 * number + 1) / side - 1;
  return Array.from({ length: nFeatures }, (_, f) => {
    const [wz, bias] = extractor.subarray(4 * f + 2, 4 * f + 4);
    const along = blank ? 0 : extractor[4 * f + axis];
    return Float64Array.from({ length: side * side }, (_, i) => {
      const [place, height] = [at(i % side), -at(Math.floor(i / side))];
      return scorer[f] * Math.max(0, along * place + wz * height + bias);
    });
  });
}

/** The sum of maps, less its mean, because only differences decide. */
export function sumMap(maps) {
  const sum = maps[0].map((_, i) => maps.reduce((total, map) => total + map[i], 0));
  const mean = sum.reduce((a, b) => a + b) / sum.length;
  return sum.map((value) => value - mean);
}

/** Pixels of a map, RGBA: blue for a box and orange against it, the fainter the nearer to 0. */
export function pixels(map, largest) {
  const strength = (value) => (255 * Math.abs(value)) / largest;
  const pixel = (value) => [...COLOURS[value < 0 ? 1 : 0], strength(value)];
  return Uint8ClampedArray.from([...map].flatMap(pixel));
}

/** Draw what is shared: a picture of a container, what was found, and both rates as bars. */
export function poster(picture, container, [title, ...lines], rates) {
  Object.assign(picture, { width: 1200, height: 630 });
  const pen = picture.getContext("2d");
  const write = (text, size, x, y, colour = "#1c2126") => {
    pen.font = `600 ${size}px system-ui, sans-serif`;
    pen.fillStyle = colour;
    pen.fillText(text, x, y);
  };
  pen.fillStyle = "#f6f6f3";
  pen.fillRect(0, 0, 1200, 630);
  pen.drawImage(container, 30, 25, 512, 580);
  write(title, 64, 580, 110);
  lines.forEach((line, i) => write(line, 30, 580, 165 + 44 * i));
  rates.forEach(([name, { success_rate: rate }], i) => {
    const [x, y, colour] = [580, 330 + 140 * i, `rgb(${COLOURS[1 - i]})`];
    write(`${name}: ${Math.round(100 * rate)} %`, 32, x, y, colour);
    pen.globalAlpha = 0.2;
    pen.fillRect(x, y + 16, 580, 44);
    pen.globalAlpha = 1;
    pen.fillRect(x, y + 16, 580 * rate, 44);
  });
}

/** Fill a canvas with a map, a pixel for each value. */
export function paint(canvas, map, largest) {
  const side = (canvas.width = canvas.height = Math.sqrt(map.length));
  canvas.getContext("2d").putImageData(new ImageData(pixels(map, largest), side, side), 0, 0);
}
