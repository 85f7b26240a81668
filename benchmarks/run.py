"""How fast the parts are: one table, in about two minutes.

    python benchmarks/run.py

Absolute times depend on the machine and on what else it does; the ratios say more. Each
figure is the median of a few runs in this process, on one thread.
"""

import time
from collections.abc import Callable

import numpy as np
import pandas as pd
import torch

import unload
from unload.agent import DQN
from unload.lift_table import LiftTable
from unload.physics import FullPhysics, LocalPhysics, Physics, TablePhysics

BATCH, ITEMS, FEATURES = 2048, 128, 64


def seconds(call: Callable[..., object], *arguments: object, repeats: int = 5) -> float:
    """Median wall time of a call, after one that is not counted."""
    call(*arguments)
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call(*arguments)
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def lift_all(physics: Physics, items: list[int]) -> None:
    for item in items:
        physics.lift(item)


def lifts(load: unload.Load, items: list[int]) -> dict[str, float]:
    """Lifts per second of each physics, on the same items of the same full container."""
    rates = {}
    table = TablePhysics(LiftTable())
    for name, physics, count in (
        ("full", FullPhysics(), 3),
        ("local", LocalPhysics(), len(items)),
        ("table", table, len(items)),
    ):
        physics.reset(load)
        chosen = items[:count]
        rates[name] = count / seconds(lift_all, physics, chosen, repeats=3)
        physics.close()
    return rates


def updates(rng: np.random.Generator) -> dict[str, float]:
    """Updates per second of a batch of 2048, plain and fused."""
    batch = {
        "observations": rng.uniform(-1, 1, (BATCH, ITEMS, 3)).astype(np.float32),
        "actions": rng.integers(ITEMS, size=BATCH),
        "rewards": rng.choice(np.array([-1, 1], np.float32), BATCH),
    }
    rates = {}
    for name, fused in (("plain", False), ("fused", True)):
        network = unload.PEQNetwork(FEATURES, torch.Generator().manual_seed(0))
        agent = DQN(network, fused_update=fused)
        rates[name] = 1 / seconds(agent.update, batch)
    return rates


def resets(load: unload.Load) -> dict[str, float]:
    """Full containers per second: all boxes created anew, and moved."""

    def build() -> None:
        physics = FullPhysics()
        physics.reset(load)
        physics.close()

    physics = FullPhysics()
    physics.reset(load)
    rates = {
        "created anew": 1 / seconds(build),
        "moved at reset": 1 / seconds(physics.reset, load),
    }
    physics.close()
    return rates


def picks() -> dict[str, float]:
    """Picks per second of random episodes, the lifts known or not."""

    def play(physics: str) -> None:
        unload.evaluate(unload.policies.random, 1, physics=physics, max_picks=100)

    return {physics: 100 / seconds(play, physics, repeats=3) for physics in ("local", "table")}


def main() -> None:
    torch.set_num_threads(1)
    rng = np.random.default_rng(0)
    load = unload.stack_load(rng)
    items = rng.permutation(len(load))[:60].tolist()
    rows = []
    for what, unit, rates in (
        ("lifts", "1/s", lifts(load, items)),
        ("fill a full container", "1/s", resets(load)),
        ("picks of an environment", "1/s", picks()),
        ("updates, batch 2048, n = 64", "1/s", updates(rng)),
    ):
        slowest = min(rates.values())
        for name, rate in rates.items():
            rows.append((what, name, f"{rate:,.4g} {unit}", f"{rate / slowest:,.3g} ×"))
    print(pd.DataFrame(rows, columns=["what", "how", "rate", "ratio"]).to_string(index=False))


if __name__ == "__main__":
    main()
