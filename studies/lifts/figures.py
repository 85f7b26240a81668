"""Lifts of a few boxes that notebook 10 looks at, and figures of lifts.

Drawn are lifts of stacks, a box that tips aside, jams, and two ways to lift compared.
"""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon

import unload
from studies.policies.comparison import front_walls
from studies.style import styled
from unload import task
from unload.drawing.picture import COLOURS
from unload.physics.bullet import TIME_STEP, World, slim
from unload.physics.situation import RESOLUTION, Situation, Surroundings

STICKS_OUT = 100  # μm, more than rounding
END = 0.5  # m, beyond what any lift moves a box
CORNERS = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])  # of a box of size 1
ON_TOP = {0: "C2", 1: "C0", 2: "C1", 3: "C4"}  # colour by boxes on top; 3 stands for more, too


def top_lifts(gap: float, seed: int) -> np.ndarray:
    """How far each box of a wall's top layer is lifted, in m, where all boxes can move.

    Args:
        gap: m, by which each box is narrower along x and y.
        seed: of the load whose foremost wall it is.
    """
    wall = front_walls(unload.stack_load(np.random.default_rng(seed)), 1)
    tops = (wall.positions + wall.sizes / 2)[:, 2]
    moved = []
    for number in np.flatnonzero(tops > tops.max() - 0.001):
        world = World()
        world.add_box((3.5, 1.25, -0.5), (9, 9, 1), mass=0)  # the floor
        for y in (-0.5, 3.0):  # the side walls of the container
            world.add_box((3.5, y, 1.25), (9, 1, 2.5), mass=0)
        boxes = zip(wall.positions, wall.sizes - (gap, gap, 0))
        bodies = [world.add_box(place, size, task.MASS) for place, size in boxes]
        moved.append(world.pull(bodies[number]))
        world.close()
    return np.array(moved)


def partly_on_top(situation: Situation) -> bool:
    """Whether exactly one box rests on the chosen one, and sticks out beyond it along y."""
    if situation.on_top != 1:
        return False
    chosen, top = situation.boxes[:2]
    return bool(abs(top[1]) + top[4] / 2 > chosen[4] / 2 + STICKS_OUT)


