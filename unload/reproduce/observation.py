"""Item positions of a fresh container, for Figs. 4–6.

Made by ``python -m unload.reproduce observation``.
"""

from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd

from unload.env import observation
from unload.env.equalization import equalize
from unload.reproduce.results import COMMAND, measured, publish
from unload.support import checks, files

FOLDER = "obs_hist_equal"  # of the paper's own plots


def observation_data(seed: int = 0, folder: str | Path = files.DATA) -> None:
    """Write ``obs_hist_equal/{all_items,Observation,Equalized_Observation}.csv``.

    Columns ``x`` and ``y``: scaled x and z of all items, of the 128 observed ones, and of the
    observed ones after equalization.

    Args:
        seed: of the load.
        folder: of the data.

    Raises:
        TypeError, ValueError: the seed is not a whole number >= 0.
    """
    checks.integer("seed", seed, 0)
    points, record = measured(lambda: _positions(seed))
    tables = {
        name: pd.DataFrame(positions[:, [0, 2]], columns=["x", "y"])
        for name, positions in points.items()
    }
    publish(
        Path(folder) / FOLDER,
        "observation",
        tables,
        f"{COMMAND} observation",
        {"seed": seed},
        False,
        [record],
        float_format="%.6f",
    )


def _positions(seed: int) -> dict[str, np.ndarray]:
    """Scaled positions, (items, 3), by the name of the file."""
    env = gymnasium.make("unload/Container-v0").unwrapped
    observed, _ = env.reset(seed=seed)
    everything = observation.scale(env.observed_positions())
    env.close()
    return {
        "all_items": everything,
        "Observation": observed,
        "Equalized_Observation": equalize(observed),
    }
