"""The data behind the paper's figures, computed and kept in ``data/`` with its provenance.

    python -m unload.reproduce observation

File names and columns are those that the paper's own plots read.
"""

import time
from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd

from unload import checks, files, observation
from unload.equalization import equalize
from unload.provenance import write_provenance

COMMAND = "python -m unload.reproduce"


def observation_data(seed: int = 0, folder: str | Path = files.DATA) -> None:
    """Item positions of a fresh container, for Figs. 4–6.

    Writes ``obs_hist_equal/{all_items,Observation,Equalized_Observation}.csv`` with columns
    ``x`` and ``y``: scaled x and z of all items, of the 128 observed ones, and of the
    observed ones after equalization.
    """
    start = time.monotonic()
    folder = Path(folder) / "obs_hist_equal"
    env = gymnasium.make("unload/Container-v0").unwrapped
    observed, _ = env.reset(seed=checks.integer("seed", seed, 0))
    everything = observation.scale(env.observed_positions())
    env.close()
    tables = {
        "all_items": everything,
        "Observation": observed,
        "Equalized_Observation": equalize(observed),
    }
    for name, points in tables.items():
        frame = pd.DataFrame(points[:, [0, 2]], columns=["x", "y"])
        files.write_text(folder / f"{name}.csv", frame.to_csv(index=False, float_format="%.6f"))
    write_provenance(
        folder,
        "observation",
        f"{COMMAND} observation",
        {"seed": seed},
        time.monotonic() - start,
        reduced=False,
    )
