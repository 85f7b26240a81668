"""How fast the parts are: measured, printed and kept in ``data/speeds.csv``.

    python -m studies.speed.run            in about seven minutes

Absolute times depend on the machine and on what else it does; the ratios, each to the
first row of its kind and all of one run, say more. All is on one thread unless said.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from datetime import date
from functools import partial
from importlib.metadata import version
from unittest import mock

import numpy as np
import pandas as pd
import torch

import unload
from studies.lifts.own_loads import FAMILIES
from studies.policies.sb3 import containers, dqn
from studies.results import measured, publish
from studies.speed.parts import lift_rates, pick_rates, three_digits, update_times
from unload import task
from unload.fast import fused

COMMAND = "python -m studies.speed.run"
# Picks that count, of ours with the fused update, of ours with plain PyTorch's, and of theirs.
FUSED, PLAIN, THEIRS = 256_000, 3_200, 960
NEW = 25_600  # of ours on loads that never repeat, with as many before that do not count
WHOLE, ROUNDS = 64_000, 2  # picks of a whole training, and how many there are by each kind of load
THREADS = {1: "1 thread", 2: "2 threads"}


def training_rates() -> dict[str, float]:
    """Picks per second in the paper's configuration, from end to end, by who trains and how.

    Both train the same network on the same 64 containers, with one update per 64 picks on
    a batch of 2048, as soon as there are 2048 picks to learn from; the picks before that
    do not count. With the fused update, those before the replay memory is full do not count,
    either: what the system takes to hand out the memory is nothing beside the paper's 20
    million picks. Exploration falls over the picks made here as it does in the paper. Ours is
    the median over episodes, theirs over steps: what else runs on the machine stalls a few.

    Last are loads that never repeat (``new_load``), so that PyBullet simulates the lifts of boxes
    with one or two others on top, and random picks, which meet most of these.
    """
    rates = {}
    for threads, name in THREADS.items():
        rates[f"Stable-Baselines3, {name}"] = _their_rate(THEIRS, threads)
    with mock.patch.object(fused, "applies", return_value=False):
        rates["here, PyTorch's update, 1 thread"] = _our_rate(PLAIN, 1, before=PLAIN)
    memory = unload.TrainConfig().replay_size
    for threads, name in THREADS.items():
        rates[f"here, fused update, {name}"] = _our_rate(FUSED, threads, before=memory)
    name = "here, random picks in new loads"
    rates[name] = _our_rate(NEW, 2, NEW, new_load, epsilon_final=1.0)
    torch.set_num_threads(1)
    return rates


def load_rates() -> dict[str, float]:
    """Picks per second of the processor's time in whole trainings at b = 256, by their loads.

    One thread. The families never repeat a load, so PyBullet simulates what no rule answers. All
    take turns, in each round with other seeds, and the fastest round counts.
    """
    stacks: dict[str, Callable | None] = {"the paper's": None, **FAMILIES}
    torch.set_num_threads(1)
    seconds: dict[str, list[float]] = {name: [] for name in stacks}
    for seed in range(ROUNDS):
        config = unload.TrainConfig(picks=WHOLE, batch_size=256, seed=seed)
        for name, stack in stacks.items():
            with tempfile.TemporaryDirectory() as folder:
                start = time.process_time()
                unload.train(config, folder, progress=False, stack=stack)
                seconds[name].append(time.process_time() - start)
    return {name: WHOLE / min(each) for name, each in seconds.items()}


def new_load(rng: np.random.Generator) -> unload.Load:
    """672 boxes, each of a size of its own: 12 walls of 7 columns of 8 boxes."""
    length, width, height = task.CONTAINER
    sizes = np.full((12, 7, 8, 3), length / 12)
    sizes[..., 1] = width * rng.dirichlet(np.full(7, 20.0), 12)[..., np.newaxis]
    sizes[..., 2] = 0.95 * height * rng.dirichlet(np.full(8, 20.0), (12, 7))
    ends = [sizes[..., axis].cumsum(axis=axis) for axis in range(3)]
    corners = np.stack(ends, axis=-1) - sizes
    return unload.Load((corners + sizes / 2).reshape(-1, 3), sizes.reshape(-1, 3))


def _our_rate(
    picks: int, threads: int, before: int, stack: Callable | None = None, **fields
) -> float:
    torch.set_num_threads(threads)
    steps = picks // unload.TrainConfig().num_envs
    config = unload.TrainConfig(picks=picks + before, log_interval=min(10, steps), **fields)
    with tempfile.TemporaryDirectory() as folder:
        curve = unload.train(config, folder, progress=False, stack=stack).curve
    times = curve.loc[curve["picks"] >= before, "wall_time"].to_numpy()
    episode = min(config.max_picks // config.log_interval, len(times) - 1)  # points of the curve
    seconds = np.median(times[episode:] - times[:-episode])
    return episode * config.log_interval * config.num_envs / float(seconds)


def _their_rate(picks: int, threads: int) -> float:
    torch.set_num_threads(threads)
    config = unload.TrainConfig()
    model = dqn(config, containers(config))
    times: list[float] = []
    warm = config.batch_size + 2 * config.num_envs  # two updates do not count
    model.learn(warm + picks, lambda *_: times.append(time.perf_counter()) is None)
    steps = np.diff(times)[-(picks // config.num_envs) :]
    return config.num_envs / float(np.median(steps))


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
        ("training at b = 256, by loads", "picks/s", load_rates),
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


def main() -> None:
    torch.set_num_threads(1)
    result = measured(speeds)
    numbers = {"value": three_digits, "ratio": lambda ratio: f"{three_digits(ratio)} ×"}
    print(result.value.to_string(index=False, formatters=numbers))
    settings = {"date": date.today().isoformat(), "stable-baselines3": version("stable-baselines3")}
    publish("speeds", {"speeds": result.value}, COMMAND, settings, [result])


if __name__ == "__main__":
    main()
