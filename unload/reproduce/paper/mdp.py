"""The training loop of the task as a Markov decision process (Fig. 1)."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch, Rectangle

from unload.env import observation
from unload.env.equalization import equalize
from unload.load.substacks import package_colour, stack_load
from unload.load.view import COLOURS
from unload.reproduce.paper.observation import EQUALIZED
from unload.reproduce.style import styled

INK, GREY = "#333333", "#9a9a9a"
AGENT, ENVIRONMENT = "#eaf2f8", "#f6f1e7"
# Six items stand for the 128: their scores, and which failed since the last success.
SCORES = (0.35, 0.9, 0.55, 0.75, 0.2, 0.45)
FAILED, CHOSEN = 1, 3


@styled
def fig01_mdp() -> Figure:
    """Fig. 1: agent and environment of the task, and what passes between them."""
    figure, axes = plt.subplots(figsize=(10.4, 6.2))
    axes.set(xlim=(0, 104), ylim=(0, 62), aspect="equal")
    axes.axis("off")
    load = stack_load(np.random.default_rng(0))
    _draw_agent(axes, load)
    _draw_environment(axes, load)
    _draw_exchange(axes)
    return figure


def _draw_agent(axes: Axes, load) -> None:
    _panel(axes, 12, 35, 80, 26, "Agent", AGENT)
    blocks = (
        (15, "equalization", "ranks, Alg. 1"),
        (35, "PEQ network", "one score per item"),
        (55, "action mask", "failed items are out"),
        (75, "choice", "ε-greedy"),
    )
    for x, title, text in blocks:
        _block(axes, x, 42, title, text)
    _mini_equalization(axes, 15, 45.5, load)
    _mini_network(axes, 35, 45.5)
    _mini_scores(axes, 55, 45.5, chosen=None)
    _mini_scores(axes, 75, 45.5, chosen=CHOSEN)
    for x in (29, 49, 69):
        _arrow(axes, (x, 49), (x + 6, 49))
    axes.text(52, 50, r"$\hat{q}$", ha="center", va="bottom", color=INK)
    axes.add_patch(
        FancyBboxPatch((20, 36.2), 32, 3.6, "round,pad=0,rounding_size=0.8", fc="white", ec=INK)
    )
    text = r"learning: replay buffer, smooth-$L_1$ loss ($\gamma = 0$)"
    axes.text(36, 38, text, ha="center", va="center", fontsize=8)
    _arrow(axes, (42, 39.8), (42, 42), dashed=True)


def _draw_environment(axes: Axes, load) -> None:
    _panel(axes, 12, 1, 80, 26, "Environment", ENVIRONMENT)
    blocks = (
        (75, "lift", "PyBullet: 20 N, 0.3 s"),
        (55, "moved ≥ 0.2 m?", "yes: unload, no: leave"),
        (35, "container", "800–1000 items"),
        (15, "observation", "128 nearest, scaled"),
    )
    for x, title, text in blocks:
        _block(axes, x, 5, title, text)
    _mini_lift(axes, 75, 8.5)
    _mini_reward(axes, 55, 8.5)
    _mini_wall(axes, 35, 8.5, load)
    _mini_observation(axes, 15, 8.5, load)
    for x in (75, 55, 35):
        _arrow(axes, (x, 12), (x - 6, 12))


def _draw_exchange(axes: Axes) -> None:
    """Action on the right, observation and reward on the left."""
    _path(axes, [(89, 49), (98, 49), (98, 12), (89, 12)])
    axes.text(99, 31, "action\n$u_k$: row of\nthe item\nto pick", va="center")
    _path(axes, [(15, 12), (6, 12), (6, 49), (15, 49)])
    axes.text(5, 31, "next\nobservation\n$x_{k+1}$", va="center", ha="right")
    _path(axes, [(58, 19), (58, 38), (52, 38)])
    axes.text(57, 31, r"reward $r_{k+1} = \pm 1$", va="center", ha="right")
    _arrow(axes, (66, 19), (66, 42))
    axes.text(67, 31, "mask of failed items", va="center")


def _panel(axes: Axes, x, y, width, height, title, colour) -> None:
    axes.add_patch(
        FancyBboxPatch((x, y), width, height, "round,pad=0,rounding_size=1.5", fc=colour, ec="none")
    )
    axes.text(x + 1.5, y + height - 1.2, title, fontsize=12, fontweight="bold", va="top")


def _block(axes: Axes, x, y, title, text, width=14, height=14) -> None:
    axes.add_patch(
        FancyBboxPatch(
            (x, y), width, height, "round,pad=0,rounding_size=0.8", fc="white", ec=INK, lw=1
        )
    )
    middle = x + width / 2
    axes.text(middle, y + height - 0.9, title, ha="center", va="top", fontweight="bold", fontsize=9)
    axes.text(middle, y + 1.6, text, ha="center", va="center", fontsize=7.5, color="#555555")


def _arrow(axes: Axes, start, end, dashed=False) -> None:
    axes.add_patch(
        FancyArrowPatch(
            start, end, arrowstyle="-|>", mutation_scale=12, shrinkA=0, shrinkB=0,
            color=INK, lw=1.3, ls=(0, (3, 2)) if dashed else "-",
        )
    )  # fmt: skip


def _path(axes: Axes, corners) -> None:
    """An arrow around corners."""
    axes.plot(*zip(*corners[:-1]), color=INK, lw=1.3, solid_capstyle="butt")
    _arrow(axes, corners[-2], corners[-1])


def _mini_equalization(axes: Axes, x, y, load) -> None:
    """Depths of twelve visible items before and after equalization."""
    depths = observation.scale(load.positions)[observation.nearest(load.positions)[::11]]
    equal = equalize(depths)
    for level, values, colour in (
        (4.4, depths[:, 0], COLOURS["visible"]),
        (0.9, equal[:, 0], EQUALIZED),
    ):
        axes.plot([x + 1.5, x + 12.5], [y + level] * 2, color=GREY, lw=0.8)
        axes.plot(x + 7 + 5.3 * values, np.full(len(values), y + level), "o", ms=3.2,
                  color=colour, mec="white", mew=0.3)  # fmt: skip
    _arrow(axes, (x + 7, y + 3.6), (x + 7, y + 1.8))


def _mini_network(axes: Axes, x, y) -> None:
    """Every item passes the same weights; all are pooled to a common context."""
    heights = y + np.linspace(0.2, 5.2, 4)
    axes.add_patch(Rectangle((x + 6.3, y - 0.2), 1.4, 5.8, fc=GREY, alpha=0.35, ec="none"))
    for height in heights:
        axes.plot([x + 2, x + 12], [height, height], color=GREY, lw=0.8)
        axes.plot([x + 2, x + 7, x + 12], [height] * 3, "o", ms=4, color=COLOURS["visible"])
        axes.plot([x + 7, x + 9.8], [height, y + 2.7], color=GREY, lw=0.6)
    axes.plot(x + 9.8, y + 2.7, "s", ms=5, color=INK, zorder=4)


def _mini_scores(axes: Axes, x, y, chosen) -> None:
    """Scores of the items; the failed one is struck out, the chosen one is dark."""
    for item, score in enumerate(SCORES):
        left, height = x + 1.6 + 1.9 * item, 5.4 * score
        colour = INK if item == chosen else COLOURS["visible"]
        if item == FAILED:
            axes.add_patch(Rectangle((left, y), 1.3, height, fc="#eeeeee", ec=GREY, lw=0.7))
            axes.plot([left - 0.2, left + 1.5], [y, y + height], color=COLOURS["failed"], lw=1.8)
        else:
            axes.add_patch(Rectangle((left, y), 1.3, height, fc=colour, ec="none"))
    axes.plot([x + 1.2, x + 12.8], [y, y], color=INK, lw=0.8)


def _mini_lift(axes: Axes, x, y) -> None:
    """A box pulled up from its neighbours."""
    axes.plot([x + 1.5, x + 12.5], [y - 0.4, y - 0.4], color=INK, lw=0.8)
    for left, package in ((2.2, 1), (9.0, 10)):
        axes.add_patch(Rectangle((x + left, y - 0.4), 2.8, 2.4, fc=package_colour(package)))
    axes.add_patch(Rectangle((x + 5.5, y - 0.4), 3, 2.4, fc="none", ec=GREY, ls=":", lw=1))
    axes.add_patch(Rectangle((x + 5.5, y + 1.4), 3, 2.4, fc=package_colour(6)))
    _arrow(axes, (x + 7, y + 2.6), (x + 7, y + 6))


def _mini_reward(axes: Axes, x, y) -> None:
    for level, text, meaning, colour in (
        (4.1, "+1", "yes", COLOURS["liftable"]),
        (0.9, "−1", "no", COLOURS["failed"]),
    ):
        axes.text(x + 5.3, y + level, meaning, ha="right", va="center", fontsize=8.5)
        axes.text(x + 8.6, y + level, text, ha="center", va="center", fontsize=10, color="white",
                  fontweight="bold",
                  bbox={"boxstyle": "round,pad=0.25", "fc": colour, "ec": "none"})  # fmt: skip


def _mini_wall(axes: Axes, x, y, load) -> None:
    """The front wall of a load, to scale."""
    front = load.walls == load.walls.max()
    scale = 3.0  # drawing units per m
    left, lower = x + 7 - 1.25 * scale, y - 0.6
    for position, size, package in zip(
        load.positions[front], load.sizes[front], load.packages[front]
    ):
        corner = (position - size / 2)[1:] * scale
        axes.add_patch(
            Rectangle((left + corner[0], lower + corner[1]), *(size[1:] * scale),
                      fc=package_colour(package), ec="white", lw=0.3)
        )  # fmt: skip
    axes.plot(
        [left - 0.15] * 2 + [left + 2.5 * scale + 0.15] * 2,
        [lower + 2.3 * scale, lower - 0.1, lower - 0.1, lower + 2.3 * scale],
        color=INK,
        lw=1.2,
    )


def _mini_observation(axes: Axes, x, y, load) -> None:
    """Side view of the positions, the observed ones in the colour of what is visible."""
    seen = np.zeros(len(load), dtype=bool)
    seen[observation.nearest(load.positions)] = True
    for which, colour in ((~seen, "#bdbdba"), (seen, COLOURS["visible"])):
        points = load.positions[which]
        axes.plot(x + 2 + points[:, 0] * 1.43, y + points[:, 2] * 2.5, "o", ms=1.5, mew=0,
                  color=colour)  # fmt: skip
