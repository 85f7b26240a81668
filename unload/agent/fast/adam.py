"""Adam for the fused update.

``torch.optim.Adam`` spends most of its time on everything but the few hundred weights of the
paper's network. This is its rule in one compiled pass; readers learn from the other one.
"""

from collections.abc import Sequence

import numpy as np

from unload.support.compiled import compiled

BETAS = 0.9, 0.999  # PyTorch's defaults


class Adam:
    """The optimizer of some weights, which it changes where they are.

    Args:
        weights: (k,) float32 each.
        learning_rate: the step size.
        epsilon: is added to the root mean square of the gradients, by which a step is divided.
    """

    def __init__(
        self, weights: Sequence[np.ndarray], learning_rate: float, epsilon: float = 1e-8
    ) -> None:
        self.weights = tuple(weights)
        self.learning_rate, self.epsilon = learning_rate, epsilon
        self.steps = 0
        count = sum(map(len, self.weights))
        # Running means of the gradients and of their squares.
        self.moments = np.zeros((2, count))

    def step(self, gradients: np.ndarray) -> None:
        """Change all weights once.

        Args:
            gradients: float64, of all weights, one array after the other.

        Raises:
            ValueError: there are more or fewer than weights.
        """
        if gradients.shape != self.moments.shape[1:]:  # compiled code would read what lies behind
            raise ValueError(
                f"gradients has shape {gradients.shape}; expected {self.moments.shape[1:]}"
            )
        self.steps += 1
        corrections = [1 - beta**self.steps for beta in BETAS]
        settings = self.learning_rate, self.epsilon, *corrections
        _step(self.weights, gradients, self.moments, *settings)

    def state(self) -> dict[str, np.ndarray]:
        """What ``load_state`` needs to go on from here."""
        return {"steps": np.array(self.steps), "moments": self.moments.copy()}

    def load_state(self, arrays: dict[str, np.ndarray]) -> None:
        """Go on from what ``state`` returned."""
        self.steps = int(arrays["steps"])
        self.moments[:] = arrays["moments"]


@compiled
def _step(weights, gradients, moments, learning_rate, epsilon, correction, correction2):
    mean, square = moments
    i = 0
    for part in weights:
        for place in range(len(part)):
            gradient = gradients[i]
            mean[i] += (1 - BETAS[0]) * (gradient - mean[i])
            square[i] += (1 - BETAS[1]) * (gradient * gradient - square[i])
            size = np.sqrt(square[i] / correction2) + epsilon
            part[place] -= learning_rate * (mean[i] / correction) / size
            i += 1
