"""Algorithm 1 to the letter: the index that sorting returns, in place of the rank.

The paper's pseudocode sorts, and takes ``sorted_pos_index``. As NumPy and PyTorch name it, that is
``argsort``: at place r stands which item comes r-th. The rank, which its text describes, is
``argsort`` of ``argsort``: at place i stands the how manyth item i is.
"""

from functools import partial

import numpy as np

from unload import task
from unload.agent.training import Training

# In which order an observation's rows stand before they are sorted: as the paper has them, nearest
# first; the highest box first; as the boxes were stacked, wall by wall; or shuffled at each pick.
ROWS = ("distance", "height", "wall", "random")


def sorted_index(coordinates: np.ndarray) -> np.ndarray:
    """Replace each coordinate by the index that sorting puts at its row, spread over [-1, 1].

    Args:
        coordinates: (..., items, axes) float, positions or their ranks, which give the same.

    Returns:
        Same shape, float32: in row r the number i of the row whose coordinate is the r-th, as
        (2 i - (N-1)) / (N-1).
    """
    last = coordinates.shape[-2] - 1
    order = np.argsort(coordinates, axis=-2, kind="stable")
    return ((2 * order - last) / last).astype(np.float32)


def index_by_rows(coordinates: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """``sorted_index`` as it would be if an observation's rows stood in another order.

    Args:
        coordinates: (batch, items, axes) float.
        rows: (batch, items) int64, which row would stand first, second, …

    Returns:
        Same shape as ``coordinates``, each row where it stood.
    """
    index = np.empty(coordinates.shape, np.float32)
    moved = np.take_along_axis(coordinates, rows[..., np.newaxis], axis=1)
    np.put_along_axis(index, rows[..., np.newaxis], sorted_index(moved), axis=1)
    return index


def see_index(run: Training, rows: str = "distance") -> None:
    """Let a run see the index in place of the rank, in choosing and in learning alike.

    Args:
        run: with ``equalize``, whose containers hold 128 items or more at every pick.
        rows: one of ``ROWS``.
    """
    choose, add = run.agent.choose, run.replay.add
    seen = np.empty(0)

    def choose_by_index(observations: np.ndarray, *rest) -> np.ndarray:
        nonlocal seen  # only until the pick has been made
        if rows == "distance":
            seen = sorted_index(observations)
        else:
            seen = index_by_rows(observations, _order_of_rows(run, observations, rows))
        return choose(seen, *rest)

    run.agent.choose = choose_by_index
    run.replay.add = lambda observations, **rest: add(observations=seen, **rest)


def _order_of_rows(run: Training, observations: np.ndarray, rows: str) -> np.ndarray:
    if rows == "height":
        return np.argsort(-observations[..., 2], axis=1, kind="stable")
    if rows == "wall":  # a load's boxes are numbered wall by wall
        return np.argsort(run.rollout.envs.unwrapped.visible, axis=1, kind="stable")
    rng = np.random.default_rng((run.config.seed, run.rollout.steps))
    return rng.random((len(observations), task.N_VISIBLE)).argsort(axis=1)


BY_ROWS = {rows: partial(see_index, rows=rows) for rows in ROWS}
