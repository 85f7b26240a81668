"""The fused twin of ``unload.agent.learner.PlainLearner``."""

from collections.abc import Callable

import numpy as np

from unload.agent.fast import fused
from unload.agent.fast.adam import Adam
from unload.network.peq import PEQNetwork


class FusedLearner:
    """``PlainLearner`` for a network to which ``fused.applies``, with the same interface.

    Its update reads the rows where they are, which saves copying them, and goes on in other
    threads while the caller does something else. It takes tanh in double precision, where its
    slope does not become 0 so soon, and the choice compares what stands before it, which never
    ties.

    Args:
        network, learning_rate, beta: see ``PlainLearner``.
    """

    def __init__(self, network: PEQNetwork, learning_rate: float, beta: float) -> None:
        self.weights, self.beta = fused.weights_of(network), beta
        self.optimizer = Adam([array.reshape(-1) for array in self.weights], learning_rate)

    def best_actions(self, observations: np.ndarray, allowed: np.ndarray) -> np.ndarray:
        return fused.best_actions(self.weights, observations, allowed)

    def start(
        self, batch: dict[str, np.ndarray], targets: np.ndarray, rows: np.ndarray | None = None
    ) -> Callable[[], float]:
        """See ``PlainLearner``; weights and arrays must stay as they are until the call."""
        gradients = fused.start_gradients(
            self.weights,
            batch["observations"],
            batch["actions"],
            targets,
            self.beta,
            rows,
        )

        def finish() -> float:
            total = gradients()
            self.optimizer.step(total[:-1])
            return float(total[-1])

        return finish

    def state(self) -> dict[str, np.ndarray]:
        return self.optimizer.state()

    def load_state(self, arrays: dict[str, np.ndarray]) -> None:
        self.optimizer.load_state(arrays)
