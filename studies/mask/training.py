"""Runs of the paper's length that learn from parts of an episode, trained and judged.

python -m studies mask
"""

from collections.abc import Sequence

from studies.grid import ask_policies, train_grid
from studies.mask.cells import MASK
from studies.mask.laboratory import by_stage
from studies.ties.choice import LOADS
from unload.agent.greedy import Greedy


def mask_data(cells: Sequence[str] | None = None, n_jobs: int = -1) -> None:
    """Train the grid, see ``train_grid``, and judge all published networks.

    ``mask/judged.csv`` has a row per network, see ``by_stage``.
    """
    train_grid(MASK, cells, n_jobs)
    ask_policies(MASK, "mask/judged", ask_by_stage, LOADS, n_jobs)


def ask_by_stage(policy: Greedy, episodes: int, seed: int) -> list[dict]:
    """One row of what ``by_stage`` says of a policy's network."""
    return [by_stage(policy.network, episodes, seed)]
