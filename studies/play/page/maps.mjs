// What a network looks at: its features over a place and the height, each times its weight.

const COLOURS = [[0, 122, 194], [221, 96, 16]]; // for the box, and against it

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
  const strength = (value) => (255 * Math.abs(value)) / (largest || 1);
  const pixel = (value) => [...COLOURS[value < 0 ? 1 : 0], strength(value)];
  return Uint8ClampedArray.from([...map].flatMap(pixel));
}

/** Fill a canvas with a map, a pixel for each value. */
export function paint(canvas, map, largest) {
  const side = (canvas.width = canvas.height = Math.sqrt(map.length));
  canvas.getContext("2d").putImageData(new ImageData(pixels(map, largest), side, side), 0, 0);
}
