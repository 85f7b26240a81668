"""How fast the parts are: measured, printed and kept in data/benchmarks.

    python benchmarks/run.py            all, in about seven minutes
    python benchmarks/run.py --quick    at reduced size, within a minute; nothing is kept

Absolute times depend on the machine and on what else it does; the ratios, each to the
first row of its kind and all of one run, say more. All is on one thread unless said.
"""

import argparse
import sys
import time
from datetime import date
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
import torch

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # where benchmarks/ is found

import unload
from benchmarks.environments import container_costs, pick_rates
from benchmarks.lifts import fill_rates, lift_rates
from benchmarks.profile_step import step_profile
from benchmarks.training import training_rates
from benchmarks.updates import update_times
from unload.reproduce.figures.speed import FOLDER, three_digits
from unload.reproduce.results import publish
from unload.support.provenance import run_record

COMMAND = "python benchmarks/run.py"


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
        ("fill the full simulation", "containers/s", partial(fill_rates, load), {"rounds": 1}),
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


def measure(quick: bool = False) -> dict[str, pd.DataFrame]:
    """All tables by name: ``speeds``, ``containers`` and ``profile``."""
    tables = {"speeds": speeds(quick)}
    print("measuring: 1 to 4096 containers …", file=sys.stderr, flush=True)
    small = {"counts": (1, 4), "picks": 20, "rounds": 1} if quick else {}
    tables["containers"] = container_costs(**small)
    print("measuring: the parts of a training step …", file=sys.stderr, flush=True)
    tables["profile"] = step_profile(**({"picks": 12_800} if quick else {}))
    return tables


def show(tables: dict[str, pd.DataFrame]) -> None:
    """Print the tables."""
    numbers = {"value": three_digits, "ratio": lambda ratio: f"{three_digits(ratio)} ×"}
    for name, table in tables.items():
        text = table.to_string(index=False, formatters=numbers, float_format="{:,.1f}".format)
        print(f"\n{name}\n{text}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="measure less and keep nothing")
    options = parser.parse_args()
    torch.set_num_threads(1)
    start = time.monotonic()
    tables = measure(options.quick)
    show(tables)
    if options.quick:
        return
    settings = {"date": date.today().isoformat(), "stable-baselines3": version("stable-baselines3")}
    record = run_record(time.monotonic() - start)
    publish(FOLDER, "benchmarks", tables, COMMAND, settings, False, [record])


if __name__ == "__main__":
    main()
