"""How fast the parts are: measured, printed and kept in data/benchmarks.

    python -m studies.speed.run            in about five minutes

Absolute times depend on the machine and on what else it does; the ratios, each to the
first row of its kind and all of one run, say more. All is on one thread unless said.
"""

import sys
from datetime import date
from functools import partial
from importlib.metadata import version

import numpy as np
import pandas as pd
import torch

import unload
from studies.results import measured, publish
from studies.speed.parts import FOLDER, lift_rates, pick_rates, three_digits, update_times
from studies.speed.training import training_rates

COMMAND = "python -m studies.speed.run"


def speeds() -> pd.DataFrame:
    """The speeds of all parts.

    Returns:
        One row per way of doing a thing: ``what``, ``how``, ``value``, ``unit``, and
        ``ratio``, how many times as fast as the first way.
    """
    parts = (
        ("lifts", "lifts/s", partial(lift_rates, unload.stack_load(np.random.default_rng(0)))),
        ("random picks", "picks/s", pick_rates),
        ("update, b = 2048, n = 64", "ms", update_times),
        ("training", "picks/s", training_rates),
    )
    rows = []
    for what, unit, measure in parts:
        print(f"measuring: {what} …", file=sys.stderr, flush=True)
        values = measure()
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
    torch.set_num_threads(1)
    result = measured(speeds)
    show(result.value)
    settings = {"date": date.today().isoformat(), "stable-baselines3": version("stable-baselines3")}
    publish(FOLDER, "benchmarks", {"speeds": result.value}, COMMAND, settings, [result])


if __name__ == "__main__":
    main()
