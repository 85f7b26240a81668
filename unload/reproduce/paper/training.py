"""The paper's training in the container (Sec. IV-B), for Figs. 11 and 12, and its policies.

python -m unload.reproduce training
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from unload import task
from unload.agent.checkpoint import RunFolder
from unload.agent.evaluation import Policy, evaluate
from unload.agent.greedy import Greedy, save_policy
from unload.env.container import ContainerEnv
from unload.env.vector import ContainerVectorEnv
from unload.reproduce.grid import read_grid, read_policies, train_grid
from unload.reproduce.paper.grids import DEFAULT_SEEDS, DEFAULTS, PAPER
from unload.reproduce.results import JOBS, write_table
from unload.reproduce.statistics import end_msr
from unload.support import checks, files

EVALUATION = {"episodes": 50, "seed": 1000}  # fresh containers for the trained policies
ASK_EVERY = 25  # unloaded items between two questions for the favourite
PLAYERS = {0: "paper", 2: "paper_seed_2", 3: "paper_seed_3"}  # policies that play elsewhere
MOST_PICKS = 100_000  # of an episode that is to end by unloading
OPTIONS = {
    "--cells": {"nargs": "+", "choices": PAPER.cells},
    "--picks": {"type": int, "help": "of a run, if not the paper's; the data go to data/reduced"},
    **JOBS,
}


def training_data(
    cells: Sequence[str] | None = None,
    picks: int | None = None,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
    shipped: str | Path = files.SHIPPED,
) -> None:
    """Train the paper's configuration, see ``train_grid``, and write some of it by other names.

    These are what the paper's plots read and, in the folder ``shipped``, the policies that play
    elsewhere: ``policies/paper.safetensors`` and ``policies/paper_seed_<seed>.safetensors``.
    """
    kept = train_grid(PAPER, cells, picks, folder, runs_dir, n_jobs, progress)
    if picks is None and (cells is None or DEFAULTS in cells):
        config = replace(PAPER.cells[DEFAULTS].config, seed=DEFAULT_SEEDS[0])
        run = RunFolder(kept / DEFAULTS / f"seed_{config.seed}")
        export_training(run.result(config).curve, folder)
        for seed, name in PLAYERS.items():
            policy = default_policies(folder)[seed]
            save_policy(policy, Path(shipped) / "policies" / f"{name}.safetensors")


def export_training(curve: pd.DataFrame, folder: str | Path) -> None:
    """Write a run as TensorBoard exports it: columns ``Wall time``, ``Step`` and ``Value``.

    ``loss_function_agent.csv`` has the loss, ``total_rew_function_agent.csv`` the rewards summed
    over an episode of 500 picks, a mean over the environments.
    """
    episodes = episode_means(curve)
    episodes["reward"] = episodes["mean_reward"] * task.MAX_PICKS
    for name, points, value in (
        ("loss_function_agent", curve, "loss"),
        ("total_rew_function_agent", episodes, "reward"),
    ):
        columns = {"wall_time": "Wall time", "picks": "Step", value: "Value"}
        table = points[list(columns)].rename(columns=columns).dropna()
        write_table(Path(folder) / f"{name}.csv", table, "%.12g")


def default_curves(folder: str | Path = files.DATA) -> dict[int, pd.DataFrame]:
    """The published curves of the paper's configuration that the figures show, by their seeds.

    Each point is a mean over an episode of all environments; they are indexed by ``picks``.
    """
    curves = read_grid(PAPER, folder, [DEFAULTS])
    return {
        seed: curves[curves["seed"] == seed].set_index("picks", drop=False)
        for seed in DEFAULT_SEEDS
    }


def default_policies(folder: str | Path = files.DATA) -> dict[int, Greedy]:
    """The policies that these runs have learned, by their seeds."""
    policies = read_policies(Path(folder) / f"{PAPER.name}.safetensors")
    return {seed: policies[f"{DEFAULTS}/seed_{seed}"] for seed in DEFAULT_SEEDS}


def while_training(folder: str | Path = files.DATA) -> pd.DataFrame:
    """How these runs began and ended, a row per seed.

    Returns:
        ``msr_start``, ``msr_end`` and ``msr_best``: the MSR while training over the first episode
        of all environments, the last tenth of the picks, and the best episode.
    """
    rows = {}
    for seed, curve in default_curves(folder).items():
        msr = curve["success_rate"]
        rows[seed] = {
            "msr_start": msr.iloc[0], "msr_end": end_msr(curve), "msr_best": msr.max()
        }  # fmt: skip
    return pd.DataFrame(rows).T.rename_axis("seed")


def in_fresh_containers(folder: str | Path = files.DATA) -> pd.DataFrame:
    """How the policies of these runs do in 50 fresh containers, a row per seed.

    Returns:
        ``msr_mask``, ``msr_no_mask``: the MSR with and without the mask, each with its standard
        deviation over the containers; ``deadlocked_no_mask``: the share of picks in deadlocks
        without the mask.
    """
    rows = {}
    for seed, policy in default_policies(folder).items():
        row = rows.setdefault(seed, {})
        ready = Greedy(policy.network, equalize=False)  # the environment equalizes: it is faster
        for name, mask in (("mask", True), ("no_mask", False)):
            table = evaluate(ready, mask=mask, equalize=policy.equalize, **EVALUATION)
            row[f"msr_{name}"] = table["success_rate"].mean()
            row[f"msr_{name}_std"] = table["success_rate"].std()
        row["deadlocked_no_mask"] = table["deadlocked"].mean()
    return pd.DataFrame(rows).T.rename_axis("seed")


def episode_means(curve: pd.DataFrame) -> pd.DataFrame:
    """Means of a learning curve over each complete episode of the 64 containers.

    All containers are reset together, every 32,000 picks, and full ones, in which there is no
    deadlock yet, are easier. Means over less than an episode therefore rise at every reset.

    Args:
        curve: of ``unload.train`` in 64 containers, with a ``log_interval`` that divides 500.

    Returns:
        One row per episode with the columns of ``curve``; ``picks``, ``wall_time`` and
        ``epsilon`` are those at its end.

    Raises:
        ValueError: a point of the curve lies in two episodes.
    """
    length = task.NUM_ENVS * task.MAX_PICKS
    episode = ((curve["picks"] - 1) // length).rename("episode")
    groups = curve[curve["picks"] <= curve["picks"].max() // length * length].groupby(episode)
    ends = groups[["picks", "wall_time", "epsilon"]].last()
    if (ends["picks"] % length).any():
        raise ValueError(
            f"curve has points after {curve['picks'].iloc[0]:,} picks each; "
            f"expected a divisor of the {length:,} picks of an episode"
        )
    return groups.mean().assign(**ends)


def msr_by_pick(
    policy: Policy, containers: int = task.NUM_ENVS, seed: int = 0, mask: bool = True
) -> np.ndarray:
    """The MSR at each pick of an episode, over containers that are filled together.

    Args:
        policy: see ``unload.policies``.
        containers: how many.
        seed: of the loads and of the policy's random numbers.
        mask: whether the policy's masks exclude items that failed since the last success.

    Returns:
        (500,) float64, the share of the containers in which the pick succeeded.
    """
    envs = ContainerVectorEnv(checks.integer("containers", containers, 1))
    rng = np.random.default_rng(seed)
    observations, infos = envs.reset(seed=seed)
    msr = np.empty(task.MAX_PICKS)
    for pick in range(task.MAX_PICKS):
        masks = infos["action_mask" if mask else "item_mask"]
        observations, rewards, _, _, infos = envs.step(policy(observations, masks, rng))
        msr[pick] = (rewards > 0).mean()
    envs.close()
    return msr


def favourites(
    policy: Policy, player: Policy, containers: int = 10, seed: int = 0, unloaded: int = 400
) -> np.ndarray:
    """Whether a policy's favourite item can be lifted in containers that a player unloads.

    Args:
        policy: is asked for its favourite, at the start and after every 25 unloaded items.
        player: unloads the containers, with the mask; it may be the policy itself.
        containers: how many.
        seed: of the first load and of the random numbers.
        unloaded: items that the player unloads from each container.

    Returns:
        (containers, unloaded / 25 + 1) bool.
    """
    checks.integer("containers", containers, 1)
    checks.integer("unloaded", unloaded, 1)
    env = ContainerEnv(physics="table", max_picks=MOST_PICKS)
    rng = np.random.default_rng(seed)
    found = []
    for container in range(containers):
        observation, info = env.reset(seed=seed + container)
        asked: list[bool] = []
        while len(asked) <= unloaded // ASK_EVERY:
            if info["unloaded"] == len(asked) * ASK_EVERY:
                favourite = policy(observation[None], info["item_mask"][None], rng)[0]
                asked.append(bool(env.liftable()[favourite]))
            action = player(observation[None], info["action_mask"][None], rng)[0]
            observation, *_, info = env.step(int(action))
        found.append(asked)
    env.close()
    return np.array(found)
