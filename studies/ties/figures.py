"""Where runs end, by how ties are broken."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.falls.long import LONG
from studies.grid import Grid, read_grid
from studies.paper.training import PAPER
from studies.statistics import PAPER_MSR, by_run
from studies.style import styled
from studies.ties.criterion import likeness
from studies.ties.earlier import read_earlier
from studies.ties.training import TIES

# How ties are broken, in the order of the figure, and the cells of b = 256 that do so, without
# the ending that says whether the mask is on in training.
KINDS: dict[str, list[tuple[Grid | None, str]]] = {
    "items' order": [(None, "ties_by_order")],
    "averaged": [(PAPER, "averaged"), (TIES, "averaged")],
    "noise anew\nat each pick": [(TIES, "anew")],
    "noise that\ndrifts": [(TIES, "drifting")],
    "settled walls,\nfrozen": [(None, "ties_by_drift")],
    "noise,\nfrozen": [(PAPER, "paper"), (LONG, "ranks"), (TIES, "frozen")],
}


def read_by_ties() -> pd.DataFrame:
    """All published runs of the paper's configuration with b = 256, by how ties are broken.

    Returns:
        A row per run: ``ties``, ``mask``, ``cell``, ``seed``, and what ``criterion.likeness`` says.
    """
    curves = {grid.name: read_grid(grid) for grid in (PAPER, LONG, TIES)}
    rows = []
    for ties, cells in KINDS.items():
        for mask in (True, False):
            for grid, name in cells:
                # A cell of the long runs with the mask has no ending.
                ending = ("" if grid is LONG else "_mask") if mask else "_no_mask"
                table = read_earlier() if grid is None else curves[grid.name]
                found = table[table["cell"] == name + ending]
                if len(found):
                    runs = by_run(found, likeness)
                    runs.insert(0, "ties", ties.replace("\n", " "))
                    runs.insert(1, "mask", mask)
                    rows.append(runs)
    return pd.concat(rows, ignore_index=True)


@styled
def draw_ends(runs: pd.DataFrame) -> Figure:
    """The end of each run over how its ties are broken, with the mask in training and without.

    Args:
        runs: see ``read_by_ties``.
    """
    figure, panels = plt.subplots(1, 2, figsize=(9.4, 3.9), sharey=True)
    for axes, mask in zip(panels, (True, False)):
        labels = []
        for place, label in enumerate(KINDS):
            group = runs[(runs["ties"] == label.replace("\n", " ")) & (runs["mask"] == mask)]
            spread = np.linspace(-0.25, 0.25, len(group)) if len(group) > 1 else [0.0] * len(group)
            for fell, face in ((True, "none"), (False, "C1")):
                shown = (group["fell"] == fell).to_numpy()
                axes.plot(
                    place + np.asarray(spread)[shown], 100 * group["end"][shown], "o",
                    markersize=5, markeredgecolor="C1", markerfacecolor=face,
                )  # fmt: skip
            labels.append(f"{label}\n({len(group)} runs)")
        axes.axhline(100 * PAPER_MSR, color="0.4", linestyle=":", linewidth=1)
        axes.set_xticks(range(len(KINDS)), labels, fontsize=7)
        axes.set(title=f"{'with' if mask else 'without'} the mask", ylim=(0, 103))
    panels[0].set_ylabel("MSR over the last tenth of the picks (%)")
    return figure
