"""The visible items' positions, before and after equalization (Figs. 4–6).

python -m studies observation
"""

from collections.abc import Mapping

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.results import COMMAND, measured, publish
from studies.style import styled
from unload.env import observation
from unload.env.equalization import equalize

FOLDER = "obs_hist_equal"  # of the paper's own plots
SEED = 0  # of the load
# Fig. 5: the paper's histogram. The edges lie just outside [-1, 1].
BINS = np.linspace(-1.001, 1.001, 111)


def observation_data() -> None:
    """Write ``obs_hist_equal/{all_items,Observation,Equalized_Observation}.csv``.

    Columns ``x`` and ``y``: scaled x and z of all items, of the 128 observed ones, and of the
    observed ones after equalization.
    """
    result = measured(_positions)
    tables = {
        name: pd.DataFrame(positions[:, [0, 2]], columns=["x", "y"])
        for name, positions in result.value.items()
    }
    name, command, settings = f"{FOLDER}/observation", f"{COMMAND} observation", {"seed": SEED}
    publish(name, tables, command, settings, [result], float_format="%.6f")


def _positions() -> dict[str, np.ndarray]:
    """Scaled positions, (items, 3), by the name of the file."""
    env = gymnasium.make("unload/Container-v0").unwrapped
    observed, _ = env.reset(seed=SEED)
    everything = observation.scale(env.observed_positions())
    return {
        "all_items": everything,
        "Observation": observed,
        "Equalized_Observation": equalize(observed),
    }


@styled
def scaled_side_view(groups: Mapping[str, tuple[pd.DataFrame, tuple]], symbol: str) -> Figure:
    """Items from the side, in scaled coordinates (Figs. 4 and 6).

    Args:
        groups: name → points and their colour; the later ones are drawn above.
        symbol: of a position, in LaTeX.
    """
    figure, axes = plt.subplots(figsize=(4.6, 4.8))
    for name, (points, colour) in groups.items():
        look = {"ms": 4.5, "mew": 0.3, "mec": "0.55", "color": colour}
        axes.plot(points["x"], points["y"], "o", label=name, **look)
    ticks = np.arange(-1, 1.1, 0.5)
    axes.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1), xticks=ticks, yticks=ticks, aspect="equal")
    axes.set_xlabel(rf"${symbol}_{{0,i,\mathrm{{x}}}}$")
    axes.set_ylabel(rf"${symbol}_{{0,i,\mathrm{{z}}}}$")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=3, borderaxespad=0.4)
    return figure
