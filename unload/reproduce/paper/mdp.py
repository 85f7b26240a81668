"""The training loop of the task as a Markov decision process (Fig. 1)."""

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from unload.reproduce.style import styled

INK = "#333333"
PANELS = {"Agent": (19, "#eaf2f8"), "Environment": (1, "#f6f1e7")}  # lower edge, colour
WIDTH, HEIGHT = 14, 6.5  # of a block
COLUMNS = (15, 35, 55, 75)  # left edges of the blocks
# From left to right: what a block is called, and what it does.
AGENT = (
    ("equalization", "ranks, Alg. 1"),
    ("PEQ network", "one score per item"),
    ("action mask", "failed items are out"),
    ("choice", "ε-greedy"),
)
ENVIRONMENT = (
    ("observation", "128 nearest, scaled"),
    ("container", "800–1000 items"),
    ("moved ≥ 0.2 m?", "yes: unload, no: leave"),
    ("lift", "PyBullet: 20 N, 0.3 s"),
)


@styled
def fig01_mdp() -> Figure:
    """Fig. 1: agent and environment of the task, and what passes between them."""
    figure, axes = plt.subplots(figsize=(10.4, 3.7))
    axes.set(xlim=(0, 104), ylim=(0, 37), aspect="equal")
    axes.axis("off")
    for name, (low, colour) in PANELS.items():
        _rounded(axes, 12, low, 80, 17, fc=colour, ec="none")
        axes.text(13.5, low + 15.8, name, fontsize=12, fontweight="bold", va="top")
    upper, lower = 25.5, 3  # lower edges of the blocks
    for blocks, low in ((AGENT, upper), (ENVIRONMENT, lower)):
        for x, (title, text) in zip(COLUMNS, blocks):
            _block(axes, x, low, title, text)
    middle, below = upper + HEIGHT / 2, lower + HEIGHT / 2
    for left, right in zip(COLUMNS, COLUMNS[1:]):
        _arrow(axes, (left + WIDTH, middle), (right, middle))
        _arrow(axes, (right, below), (left + WIDTH, below))
    axes.text(52, middle + 0.5, r"$\hat{q}$", ha="center", va="bottom", color=INK)
    _rounded(axes, 20, 20.2, 32, 3, fc="white", ec=INK)
    text = r"learning: replay buffer, smooth-$L_1$ loss ($\gamma = 0$)"
    axes.text(36, 21.7, text, ha="center", va="center", fontsize=8)
    _arrow(axes, (42, 23.2), (42, upper), dashed=True)

    # Action on the right, observation on the left, reward and mask between the panels.
    _path(axes, [(89, middle), (98, middle), (98, below), (89, below)])
    axes.text(99, 17.5, "action\n$u_k$: row of\nthe item\nto pick", va="center")
    _path(axes, [(15, below), (6, below), (6, middle), (15, middle)])
    axes.text(5, 17.5, "next\nobservation\n$x_{k+1}$", va="center", ha="right")
    _path(axes, [(58, lower + HEIGHT), (58, 21.7), (52, 21.7)])
    axes.text(57, 14, r"reward $r_{k+1} = \pm 1$", va="center", ha="right")
    _arrow(axes, (66, lower + HEIGHT), (66, upper))
    axes.text(67, 14, "mask of failed items", va="center")
    return figure


def _rounded(axes: Axes, x: float, y: float, width: float, height: float, **look) -> None:
    shape = "round,pad=0,rounding_size=0.8"
    axes.add_patch(FancyBboxPatch((x, y), width, height, shape, **look))


def _block(axes: Axes, x: float, y: float, title: str, text: str) -> None:
    _rounded(axes, x, y, WIDTH, HEIGHT, fc="white", ec=INK, lw=1)
    middle = x + WIDTH / 2
    axes.text(middle, y + 4.2, title, ha="center", va="center", fontweight="bold", fontsize=9)
    axes.text(middle, y + 1.9, text, ha="center", va="center", fontsize=7.5, color="#555555")


def _arrow(axes: Axes, start, end, dashed: bool = False) -> None:
    axes.add_patch(
        FancyArrowPatch(
            start, end, arrowstyle="-|>", mutation_scale=12, shrinkA=0, shrinkB=0,
            color=INK, lw=1.3, ls=(0, (3, 2)) if dashed else "-",
        )
    )  # fmt: skip


def _path(axes: Axes, corners: list[tuple[float, float]]) -> None:
    """An arrow around corners."""
    axes.plot(*zip(*corners[:-1]), color=INK, lw=1.3, solid_capstyle="butt")
    _arrow(axes, corners[-2], corners[-1])
