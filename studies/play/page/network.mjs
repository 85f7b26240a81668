// The permutation-equivariant ("PEQ") network of unload/network/peq.py, its gradient, and Adam.
// An observation is a Float32Array: x, y and z of the first item, then of the next.

const BETAS = [0.9, 0.999]; // PyTorch's defaults
const EPSILON = 1e-8;

export class PEQNetwork {
  /** First weights as of `nn.Linear`, U(±1/√inputs), drawn by a `Generator`. */
  constructor(nFeatures, generator) {
    const n = (this.nFeatures = nFeatures);
    const draw = (_, i) => (2 * generator.uniform() - 1) / Math.sqrt(i < 4 * n ? 3 : 4 * n);
    this.parameters = Float64Array.from({ length: 8 * n + 1 }, draw);
    this.gradient = new Float64Array(8 * n + 1);
    this.extractor = this.parameters.subarray(0, 4 * n); // (n, 4): of x, y and z, and the bias
    this.scorer = this.parameters.subarray(4 * n); // (4, n), see `read`; then the bias
    this.inputs = new Float64Array(16 * n);
    this.features = new Float64Array(4 * n);
  }

  /** The extractor's weights of one feature. */
  weights(f) {
    const { extractor: e } = this;
    return { wx: e[4 * f], wy: e[4 * f + 1], wz: e[4 * f + 2], bias: e[4 * f + 3] };
  }

  /** What decides among the items: tanh's argument without the pooled part, (items). */
  scores(observation) {
    const scores = new Float64Array(observation.length / 3);
    for (let f = 0; f < this.nFeatures; f++) {
      const { wx, wy, wz, bias } = this.weights(f);
      const score = this.scorer[f];
      for (let i = 0, j = 0; i < scores.length; i++, j += 3) {
        const x = observation[j], y = observation[j + 1], z = observation[j + 2];
        const feature = wx * x + wy * y + wz * z + bias;
        if (feature > 0) scores[i] += score * feature;
      }
    }
    return scores;
  }

  /**
   * Read the features of one item, and the minimum, maximum and mean of each over all items.
   *
   * Kept for the gradient are these `features`, (4, n), and their `inputs`, (4, n, 4), namely
   * x, y, z and 1, because before its ReLU a feature is weights · inputs. Items that tie for the
   * minimum do not share the gradient, as they do in PyTorch: they tie only where it is 0.
   *
   * @returns {number} The argument of the item's tanh.
   */
  read(observation, item) {
    const { nFeatures: n, extractor, scorer, inputs, features } = this;
    const items = observation.length / 3;
    for (let f = 0; f < n; f++) {
      const { wx, wy, wz, bias } = this.weights(f);
      let lowest = 0, highest = 0, low = Infinity, high = -Infinity;
      let sumX = 0, sumY = 0, sumZ = 0, open = 0; // over items whose ReLU is open
      for (let j = 0; j < observation.length; j += 3) {
        const x = observation[j], y = observation[j + 1], z = observation[j + 2];
        const feature = wx * x + wy * y + wz * z + bias;
        if (feature < low) low = feature, lowest = j;
        if (feature > high) high = feature, highest = j;
        if (feature > 0) sumX += x, sumY += y, sumZ += z, open++;
      }
      const sources = [3 * item, lowest, highest];
      for (let source = 0; source < 3; source++) {
        const j = sources[source], k = 4 * (source * n + f);
        for (let i = 0; i < 3; i++) inputs[k + i] = observation[j + i];
        inputs[k + 3] = 1;
      }
      const k = 4 * (3 * n + f);
      inputs[k] = sumX / items, inputs[k + 1] = sumY / items;
      inputs[k + 2] = sumZ / items, inputs[k + 3] = open / items;
    }
    let total = scorer[4 * n];
    for (let k = 0; k < 4 * n; k++) {
      let feature = 0;
      for (let i = 0; i < 4; i++) feature += extractor[4 * (k % n) + i] * inputs[4 * k + i];
      features[k] = Math.max(0, feature);
      total += scorer[k] * features[k];
    }
    return total;
  }

  /**
   * Mean smooth-L1 loss of the chosen items' values; its gradient is left in `gradient`.
   *
   * @param {{observation: Float32Array, action: number, reward: number}[]} batch picks.
   */
  loss(batch) {
    const { nFeatures: n, scorer, gradient, inputs, features } = this;
    gradient.fill(0);
    let loss = 0;
    for (const { observation, action, reward } of batch) {
      const value = Math.tanh(this.read(observation, action));
      const error = value - reward;
      loss += (Math.abs(error) < 1 ? error ** 2 / 2 : Math.abs(error) - 0.5) / batch.length;
      const slope = (Math.max(-1, Math.min(1, error)) * (1 - value ** 2)) / batch.length;
      for (let k = 0; k < 4 * n; k++) {
        gradient[4 * n + k] += slope * features[k];
        if (features[k] === 0) continue; // the ReLU is closed
        for (let i = 0; i < 4; i++) gradient[4 * (k % n) + i] += slope * scorer[k] * inputs[4 * k + i];
      }
      gradient[8 * n] += slope;
    }
    return loss;
  }
}

/** The optimizer of a network, whose `parameters` it changes by their `gradient`. */
export class Adam {
  constructor(network) {
    Object.assign(this, { network, steps: 0 });
    // Running means of the gradients and of their squares.
    [this.mean, this.square] = [0, 1].map(() => new Float64Array(network.parameters.length));
  }

  step(learningRate) {
    const { parameters, gradient } = this.network;
    this.steps++;
    const [correction, correction2] = BETAS.map((beta) => 1 - beta ** this.steps);
    for (let i = 0; i < parameters.length; i++) {
      this.mean[i] += (1 - BETAS[0]) * (gradient[i] - this.mean[i]);
      this.square[i] += (1 - BETAS[1]) * (gradient[i] ** 2 - this.square[i]);
      const size = Math.sqrt(this.square[i] / correction2) + EPSILON;
      parameters[i] -= (learningRate * this.mean[i]) / correction / size;
    }
  }
}
