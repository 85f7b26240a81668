"""The command line: each experiment is a part, with the options that its module declares."""

import argparse
from collections.abc import Callable
from dataclasses import replace

from studies.falls import laboratory, long
from studies.heap import table
from studies.lifts import agreement, engines, lift_table
from studies.paper import training, tuning, visible_items
from studies.policies import comparison, robustness, variants
from studies.results import COMMAND, JOBS
from studies.seamless import jam_tables
from studies.seamless import training as seamless
from studies.ties import creep, leak
from studies.ties import laboratory as ties_laboratory
from studies.ties import training as ties
from unload.agent.config import TrainConfig
from unload.support import checks


def lifts(n_jobs: int) -> None:
    """Make the lift table, and ask the physics that it stands for about the same lifts."""
    lift_table.lift_data()
    agreement.agreement_data(n_jobs=n_jobs)


def policies(n_jobs: int) -> None:
    """Measure policies, and compare them by the lift table, and with every box simulated."""
    comparison.write_cards()
    comparison.comparison_data(n_jobs=n_jobs)
    robustness.robustness_data(n_jobs=n_jobs)


# Part → summary, what makes its data, and its options.
PARTS: dict[str, tuple[str, Callable, dict]] = {
    "lifts": ("the lift table, and the physics that it stands for", lifts, JOBS),
    "engines": ("lifts and MSRs by a second engine", engines.engines_data, JOBS),
    "observation": ("Figs. 4–6", visible_items.observation_data, {}),
    "tuning": ("Figs. 8–10", tuning.tuning_data, JOBS),
    "training": ("Figs. 11 and 12", training.training_data, training.OPTIONS),
    "variants": ("other networks and rewards", variants.variants_data, variants.OPTIONS),
    "policies": ("policies compared", policies, JOBS),
    "laboratory": (
        "why runs fall: the laboratory", laboratory.laboratory_data, laboratory.OPTIONS
    ),
    "fresh": ("why runs fall: fresh seeds", laboratory.fresh_data, JOBS),
    "jams": ("jams in seamless walls, every box simulated", jam_tables.both_data, JOBS),
    "seamless": ("seamless walls, in which boxes jam", seamless.seamless_data, seamless.OPTIONS),
    "creep": ("how long the order of equals lasts in PyBullet", creep.creep_data, JOBS),
    "leak": ("what ties by the items' order tell a network", leak.leak_data, JOBS),
    "ties_laboratory": (
        "how long an order of equals lasts: the laboratory",
        ties_laboratory.laboratory_data, ties_laboratory.OPTIONS,
    ),
    "ties": ("how equal coordinates are ranked", ties.ties_data, ties.OPTIONS),
    "falls": ("why runs fall: the long runs", long.falls_data, long.OPTIONS),
    "heap": ("heaps, of which a rake picks several boxes at once", table.heap_data, JOBS),
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
    try:
        check(chosen)
    except ValueError as error:
        parser.error(str(error))
    chosen.pop("make")(**chosen)


def check(chosen: dict) -> None:
    """Raise a ValueError for a number that no part can run with, before anything starts."""
    if chosen.get("n_jobs") == 0:
        raise ValueError("--jobs is 0; expected a number of processes, or -1 for one per core")
    if chosen.get("seeds") is not None:
        checks.integer("--seeds", chosen["seeds"], 1)
    if chosen.get("picks") is not None:
        replace(TrainConfig(), picks=chosen["picks"])


if __name__ == "__main__":
    main()
