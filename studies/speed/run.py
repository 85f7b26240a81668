"""How fast the parts are: measured, printed and kept in data/benchmarks.

    python -m studies.speed.run            all, in about five minutes
    python -m studies.speed.run --quick    at reduced size, within a minute; nothing is kept

Absolute times depend on the machine and on what else it does; the ratios, each to the
first row of its kind and all of one run, say more. All is on one thread unless said.
"""

import argparse
import sys
from datetime import date
from functools import partial
from importlib.metadata import version

import numpy as np
import pandas as pd
import torch

import unload
from studies.results import measured, publish
from studies.speed.environments import lift_rates, pick_rates
from studies.speed.figures import FOLDER, three_digits
from studies.speed.training import training_rates
from studies.speed.updates import update_times

COMMAND = "python -m studies.speed.run"


def speeds(quick: bool = False) -> pd.DataFrame:
    """The speeds of all parts.

    Args:
        quick: measure less, to see that all works.

    Returns:
        One row per way of doing a thing: ``what``, ``how``, ``value``, ``unit``, and
        ``ratio``, how many times as fast as the first way.
    """
    load = unload.stack_load(np.random.default_rng(0), *([1] if quick else []))
    batch_size = 128 if quick else 2048
    update = f"update, b = {batch_size}, n = 64"
    few = {"ours": 6400, "memory": 3200, "plain": 128, "before": 2304, "theirs": 64}
    parts = (  # what, unit, how it is measured, and what changes at reduced size
        ("lifts", "lifts/s", partial(lift_rates, load), {"full": 1, "others": 5, "rounds": 1}),
        ("random picks", "picks/s", pick_rates, {"num_envs": 2, "picks": 20, "rounds": 1}),
        (update, "ms", partial(update_times, batch_size), {"rounds": 1}),
        ("training", "picks/s", training_rates, few),
    )
    rows = []
    for what, unit, measure, small in parts:
        print(f"measuring: {what} …", file=sys.stderr, flush=True)
        values = measure(**(small if quick else {}))
        first = next(iter(values.values()))
        for how, value in values.items():
            ratio = first / value if unit == "ms" else value / first
            rows.append({"what": what, "how": how, "value": value, "unit": unit, "ratio": ratio})
    return pd.DataFrame(rows)


def show(table: pd.DataFrame) -> None:
    """Print the speeds, and their ratios to the first of each kind."""
    numbers = {"value": three_digits, "ratio": lambda ratio: f"{three_digits(ratio)} ×"}
    print(table.to_string(index=False, formatters=numbers))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="measure less and keep nothing")
    options = parser.parse_args()
    torch.set_num_threads(1)
    result = measured(partial(speeds, options.quick))
    show(result.value)
    if options.quick:
        return
    settings = {"date": date.today().isoformat(), "stable-baselines3": version("stable-baselines3")}
    publish(FOLDER, "benchmarks", {"speeds": result.value}, COMMAND, settings, [result])


if __name__ == "__main__":
    main()
