"""What the parts take: lifts and picks per second, milliseconds per update; figures of speed."""

import timeit
from collections.abc import Callable, Mapping
from unittest import mock

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from matplotlib.figure import Figure

import unload
from studies.style import styled
from unload import task
from unload.agent import learner
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.situation import Surroundings
from unload.physics.table import TablePhysics

CONTAINER = "unload/Container-v0"
ROUNDS = 4  # of each call that are timed
LIFTS = {"full": 2, "local": 100, "table": 100}  # of a round; each of full takes seconds
NUM_ENVS, PICKS = task.NUM_ENVS, task.MAX_PICKS  # of the containers that are many; of an episode
BATCH_SIZE, N_FEATURES = 2048, 64  # of an update
CACHES = 1, 10  # MB that a processor's caches hold


def three_digits(value: float) -> str:
    """A positive number rounded to three digits, without a power of ten: 1,230,000."""
    return f"{float(f'{value:.3g}'):,.10g}"


def best_times(calls: Mapping[str, Callable[[], object]]) -> dict[str, float]:
    """The least wall time of each call, in s; the first round does not count.

    All are made in turn, so that whatever else the machine does meets all of them alike. The least
    time is that of the round which was disturbed least.
    """
    rounds = [
        {name: timeit.timeit(call, number=1) for name, call in calls.items()}
        for _ in range(1 + ROUNDS)
    ]
    return {name: min(times[name] for times in rounds[1:]) for name in calls}


def lift_rates(load: unload.Load) -> dict[str, float]:
    """Lifts per second in a full container, all known to the table, by physics."""
    items = np.random.default_rng(0).permutation(len(load)).tolist()
    full, local, table = FullPhysics(), LocalPhysics(), TablePhysics()
    full.reset(load)
    situation = Surroundings(load, np.ones(len(load), bool)).situation
    lift = {
        "full": full.lift,
        "local": lambda item: local.simulate(situation(item)),
        "table": lambda item: table.simulate(situation(item)),
    }
    times = best_times(
        {name: lambda name=name: list(map(lift[name], items[: LIFTS[name]])) for name in LIFTS}
    )
    return {name: LIFTS[name] / seconds for name, seconds in times.items()}


def pick_rates() -> dict[str, float]:
    """Random picks per second of one container, and of many in a loop and in arrays.

    The same episodes are played in each round, all but for their last pick, so that each
    pick carries its share of one reset; after the first round the table knows all lifts.

    Returns:
        By environment.
    """

    def one(physics: str) -> gymnasium.Env:
        return gymnasium.make(CONTAINER, physics=physics, max_picks=PICKS)

    def loop(physics: str) -> SyncVectorEnv:
        makers = [lambda: one(physics)] * NUM_ENVS
        return SyncVectorEnv(makers, autoreset_mode=AutoresetMode.SAME_STEP)

    def arrays(equalize: bool) -> VectorEnv:
        return gymnasium.make_vec(CONTAINER, NUM_ENVS, max_picks=PICKS, equalize=equalize)

    # From the plain to the fast: a row each of the table.
    envs = {
        "one container, local": one("local"),
        "one container, table": one("table"),
        f"{NUM_ENVS} containers in a loop, table": loop("table"),
        f"{NUM_ENVS} in arrays": arrays(False),
        f"{NUM_ENVS} in arrays, equalized": arrays(True),
    }
    counts = {name: (PICKS - 1) * getattr(env, "num_envs", 1) for name, env in envs.items()}
    times = best_times({name: _episode(env) for name, env in envs.items()})
    return {name: counts[name] / seconds for name, seconds in times.items()}


def _episode(env: gymnasium.Env | VectorEnv) -> Callable[[], None]:
    shape = (PICKS - 1, getattr(env, "num_envs", 1))
    actions = np.random.default_rng(0).integers(task.N_VISIBLE, size=shape)
    if not isinstance(env, VectorEnv):
        actions = actions[:, 0].tolist()

    def play() -> None:
        env.reset(seed=0)
        for action in actions:
            env.step(action)

    return play


def update_times() -> dict[str, float]:
    """Time of one ``DQN.update``: gradients of a batch, and a step of Adam.

    Returns:
        ms, by how it is done.
    """
    rng = np.random.default_rng(0)
    batch = {
        "observations": rng.uniform(-1, 1, (BATCH_SIZE, task.N_VISIBLE, 3)).astype(np.float32),
        "actions": rng.integers(task.N_VISIBLE, size=BATCH_SIZE),
        "rewards": rng.choice(np.array([-1, 1], np.float32), BATCH_SIZE),
    }

    # Each way has an agent of its own, so that all take the same steps from the same weights.
    def update(fused: bool, threads: int, rows: int = learner.ROWS_PER_PASS) -> Callable:
        network = unload.PEQNetwork(N_FEATURES, torch.Generator().manual_seed(0))
        agent = unload.DQN(network, fused_update=fused)

        def call() -> float:
            torch.set_num_threads(threads)
            with mock.patch.object(learner, "ROWS_PER_PASS", rows):
                return agent.update(batch)

        return call

    times = best_times(
        {
            "PyTorch, whole batch": update(False, 1, BATCH_SIZE),
            f"PyTorch, chunks of {learner.ROWS_PER_PASS}": update(False, 1),
            "fused": update(True, 1),
            "fused, 2 threads": update(True, 2),
        }
    )
    torch.set_num_threads(1)
    return {name: seconds * 1e3 for name, seconds in times.items()}


@styled
def layers(samples: int, n_features: int) -> Figure:
    """What each layer of an update by PyTorch stores of so many samples, in MB."""
    numbers = {
        "observations": 3,
        "features": n_features,
        "after the ReLU": n_features,
        "beside the pooled ones": 4 * n_features,
        "values": 1,
    }
    megabytes = pd.Series(numbers) * samples * task.N_VISIBLE * 4 / 1e6
    figure, axes = plt.subplots(figsize=(5.6, 2.4))
    bars = axes.barh(list(numbers), megabytes)
    axes.bar_label(bars, [f" {each:.3g}" for each in megabytes])
    axes.set(xscale="log", xlabel="MB", xlim=(1e-3, 1e4), title=f"{megabytes.sum():.3g} MB in all")
    axes.axvspan(*CACHES, color="0.9", zorder=0)
    return figure


@styled
def benchmarks(table: pd.DataFrame) -> Figure:
    """The rows of ``data/speeds.csv`` as bars: a panel a kind, beside the first way of its kind."""
    groups = table.groupby("what", sort=False)
    sizes = [len(group) for _, group in groups]
    figure, panels = plt.subplots(
        len(sizes), 1, figsize=(6.4, 0.34 * sum(sizes) + 0.5 * len(sizes)), sharex=True,
        height_ratios=[size + 0.6 for size in sizes],
    )  # fmt: skip
    for number, (axes, (what, group)) in enumerate(zip(panels, groups)):
        axes.barh(range(len(group)), group["ratio"], color=f"C{number}")
        for place, row in enumerate(group.itertuples()):
            text = f"{three_digits(row.value)} {row.unit}"
            axes.text(max(row.ratio, 1) * 1.15, place, text, va="center", fontsize=8)
        axes.set_yticks(range(len(group)), group["how"], fontsize=8)
        axes.set(xscale="log", ylim=(len(group) - 0.4, -0.6))
        axes.set(xlim=(0.5 * min(1, table["ratio"].min()), 20 * table["ratio"].max()))
        axes.set_title(what, loc="left", fontsize=9)
        axes.minorticks_off()
        axes.grid(False, axis="y")
    axes.set_xlabel("times as fast as the first way of its kind")
    return figure
