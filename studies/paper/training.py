"""The paper's training in the container (Sec. IV-B), for Figs. 11 and 12, and its policies.

    python -m studies training

The first plan, ``data/falls/FIRST_PLAN.md``, says why its grid has these cells and seeds.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from studies import paths
from studies.grid import Grid, cell, read_policies, train_grid
from studies.results import COMMAND
from studies.style import COLOURS, WITHOUT_MASK, styled
from unload import task
from unload.agent.config import TrainConfig
from unload.agent.greedy import save_policy
from unload.support import files

B2048 = TrainConfig()
CONFIG = replace(B2048, batch_size=256)
# The paper's configuration read in four ways, and two changes that hold its runs up.
PAPER_CELLS = {
    "paper_no_mask": cell(CONFIG, range(10)),
    "paper_mask": cell(CONFIG, range(10), mask=True),
    "paper_b2048_no_mask": cell(B2048, range(8)),
    "paper_b2048_mask": cell(B2048, range(8), mask=True),
}
PAPER = Grid(
    "falls/paper",
    f"{COMMAND} training",
    PAPER_CELLS
    | {
        "averaged_no_mask": cell(CONFIG, range(5), ties="average"),
        "averaged_mask": cell(CONFIG, range(10), mask=True, ties="average"),
        "averaged_b2048_mask": cell(B2048, range(10), mask=True, ties="average"),
        "positions_no_mask": cell(CONFIG, range(5), equalize=False),
        "positions_mask": cell(CONFIG, range(5), mask=True, equalize=False),
    },
)
DEFAULTS = "paper_b2048_no_mask"  # the cell of ``TrainConfig``'s defaults, of Figs. 11 and 12
PLAYERS = {0: "paper", 2: "paper_seed_2", 3: "paper_seed_3"}  # its seeds that play elsewhere
MASK_LINES = {"with the mask": "-", "without the mask": "--"}  # as everywhere: dashed is without
SMOOTH = 16  # episodes of all containers, about half a million picks


def training_data(cells: Sequence[str] | None = None, n_jobs: int = -1) -> None:
    """Train the paper's configuration, see ``train_grid``.

    The policies that play elsewhere are those that come with the package, too.
    """
    train_grid(PAPER, cells, n_jobs)
    if cells is None or DEFAULTS in cells:
        policies = read_policies(paths.DATA / f"{PAPER.name}.safetensors")
        for seed, name in PLAYERS.items():
            policy = policies[f"{DEFAULTS}/seed_{seed}"]
            save_policy(policy, files.SHIPPED / "policies" / f"{name}.safetensors")


def draw_learning_curve(
    axes: Axes, curve: pd.DataFrame, name: str, color: str = COLOURS["ranks"]
) -> None:
    """Draw the MSR while training: pale at each point of the curve, strong over whole episodes.

    All containers are reset together, every 32,000 picks, and full ones, in which there is no
    deadlock yet, are easier. Means over less than an episode therefore rise at every reset.

    Args:
        axes: where.
        curve: of ``unload.train`` in 64 containers, with a ``log_interval`` that divides 500.
        name: in the legend.
        color: of both lines.
    """
    axes.plot(curve["picks"], curve["success_rate"], color=color, linewidth=0.7, alpha=0.45)
    length = task.NUM_ENVS * task.MAX_PICKS
    whole = curve[curve["picks"] <= curve["picks"].max() // length * length]
    means = whole.groupby((whole["picks"] - 1) // length)["success_rate"].mean()
    middle = (means.index + 0.5) * length
    axes.plot(middle, means, "o-", color=color, markersize=3.5, label=name)
    axes.set(xlabel="picks", ylabel="MSR while training", ylim=(0, 1.02), xlim=(0, None))
    axes.xaxis.set_major_formatter(EngFormatter(sep=" "))


@styled
def over_picks(
    curves: pd.DataFrame, column: str, panels: Mapping[str, Mapping[str, str]]
) -> Figure:
    """A measure of all runs over picks, a panel for each setting (Figs. 11 and 12).

    Thin lines are means over episodes of all containers, strong ones running means of the first
    seed over half a million picks.

    Args:
        curves: ``cell``, ``seed``, ``picks`` and the measure.
        column: which measure.
        panels: the cells of each by a key of ``MASK_LINES``, by its title.
    """
    figure, (all_axes,) = plt.subplots(
        1, len(panels), figsize=(3 + 2.6 * len(panels), 3.6), sharex=True, sharey=True,
        squeeze=False,
    )  # fmt: skip
    for axes, (title, cells) in zip(all_axes, panels.items()):
        for (name, shown), colour in zip(cells.items(), (COLOURS["ranks"], WITHOUT_MASK)):
            for number, (_, run) in enumerate(curves[curves["cell"] == shown].groupby("seed")):
                axes.plot(run["picks"], run[column], colour, linewidth=0.4, alpha=0.35)
                if number == 0:
                    smooth = run[column].rolling(SMOOTH, min_periods=1).mean()
                    look = {"linestyle": MASK_LINES[name], "linewidth": 1.8, "zorder": 3}
                    axes.plot(run["picks"], smooth, colour, label=name, **look)
        axes.set(title=title, xlabel="step $k$ (picks)", xlim=(0, 2e7), xticks=np.arange(5) * 5e6)
        axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
    figure.get_layout_engine().set(wspace=0.06)  # the last tick of a panel, the first of the next
    handles, labels = all_axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure
