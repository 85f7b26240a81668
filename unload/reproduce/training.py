"""The paper's training in the container (Sec. IV-B), for Figs. 11 and 12.

Made by ``python -m unload.reproduce training``.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from unload import task
from unload.agent.config import TrainConfig
from unload.agent.evaluation import Policy, evaluate
from unload.agent.sweep import run_all
from unload.agent.training import TrainResult, train
from unload.agent.weights import save_policy
from unload.env.container import ContainerEnv
from unload.env.vector import ContainerVectorEnv
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.results import COMMAND, JOBS, publish, shared_settings, write_table
from unload.reproduce.verdict import end_msr
from unload.support import checks, files

SEEDS = (0, 1, 2, 3)
CONFIG = TrainConfig(log_interval=100)  # steps of all environments per point of the loss
EVALUATION = {"episodes": 50, "seed": 1000}  # fresh containers for the trained policies
ASK_EVERY = 25  # unloaded items between two questions for the favourite
MOST_PICKS = 100_000  # of an episode that is to end by unloading

OPTIONS = {
    "--picks": {"type": int, "default": CONFIG.picks},
    "--seeds": {"type": int, "nargs": "+", "default": SEEDS},
    **JOBS,
}


def training_data(
    picks: int = CONFIG.picks,
    seeds: Sequence[int] = SEEDS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Train the paper's configuration with several seeds; write curves, policies and a summary.

    Writes ``loss_function_agent.csv`` and ``total_rew_function_agent.csv`` with the columns
    ``Wall time,Step,Value`` of a TensorBoard export, the reward summed over an episode of
    500 picks; the same of the seeds after the first one, with ``_seed_<seed>`` after the
    name; the trained policies, ``policies/paper.safetensors`` and ``policies/paper_seed_<seed>``;
    ``training_curves.csv``, means over each episode of all environments; and
    ``training_summary.csv``, see ``training_summary``.

    Args:
        picks: K, at least one episode of all environments.
        seeds: of the runs; the first one is the paper's line in the figures.
        folder: of the data.
        runs_dir: where the runs are kept, apart from those of code that trained otherwise.
        n_jobs: processes, see ``run_sweep``.
        progress: show a progress bar.

    Raises:
        TypeError, ValueError: ``picks`` is not as described.
        RuntimeError: a run failed; the message says which and why.
    """
    checks.integer("picks", picks, task.NUM_ENVS * task.MAX_PICKS)
    fingerprint = training_fingerprint()
    folder, kept = Path(folder), runs_folder(runs_dir, fingerprint, picks)
    configs = {f"seed_{seed}": replace(CONFIG, picks=picks, seed=seed) for seed in seeds}
    records = run_all(configs, kept, n_jobs, progress)
    results = [train(config, kept / name) for name, config in configs.items()]
    for old in (*folder.glob("*_agent_seed_*.csv"), *folder.glob("policies/paper_seed_*")):
        old.unlink()  # it may be of a seed that is not among these
    for number, (seed, result) in enumerate(zip(seeds, results)):
        suffix = f"_seed_{seed}" if number else ""
        _write_export(folder / f"loss_function_agent{suffix}.csv", result.curve, "loss")
        episodes = episode_means(result.curve)
        episodes["reward"] = episodes["mean_reward"] * task.MAX_PICKS
        _write_export(folder / f"total_rew_function_agent{suffix}.csv", episodes, "reward")
        save_policy(result.policy, folder / "policies" / f"paper{suffix}.safetensors")
    columns = ["seed", "picks", "success_rate", "deadlocked", "loss", "epsilon"]
    curves = [episode_means(result.curve).assign(seed=seed) for seed, result in zip(seeds, results)]
    rows = [
        {"seed": seed, **training_summary(result), **_cost(record)}
        for seed, result, record in zip(seeds, results, records)
    ]
    tables = {"training_curves": pd.concat(curves)[columns], "training_summary": pd.DataFrame(rows)}
    settings = {
        "picks": picks,
        "seeds": list(seeds),
        "evaluation": EVALUATION,
        "config": shared_settings(configs),
    }
    command = f"{COMMAND} training --picks {picks} --seeds {' '.join(map(str, seeds))}"
    reduced = picks < CONFIG.picks
    publish(folder, "training", tables, command, settings, reduced, records, fingerprint)


def runs_folder(runs_dir: str | Path, fingerprint: str, picks: int) -> Path:
    """The folder of the training runs, each in ``seed_<seed>``."""
    return Path(runs_dir) / f"training/{fingerprint}/{picks}_picks"


def training_summary(result: TrainResult) -> dict[str, float]:
    """How a training run began and ended, and how its policy does on fresh containers.

    Returns:
        ``msr_start``, ``msr_end`` and ``msr_best``: the MSR while training over the first
        episode of all environments, the last tenth of the picks, and the best episode.
        ``msr_mask``, ``msr_no_mask``: the MSR of the trained policy on 50 fresh containers with
        and without the mask, each with its standard deviation over the containers, and the share
        of picks in deadlocks without the mask.
    """
    episodes = episode_means(result.curve)
    msr = episodes["success_rate"]
    row = {
        "msr_start": msr.iloc[0],
        "msr_end": end_msr(episodes),
        "msr_best": msr.max(),
    }
    for name, mask in (("mask", True), ("no_mask", False)):
        table = evaluate(result.policy, **EVALUATION, mask=mask)
        row[f"msr_{name}"] = table["success_rate"].mean()
        row[f"msr_{name}_std"] = table["success_rate"].std()
    return row | {"deadlocked_no_mask": table["deadlocked"].mean()}


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


def _write_export(path: Path, curve: pd.DataFrame, value: str) -> None:
    """A column of a curve as TensorBoard exports it."""
    names = {"wall_time": "Wall time", "picks": "Step", value: "Value"}
    write_table(path, curve[list(names)].rename(columns=names).dropna(), "%.12g")


def _cost(record: dict) -> dict:
    """Wall time and peak memory of a run."""
    return {name: record[name] for name in ("wall_time_s", "peak_memory_mib")}
