"""Policies on the same unseen heaps: table, conditions, and throughput against falls.

    python -m unload.reproduce heap-rules     # data/heap/rules.csv: the family on training heaps
    python -m unload.reproduce heap-table     # data/heap/{episodes,table}.csv

Each episode is kept in ``runs/heap``: a command that was stopped goes on. All policies of a
condition play the same heaps, so that differences are those of pairs.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from unload.heap.env import MAX_PICKS, HeapEnv
from unload.heap.episodes import Oracle, play
from unload.heap.learning import Learned, load_network
from unload.heap.rake import PHYSICS as PHYSICS_KINDS
from unload.heap.rules import RULES, best, family, linear
from unload.reproduce.heap import HEAPS, NAME
from unload.reproduce.heap_learning import (
    ROUNDS,
    VARIANTS,
    WEIGHTS,
    network_paths,
    weights_digest,
)
from unload.reproduce.intervals import bootstrap_interval
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish
from unload.support import checks, files

RULE_HEAPS = 10  # training heaps on which the family is compared
RULE_PHYSICS = "near"  # 71 rules are many
PHYSICS = "whole"
# Arguments of HeapEnv; networks never trained on any but the first.
CONDITIONS: dict[str, dict] = {
    "as trained": {},
    "camera": {"observation": "camera"},
    "friction 0.35": {"friction": 0.35},
    "friction 0.7": {"friction": 0.7},
    "mass 2 kg": {"mass": 2.0},
}
REFERENCE = "best rule"
SHOWN_WEIGHT = 1.0  # λ of the table
MEASURES = "boxes", "falls", "net"


def rules_data(
    heaps: int = RULE_HEAPS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """Play every rule of the family on training heaps; write ``heap/rules.csv``.

    Returns:
        One row per rule: ``rule``, ``boxes`` and ``falls`` per pick.
    """
    checks.integer("heaps", heaps, 1, HEAPS["train"])
    jobs = [
        _job({"linear": weights}, {}, "train", number, RULE_PHYSICS, runs_dir)
        for weights in family().values()
        for number in range(heaps)
    ]
    answers = keep_all(Path(runs_dir) / NAME / "episodes", jobs, n_jobs, progress)
    rows = []
    for place, name in enumerate(family()):
        of = [answer.value for answer in answers[place * heaps : (place + 1) * heaps]]
        means = {part: np.mean([np.mean(one[part]) for one in of]) for part in ("boxes", "falls")}
        rows.append({"rule": name} | means)
    frame = pd.DataFrame(rows)
    settings = {"heaps": heaps, "split": "train", "physics": RULE_PHYSICS, "picks": MAX_PICKS}
    records = [answer.record for answer in answers]
    command, reduced = f"{COMMAND} heap-rules --heaps {heaps}", heaps < RULE_HEAPS
    publish(Path(folder) / NAME, "rules", {"rules": frame}, command, settings, reduced, records)
    return frame


def best_rule(rules: pd.DataFrame, falls_weight: float) -> str:
    """The rule with the most boxes - λ falls."""
    return rules["rule"][(rules["boxes"] - falls_weight * rules["falls"]).idxmax()]


def players(
    rules: pd.DataFrame,
    falls_weight: float,
    variants: Sequence[tuple[str, float]] = VARIANTS,
    round_number: int = ROUNDS - 1,
    runs_dir: str | Path = files.RUNS,
    oracle: bool = True,
) -> dict[str, dict]:
    """Specifications of the policies to compare at a λ, by name, see ``make_policy``.

    The learned ones average the networks of all seeds; the recommended variant's single
    networks are there too.
    """
    chosen = {name: {"rule": name} for name in RULES}
    chosen[REFERENCE] = {"linear": family()[best_rule(rules, falls_weight)]}
    for kind, gamma in variants:
        paths = [str(path) for path in network_paths(round_number, kind, gamma, runs_dir)]
        name = f"learned {kind} γ={gamma:g}"
        chosen[name] = {"networks": paths, "falls_weight": falls_weight}
        if (kind, gamma) == VARIANTS[0]:
            for seed, path in enumerate(paths):
                one = {"networks": [path], "falls_weight": falls_weight}
                chosen[f"{name} seed {seed}"] = one
    if oracle:
        chosen["oracle"] = {"oracle": falls_weight}
    return chosen


def make_policy(player: Mapping, env: HeapEnv) -> Callable:
    """The policy that a specification describes.

    Args:
        player: ``{"rule": name}``, ``{"linear": weights}``, ``{"networks": paths,
            "falls_weight": λ}`` or ``{"oracle": λ}``.
        env: which an oracle may look into.
    """
    if "rule" in player:
        return RULES[player["rule"]]
    if "linear" in player:
        return best(linear(player["linear"]))
    if "networks" in player:
        return Learned([load_network(path) for path in player["networks"]], player["falls_weight"])
    return Oracle(env, player["oracle"])


def _job(
    player: Mapping,
    condition: Mapping,
    split: str,
    number: int,
    physics: str,
    runs_dir: str | Path,
) -> tuple[dict, Callable]:
    """The question of one episode and what answers it."""
    question = {
        "player": dict(player),
        "condition": dict(condition),
        "heap": [split, number],
        "physics": physics,
        "picks": MAX_PICKS,
    }
    if "networks" in player:  # named by what is in them, wherever they are
        digest = weights_digest(player["networks"])
        question["player"] = {"digest": digest, "falls_weight": player["falls_weight"]}
    return question, partial(_play, dict(player), dict(condition), split, number, physics)


def _play(player: dict, condition: dict, split: str, number: int, physics: str) -> dict:
    torch.set_num_threads(1)
    env = HeapEnv(split, physics=physics, **condition)
    try:
        policy = make_policy(player, env)
        episode = play(env, policy, env.heaps[number], seed=number)
    finally:
        env.close()
    return {"boxes": episode.unloaded.tolist(), "falls": episode.falls.tolist()}


def table_data(
    heaps: int = HEAPS["test"],
    physics: str = PHYSICS,
    conditions: Sequence[str] = tuple(CONDITIONS),
    weights: Sequence[float] = WEIGHTS,
    variants: Sequence[tuple[str, float]] = VARIANTS,
    rounds: int = ROUNDS,
    oracle: bool = True,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """Let all policies play the unseen heaps; write ``heap/{episodes,table}.csv``.

    At the λ of the table, all policies under all conditions; at the others, those that depend
    on λ, as trained.

    Returns:
        ``table.csv``, see ``compared``.
    """
    checks.integer("heaps", heaps, 1, HEAPS["test"])
    for name in conditions:
        checks.one_of("a condition", name, CONDITIONS)
    rules = pd.read_csv(Path(folder) / NAME / "rules.csv")
    cells = []
    for weight in dict.fromkeys((SHOWN_WEIGHT, *weights)):
        shown = weight == SHOWN_WEIGHT
        chosen = players(rules, weight, variants, rounds - 1, runs_dir, oracle)
        for condition in conditions if shown else conditions[:1]:
            for name, player in chosen.items():
                varies = "rule" not in player and " seed " not in name
                if (shown or varies) and not (condition != "as trained" and name == "oracle"):
                    cells.append((condition, weight, name, player))
    jobs = [
        _job(player, CONDITIONS[condition], "test", number, physics, runs_dir)
        for condition, _, _, player in cells
        for number in range(heaps)
    ]
    answers = keep_all(Path(runs_dir) / NAME / "episodes", jobs, n_jobs, progress)
    rows = []
    for place, answer in enumerate(answers):
        condition, weight, name, _ = cells[place // heaps]
        boxes, falls = (float(np.mean(answer.value[part])) for part in ("boxes", "falls"))
        rows.append(
            {
                "condition": condition,
                "falls_weight": weight,
                "policy": name,
                "heap": place % heaps,
                "boxes": boxes,
                "falls": falls,
                "net": boxes - weight * falls,
            }
        )
    episodes = pd.DataFrame(rows)
    table = compared(episodes)
    settings = {
        "heaps": heaps,
        "physics": physics,
        "picks": MAX_PICKS,
        "rounds": rounds,
        "conditions": {name: CONDITIONS[name] for name in conditions},
        "best rules": {str(weight): best_rule(rules, weight) for weight in weights},
    }
    reduced = (
        heaps < HEAPS["test"]
        or rounds < ROUNDS
        or physics != PHYSICS
        or tuple(conditions) != tuple(CONDITIONS)
    )
    records = [answer.record for answer in answers]
    tables = {"episodes": episodes, "table": table}
    command = f"{COMMAND} heap-table --heaps {heaps} --physics {physics} --rounds {rounds}"
    publish(Path(folder) / NAME, "table", tables, command, settings, reduced, records)
    return table


def compared(episodes: pd.DataFrame) -> pd.DataFrame:
    """Means per pick with intervals, and how much more each policy brings than the best rule.

    Args:
        episodes: one row per condition, λ, policy and heap, with ``boxes``, ``falls`` and
            ``net``, boxes - λ falls, per pick.

    Returns:
        One row per condition, λ and policy. For each measure its mean, and the 95 % bootstrap
        interval over heaps as ``_low`` and ``_high``; for boxes and net also ``_ratio``, the
        mean over that of the best rule, with the interval from resampling the pairs.
    """
    rows = []
    for key, group in episodes.groupby(["condition", "falls_weight"], sort=False):
        of = {name: each.sort_values("heap") for name, each in group.groupby("policy", sort=False)}
        for name, each in of.items():
            row = dict(zip(("condition", "falls_weight"), key)) | {
                "policy": name,
                "heaps": len(each),
            }
            for measure in MEASURES:
                values = each[measure].to_numpy()
                low, high = bootstrap_interval(values)
                row |= {measure: values.mean(), f"{measure}_low": low, f"{measure}_high": high}
            reference = of.get(REFERENCE, of.get("highest"))
            for measure in ("boxes", "net"):
                ends = ratio_interval(each[measure].to_numpy(), reference[measure].to_numpy())
                names = (f"{measure}_ratio{end}" for end in ("", "_low", "_high"))
                row |= dict(zip(names, ends))
            rows.append(row)
    return pd.DataFrame(rows)


def ratio_interval(
    values: np.ndarray, reference: np.ndarray, resamples: int = 10_000, seed: int = 0
) -> tuple[float, float, float]:
    """Ratio of two means over the same heaps, and its 95 % bootstrap interval over pairs.

    NaN where the reference's mean is not > 0, because such a ratio means nothing.
    """
    values = checks.finite_array("values", values, (None,))
    reference = checks.finite_array("reference", reference, values.shape)
    rows = np.random.default_rng(seed).integers(len(values), size=(resamples, len(values)))
    below = reference[rows].mean(axis=1)
    if reference.mean() <= 0 or (below <= 0).any():
        return np.nan, np.nan, np.nan
    low, high = np.quantile(values[rows].mean(axis=1) / below, [0.025, 0.975])
    return float(values.mean() / reference.mean()), float(low), float(high)


def _options(heaps: int) -> dict:
    return JOBS | {"--heaps": {"type": int, "default": heaps, "help": "heaps to play"}}


TABLE_OPTIONS = _options(HEAPS["test"]) | {
    "--physics": {"default": PHYSICS, "choices": PHYSICS_KINDS, "help": "that judges"},
    "--rounds": {"type": int, "default": ROUNDS, "help": "of heap-learning that were made"},
}
PARTS = {
    "heap-rules": ("the family of rules on training heaps", rules_data, _options(RULE_HEAPS)),
    "heap-table": ("all policies on unseen heaps", table_data, TABLE_OPTIONS),
}