def hard_situations(loads: int, seed: int) -> list[Situation]:
    """The distinct situations of ``partly_on_top`` while random loads are unloaded.

    Half of the free boxes are taken away at a time, until no more are left than are visible.
    """
    rng = np.random.default_rng(seed)
    found: dict[bytes, Situation] = {}
    for _ in range(loads):
        load = unload.stack_load(rng)
        surroundings = Surroundings(load, np.ones(len(load), bool))
        while surroundings.present.sum() > task.N_VISIBLE:
            present = np.flatnonzero(surroundings.present).tolist()
            around = {item: surroundings.situation(item) for item in present}
            found |= {each.key: each for each in around.values() if partly_on_top(each)}
            free = [item for item, each in around.items() if each.on_top == 0]
            surroundings.present[rng.choice(free, len(free) // 2 + 1, replace=False)] = False
    return list(found.values())


def record(situation: Situation, times: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Lift the chosen box of a situation away from floor and side walls, and note all poses.

    Returns:
        Sizes (boxes, 2) and poses (times, boxes, 3), as seen from the front: along y and z in m,
        and the angle about x.
    """
    world, boxes, poses = World(), situation.boxes * RESOLUTION, []
    masses = np.where(np.arange(len(boxes)) < situation.dynamic, task.MASS, 0)
    bodies = [world.add_box(b[:3], slim(b[3:]), mass) for b, mass in zip(boxes, masses)]
    # Whole numbers of steps between the moments.
    for steps in np.diff(np.rint(np.divide(times, TIME_STEP)), prepend=0):
        world.pull(bodies[0], seconds=steps * TIME_STEP)
        now = [world.pose(body) for body in bodies]
        poses.append([(p[1], p[2], 2 * np.arctan2(q[0], q[3])) for p, q in now])
    world.close()
    return boxes[:, 4:], np.array(poses)


@styled
def distances(panels: Mapping[str, Mapping[str, Sequence]], paper: Sequence[float]) -> Figure:
    """Distances over one quantity a panel: lines are the formula, dots are measured.

    Args:
        panels: by the label of the quantity, curves by name: (values, formula, measured), each
            (n,), distances in m.
        paper: its value of each panel's quantity.
    """
    figure, grid = plt.subplots(1, len(panels), figsize=(3.2 * len(panels), 3), sharey=True)
    for axes, (label, curves), given in zip(grid, panels.items(), paper):
        for number, (name, (values, formula, measured)) in enumerate(curves.items()):
            axes.plot(values, formula, color=f"C{number}")
            axes.plot(values, measured, "o", ms=3.5, color=f"C{number}", label=name)
        axes.axhline(task.LIFT_THRESHOLD, color="C5", ls="--", lw=1, label="threshold")
        axes.axvline(given, color="#bbbbbb", lw=1, zorder=0)
        axes.set_xlabel(label)
        axes.legend(fontsize=8)
    grid[0].set_ylabel("distance moved (m)")
    return figure


@styled
def stack_bars(moved: np.ndarray, threshold: float, title: str) -> Figure:
    """How far the lowest box of stacks of 1, 2, … boxes moves, (n,) m; green if it suffices."""
    figure, axes = plt.subplots(figsize=(5, 3))
    colours = np.where(moved >= threshold, "C2", "0.7")
    axes.bar(np.arange(1, len(moved) + 1), moved, color=colours)
    axes.axhline(threshold, color="C5", ls="--", lw=1)
    axes.set(xlabel="boxes in the stack", ylabel="distance moved (m)", title=title)
    return figure


@styled
def tail(moved: np.ndarray, free: float) -> Figure:
    """How often lifts move a box how far, (n,) m, beside the threshold and a ``free`` box."""
    figure, axes = plt.subplots()
    axes.hist(moved, np.arange(0, 0.48, 0.01))
    axes.axvline(task.LIFT_THRESHOLD, color="C5", ls="--", lw=1, label="threshold")
    axes.axvline(free, color="C2", lw=1, label="free box")
    axes.set(xlabel="distance moved (m)", ylabel="distinct situations", yscale="log")
    axes.legend(loc="upper right", bbox_to_anchor=(0.92, 1))
    return figure


@styled
def tipping(lifts: Mapping[str, tuple[np.ndarray, np.ndarray]], times: Sequence[float]) -> Figure:
    """Lifts seen from the front, a row each: what moves, and what it stands on.

    Args:
        lifts: by name, sizes and poses as ``record`` gives them.
        times: of the poses, in s.
    """
    figure, grid = plt.subplots(len(lifts), len(times), figsize=(10, 2.05 * len(lifts) + 0.3))
    meanings = {}
    for line, (label, (sizes, poses)) in zip(grid, lifts.items()):
        # Room for the two boxes that move, however they turn.
        reach = np.hypot(*sizes[:2].T)[:, None] / 2
        low, high = ((poses[:, :2, :2] + reach * sign) for sign in (-1, 1))

        moved = np.hypot(*(poses[-1] - poses[0])[0, :2]) >= task.LIFT_THRESHOLD
        chosen = "liftable" if moved else "blocked"
        names = [f"chosen box, {chosen}", "on top of it", "cannot move"]
        colours = [COLOURS[name] for name in (chosen, *names[1:])]
        meanings |= dict(zip(names, colours))
        for axes, moment, pose in zip(line, times, poses):
            for box, (size, (y, z, angle)) in enumerate(zip(sizes, pose)):
                turn = np.array([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))])
                corners = CORNERS * size @ turn + (y, z)
                axes.add_patch(Polygon(corners, fc=colours[min(box, 2)], ec="white", lw=0.8))
            axes.set(xlim=(low[..., 0].min(), high[..., 0].max()), xticks=[])
            axes.set(ylim=(low[..., 1].min(), high[..., 1].max()), yticks=[], aspect="equal")
            axes.set_title(f"{moment:.2f} s", fontsize=8)
            axes.spines[:].set(visible=True, color="#cccccc")
        line[0].set_ylabel(label, fontsize=9)
    handles = [Patch(fc=colour, label=meaning) for meaning, colour in meanings.items()]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), fontsize=9)
    return figure


@styled
def jams(table: pd.DataFrame, model: tuple[float, float]) -> Figure:
    """The share of free boxes that jam over the friction, a line for each gap, a dot for each load.

    Args:
        table: ``data/seamless/jams.csv``.
        model: the share that the model of notebook 12 needs, from and to, in percent.
    """
    fresh = table[table["question"] == "fresh"]
    figure, axes = plt.subplots(figsize=(5.2, 3.4))
    axes.axhspan(*model, color="0.9", label="the model of notebook 12")
    colours = plt.get_cmap("viridis")(np.linspace(0, 0.85, fresh["gap"].nunique()))
    for (gap, rows), colour in zip(fresh.groupby("gap"), colours):
        groups = rows.groupby("friction")[["free", "jammed"]].sum()
        name = "seamless" if gap == 0 else f"gap {1000 * gap:g} mm"
        share = 100 * groups["jammed"] / groups["free"]
        axes.plot(share.index, share, "o-", color=colour, label=name)
        by_load = 100 * rows["jammed"] / rows["free"]
        axes.plot(rows["friction"], by_load, ".", color=colour, alpha=0.4, markersize=4)
    axes.set(xlabel="friction of a contact", ylabel="free boxes that jam (%)", ylim=(-2, 102))
    axes.legend(fontsize=8)
    return figure


@styled
def agreement(frame: pd.DataFrame, one: str, others: Sequence[str]) -> Figure:
    """How far a box moves in one way to lift it and in others; shaded where they would differ.

    Args:
        frame: a row per lift, with ``on_top`` and a column per way, in m, NaN if it was not asked.
        one: the way along the horizontal axes.
        others: a panel for each.
    """
    figure, panels = plt.subplots(
        1, len(others), figsize=(5 * len(others), 5), sharex=True, sharey=True, squeeze=False
    )
    threshold = task.LIFT_THRESHOLD
    for axes, other in zip(panels.flat, others):
        axes.fill_between([-0.02, threshold], threshold, END, color="0.93")
        axes.fill_between([threshold, END], -0.02, threshold, color="0.93")
        for number, colour in ON_TOP.items():
            lifts = frame[frame[other].notna() & (frame["on_top"].clip(upper=3) == number)]
            name = "3 or more" if number == 3 else str(number)
            axes.scatter(lifts[one], lifts[other], s=14, alpha=0.6, color=colour, label=name)
        axes.set(xlabel=f"distance moved in {one} (m)", ylabel=f"distance moved in {other} (m)")
        axes.set(xlim=(-0.02, END), ylim=(-0.02, END), aspect="equal")
    panels[0, 0].legend(title="boxes on top", loc="upper left")
    return figure
