"""The command line: each experiment is a part."""

import argparse
from collections.abc import Callable
from functools import partial

from studies.falls import laboratory, long
from studies.grid import Grid, train_grid
from studies.heap import greed, table
from studies.lifts import agreement, certain, engines, lift_table
from studies.mask import laboratory as mask
from studies.order import laboratory as order_laboratory
from studies.order import training as order
from studies.paper import training, tuning, visible_items
from studies.policies import comparison, variants
from studies.results import COMMAND
from studies.seamless import training as seamless
from studies.ties import choice
from studies.ties import laboratory as ties_laboratory
from studies.ties import training as ties

JOBS = {
    "--jobs": {
        "dest": "n_jobs", "type": int, "default": -1, "help": "processes; one per core if -1"
    }
}  # fmt: skip


def some(grid: Grid) -> dict:
    """The options of a part of which some cells or runs can be trained alone."""
    text = (
        f"cells to train ({', '.join(grid.cells)}), or runs, such as {next(iter(grid.configs()))}"
    )
    choices = [*grid.cells, *grid.configs()]
    return {"--cells": {"nargs": "+", "choices": choices, "metavar": "CELL", "help": text}, **JOBS}


def lifts(n_jobs: int) -> None:
    """Make the lift table, and ask the physics that it stands for about the same lifts."""
    lift_table.lift_data()
    agreement.agreement_data(n_jobs=n_jobs)


def policies(n_jobs: int) -> None:
    """Measure policies, and compare them."""
    comparison.write_cards()
    comparison.comparison_data(n_jobs=n_jobs)


def sb3(n_jobs: int) -> None:
    """Train agents of Stable-Baselines3."""
    from studies.policies.sb3 import sb3_data  # here, because no other part needs the library

    sb3_data(n_jobs)


# Part → summary, what makes its data, and its options.
PARTS: dict[str, tuple[str, Callable, dict]] = {
    "lifts": ("the lift table, and the physics that it stands for", lifts, JOBS),
    "engines": ("lifts by a second engine", engines.engines_data, {}),
    "certain": ("lifts of loads that never repeat", certain.certain_data, {}),
    "observation": ("Figs. 4–6", visible_items.observation_data, {}),
    "tuning": ("Figs. 8–10", tuning.tuning_data, JOBS),
    "training": ("Figs. 11 and 12", training.training_data, some(training.PAPER)),
    "variants": ("other networks and rewards", variants.variants_data, JOBS),
    "policies": ("policies compared", policies, JOBS),
    "sb3": ("agents of Stable-Baselines3, trained for minutes", sb3, JOBS),
    "laboratory": ("why runs fall: the laboratory", laboratory.laboratory_data, JOBS),
    "fresh": ("why runs fall: fresh seeds", laboratory.fresh_data, JOBS),
    "seamless": (
        "seamless walls, in which boxes jam", seamless.seamless_data, some(seamless.SEAMLESS)
    ),
    "ties_laboratory": (
        "how long an order of equals lasts: the laboratory", ties_laboratory.laboratory_data, JOBS
    ),
    "ties": ("how equal coordinates are ranked", partial(train_grid, ties.TIES), some(ties.TIES)),
    "falls": ("why runs fall: the long runs", long.falls_data, some(long.LONG)),
    "choice": ("published networks with other noise and other masks", choice.choice_data, JOBS),
    "choice_laboratory": (
        "noise at the choice or in the memory, the mask in training: the laboratory",
        choice.choice_laboratory_data, JOBS,
    ),
    "order": (
        "the index that sorting returns, in place of the rank", order.order_data,
        some(order.ORDER),
    ),
    "mask": ("parts of an episode to learn from", mask.mask_data, some(mask.MASK)),
    "order_laboratory": (
        "the index that sorting returns: the laboratory", order_laboratory.laboratory_data, JOBS
    ),
    "mask_laboratory": (
        "parts of an episode to learn from: the laboratory", mask.laboratory_data, JOBS
    ),
    "heap": ("heaps, of which a rake picks several boxes at once", table.heap_data, JOBS),
    "greed": ("heaps pick by pick", greed.greed_data, JOBS),
}  # fmt: skip


def paper(n_jobs: int) -> None:
    """Make all data."""
    for _, make, options in PARTS.values():
        make(**({"n_jobs": n_jobs} if "--jobs" in options else {}))


ALL = {"paper": ("all of them", paper, JOBS)}
DESCRIPTION = """
The data behind the paper's figures, computed and kept in ``data/`` with its provenance.
File names and columns are those that the paper's own plots read. What has been computed is
kept in ``runs/``: a command that was stopped goes on where it was, and what is finished is
not repeated. Each training run writes its progress to ``log.txt`` in its folder there.
"""


def main() -> None:
    parser = argparse.ArgumentParser(COMMAND, description=DESCRIPTION)
    parts = parser.add_subparsers(dest="part", required=True, metavar="part")
    for name, (text, make, options) in (PARTS | ALL).items():
        defaults = argparse.ArgumentDefaultsHelpFormatter
        part = parts.add_parser(name, help=text, description=text, formatter_class=defaults)
        part.set_defaults(make=make)
        for option, details in options.items():
            part.add_argument(option, **details)
    chosen = vars(parser.parse_args())
    del chosen["part"]
    if chosen.get("n_jobs") == 0:
        parser.error("--jobs is 0; expected a number of processes, or -1 for one per core")
    chosen.pop("make")(**chosen)


if __name__ == "__main__":
    main()
