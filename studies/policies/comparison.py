"""Picking policies measured: the cards of some, and all compared.

    python -m studies policies

The file of a policy that comes with the package holds a card: how it was trained, and how it does;
``print(unload.load_policy("recommended"))`` shows it. In the comparison, rules and learned policies
unload the same containers: in the conditions of the training, with blurred positions, with boxes
of other sizes, and with every box simulated.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from hashlib import blake2b

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from studies.paper import training
from studies.policies.variants import GRIDS, RECOMMENDED
from studies.results import COMMAND, keep_all, publish, read_provenance, read_table
from studies.statistics import t_interval
from studies.style import COLOURS, styled
from unload import task
from unload.agent import policies
from unload.agent.config import TrainConfig
from unload.agent.evaluation import Policy, evaluate
from unload.agent.greedy import load_policy, save_policy, settings_of
from unload.load import substacks
from unload.load.boxes import Load
from unload.load.substacks import stack_load
from unload.network.weights import weights_file
from unload.physics.bullet import SETTINGS
from unload.physics.full import FullPhysics
from unload.support import files

# By scale, how many walls keep the boxes' proportions, and how many rows and columns of substacks
# fit: boxes × 0.8 leave a gap of 0.5 m at a side wall, boxes × 1.2 one of 0.33 m.
FITTING = {0.8: (15, 4, 4), 1.2: (10, 3, 3)}


def scaled_load(scale: float, rng: np.random.Generator) -> Load:
    """Draw a load as ``unload.stack_load`` does, with a variant for each substack of each wall.

    Args:
        scale: of the boxes' widths and heights, one of ``FITTING``.
        rng: the source of randomness.
    """
    walls, rows, columns = FITTING[scale]
    edges = [left for left, _ in substacks.COLUMNS]
    kinds = (substacks.LEFT, *[substacks.MID] * (columns - 2), substacks.RIGHT)
    variants = rng.integers(3, size=(walls, rows, columns))
    boxes = np.array(
        [
            (package, wall, edges[column] + left, substacks.CELLS_HIGH * row + low)
            for (wall, row, column), variant in np.ndenumerate(variants)
            for package, left, low in kinds[column][variant]
        ]
    )
    packages, corners = boxes[:, 0], boxes[:, 1:]
    # In walls and cells, as the corners.
    sizes = np.insert(substacks.PACKAGES, 0, 1, axis=1)[packages]
    cell = substacks.CELL * scale
    units = np.array([task.CONTAINER[0] / walls, cell, cell])
    return Load((corners + sizes / 2) * units, sizes * units, packages, corners[:, 0])


# Of the cards: fresh containers of 500 picks each, of a seed that no other data uses.
CARD_LOADS, CARD_SEED = 200, 5000
# Who stacks the loads, by what a card calls the measures on them.
SMALLER, LARGER = partial(scaled_load, 0.8), partial(scaled_load, 1.2)
STACKS = {
    "on the paper's loads": stack_load, "on boxes × 0.8": SMALLER, "on boxes × 1.2": LARGER,
}  # fmt: skip
_DEFAULT = training.PAPER.cells[training.DEFAULTS].config
# By name: the grid whose run it is, and the run's configuration.
ORIGINS: dict[str, tuple[str, TrainConfig]] = {
    **{
        name: (training.PAPER.name, replace(_DEFAULT, seed=seed))
        for seed, name in training.PLAYERS.items()
    },
    "recommended": (GRIDS["recommended"].name, RECOMMENDED),
}
SIMPLE = {"random": policies.random, "nearest": policies.nearest, "highest": policies.highest}
# Trainings of the paper's configuration end in two ways: one of each is compared.
LEARNED = ("paper", "paper_seed_2", "recommended")
# Who plays, by policy and mask: the rules with the mask only.
PLAYERS = (
    *((name, True) for name in SIMPLE),
    *((name, mask) for name in LEARNED for mask in (True, False)),
)
LOADS, SEED = 100, 3000  # fresh containers for each policy and condition
# In full physics an episode takes minutes, and only the front walls of a load are simulated. They
# hold all boxes that are seen during 100 picks, whatever is picked: the nearest 228 are in the
# front 6. With a seventh behind them, it is nearly twice as fast as with all.
FRONT_WALLS = 7
FULL = {
    "episodes": 10, "seed": 2000, "max_picks": 100, "physics": "full",
    "stack": lambda rng: front_walls(stack_load(rng)),
}  # fmt: skip
CONDITIONS = {
    "500 picks": {},
    "complete": {"max_picks": None},
    "σ 0.5 cm": {"position_noise": 0.005},
    "σ 2 cm": {"position_noise": 0.02},
    "σ 5 cm": {"position_noise": 0.05},
    "boxes × 0.8": {"stack": SMALLER},
    "boxes × 1.2": {"stack": LARGER},
    # Boxes drift, and one on which nothing lies may be jammed between its neighbours.
    "full, kept": FULL | {"physics": FullPhysics("keep")},
    "full, restored": FULL,
}
# Who plays; of the others, every decision with boxes restored would be the table's.
PLAYED = dict.fromkeys(CONDITIONS, PLAYERS) | {
    "full, kept": tuple(player for player in PLAYERS if player[1]),
    "full, restored": (("recommended", True),),
}
# From left to right and top to bottom.
PANELS = (
    "500 picks", "full, restored", "full, kept",
    "σ 0.5 cm", "σ 2 cm", "σ 5 cm",
    "complete", "boxes × 0.8", "boxes × 1.2",
)  # fmt: skip
LINES = {(policy, mask): policy if mask else f"{policy}, no mask" for policy, mask in PLAYERS}
SEEN = {"paper": "ranks", "paper_seed_2": "ranks", "recommended": "positions"}


def front_walls(load: Load, count: int = FRONT_WALLS) -> Load:
    """The ``count`` item walls nearest to the entrance, where they stand; no others."""
    kept = load.walls >= np.unique(load.walls)[-count]
    return Load(load.positions[kept], load.sizes[kept], load.packages[kept], load.walls[kept])


def write_cards() -> None:
    """Measure the policies that come with the package and write their cards into their files."""
    for name, (grid, config) in ORIGINS.items():
        path = files.SHIPPED / "policies" / f"{name}.safetensors"
        policy = load_policy(path)
        policy.card = {
            "configuration": config.plain(),
            "loads": "the paper's",
            "picks": config.picks,
            "fingerprint": read_provenance(grid)["fingerprint"],
            **{name: measure(policy, stack) for name, stack in STACKS.items()},
        }
        save_policy(policy, path)


def measure(policy: Policy, stack: Callable[[np.random.Generator], Load]) -> dict[str, float]:
    """How a policy does in fresh containers, each for 500 picks or until it is empty.

    Args:
        policy: see ``unload.policies``.
        stack: makes the loads, see ``unload.evaluate``.

    Returns:
        ``msr``, ``misses`` and ``picks`` with the mask, and ``msr_no_mask``.
    """
    masked, free = (
        evaluate(policy, CARD_LOADS, CARD_SEED, mask=mask, stack=stack) for mask in (True, False)
    )
    picks = (masked["unloaded"] / masked["success_rate"]).fillna(task.MAX_PICKS)
    return {
        "msr": round(masked["success_rate"].mean(), 5),
        "misses": round((picks - masked["unloaded"]).sum()),
        "picks": round(picks.sum()),
        "msr_no_mask": round(free["success_rate"].mean(), 5),
    }


def comparison_data(n_jobs: int = -1) -> None:
    """Let policies unload the same containers under each condition: ``policies.csv``.

    One row per policy, condition and container, with the columns of ``compare``. The learned
    policies are compared twice, with and without the mask. A run that was stopped goes on.
    """
    weights = digests()
    cases = [
        {"policy": name, "mask": mask, "condition": condition}
        for condition, players in PLAYED.items()
        for name, mask in players
    ]
    asked = [
        (case | {"physics": SETTINGS, "weights": weights.get(case["policy"])}, (*case.values(),))
        for case in cases
    ]
    results = keep_all("comparison", compare, asked, n_jobs)
    tables = {"policies": pd.concat([pd.DataFrame(result.value) for result in results])}
    full = {name: FULL[name] for name in ("episodes", "seed", "max_picks")}
    settings = {"policies": weights, "loads": LOADS, "seed": SEED}
    settings["full"] = full | {"front walls": FRONT_WALLS}
    publish("policies", tables, f"{COMMAND} policies", settings, results)


def compare(name: str, mask: bool, condition: str) -> dict[str, list]:
    """The rows of ``evaluate`` for a policy under a condition.

    Returns:
        Its columns, and ``policy``, ``mask``, ``condition`` and ``load`` before them.
    """
    arguments = {"episodes": LOADS, "seed": SEED, "mask": mask} | CONDITIONS[condition]
    table = evaluate(SIMPLE.get(name) or load_policy(name), **arguments)
    named = {"policy": name, "mask": mask, "condition": condition, "load": table.index}
    return pd.concat([pd.DataFrame(named), table], axis=1).to_dict("list")


def digests() -> dict[str, str]:
    """A digest of each learned policy, of its file without the card."""
    found = {}
    for name in LEARNED:
        policy = load_policy(name)
        content = weights_file("policy", settings_of(policy), policy.network.state_dict())
        found[name] = blake2b(content, digest_size=16).hexdigest()
    return found


@styled
def comparison_msr() -> Figure:
    """MSR of every policy: a panel for each condition, dots with 95 % intervals.

    Hollow dots are played without the mask.
    """
    table = read_table("policies")
    figure, panels = plt.subplots(3, 3, figsize=(8.4, 6.2), sharex=True, sharey=True)
    for axes, condition in zip(panels.flat, PANELS):
        _panel(axes, table[table["condition"] == condition])
        axes.set_title(condition, loc="left")
    panels[0, 0].set(xlim=(0, 1.04), ylim=(len(LINES) - 0.5, -0.5))
    panels[0, 0].set_yticks(range(len(LINES)), LINES.values())
    panels[0, 0].xaxis.set_major_formatter(PercentFormatter(1, symbol=""))
    for axes in panels[-1]:
        axes.set_xlabel("MSR (%)")
    return figure


def _panel(axes: Axes, table: pd.DataFrame) -> None:
    """All policies under one condition."""
    rates = dict(list(table.groupby(["policy", "mask"])["success_rate"]))
    count = max(map(len, rates.values()))
    axes.set_title(f"{count} containers", loc="right", fontsize=7, color="0.45")
    for row, (policy, mask) in enumerate(LINES):
        if (policy, mask) not in rates:
            # With every box simulated: without the mask, and restored by most policies.
            axes.text(0.03, row, "–", va="center", fontsize=7, color="0.45")
            continue
        rate = rates[policy, mask]
        colour = COLOURS[SEEN.get(policy, policy)]
        axes.plot(t_interval(rate), [row, row], color=colour)
        axes.plot(rate.mean(), row, "o", color=colour, markerfacecolor=colour if mask else "white",
                  markersize=5, clip_on=False, zorder=3)  # fmt: skip
