"""The fused twin of ``unload.agent.learner.PlainLearner``."""

from collections.abc import Callable
from typing import Any

import numpy as np

from unload.fast import fused
from unload.network.peq import PEQNetwork
from unload.support.compiled import compiled

# Of Adam, PyTorch's defaults; a step is divided by the root mean square of gradients plus epsilon.
_DECAYS, _EPSILON = (0.9, 0.999), 1e-8


class FusedLearner:
    """``PlainLearner`` for a network to which ``fused.applies``, with the same interface.

    Its update reads the rows where they are, which saves copying them, and goes on in other
    threads while the caller does something else. tanh is computed in double precision, where its
    slope vanishes later; actions are compared by the value before tanh, which makes large ones
    equal.
    ``torch.optim.Adam`` spends most of its time on everything but the few hundred weights of the
    paper's network; its rule is one compiled pass here.
    """

    def __init__(self, network: PEQNetwork, learning_rate: float, beta: float) -> None:
        self.weights, self.beta = fused.weights_of(network), beta
        self.learning_rate, self.steps = learning_rate, 0
        # Running means of the gradients and of their squares.
        self.moments = np.zeros((2, sum(array.size for array in self.weights)))

    def best_actions(self, observations: np.ndarray, allowed: np.ndarray) -> np.ndarray:
        return fused.best_actions(self.weights, observations, allowed)

    def start(
        self, batch: dict[str, np.ndarray], targets: np.ndarray, rows: np.ndarray | None = None
    ) -> Callable[[], float]:
        """See ``PlainLearner``; weights and arrays must stay as they are until the call."""
        arrays = batch["observations"], batch["actions"], targets
        finish_gradients = fused.start_gradients(self.weights, *arrays, self.beta, rows)

        def finish() -> float:
            gradients_and_loss = finish_gradients()
            self.step(gradients_and_loss[:-1])
            return float(gradients_and_loss[-1])

        return finish

    def state_dict(self) -> dict[str, Any]:
        own = {"steps": self.steps, "learning_rate": self.learning_rate}
        return own | {"moments": self.moments}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self.steps, self.learning_rate = state["steps"], state["learning_rate"]
        self.moments[:] = state["moments"]

    def step(self, gradients: np.ndarray) -> None:
        """Change all weights once by their float64 gradients, one array after the other."""
        self.steps += 1
        bias_corrections = [1 - decay**self.steps for decay in _DECAYS]
        flat = tuple(array.reshape(-1) for array in self.weights)  # the same memory
        _step(flat, gradients, self.moments, self.learning_rate, *bias_corrections)


@compiled
def _step(weights, gradients, moments, learning_rate, bias_correction1, bias_correction2):
    """Adam's rule; changes the weights where they are."""
    mean, square = moments
    i = 0
    for part in weights:
        for place in range(len(part)):
            gradient = gradients[i]
            mean[i] += (1 - _DECAYS[0]) * (gradient - mean[i])
            square[i] += (1 - _DECAYS[1]) * (gradient * gradient - square[i])
            size = np.sqrt(square[i] / bias_correction2) + _EPSILON
            part[place] -= learning_rate * (mean[i] / bias_correction1) / size
            i += 1
