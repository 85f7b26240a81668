"""Policies on the same unseen heaps: table, conditions, and throughput against falls.

    python -m unload.reproduce heap-rules     # data/heap/rules.csv: the family on training heaps
    python -m unload.reproduce heap-table     # data/heap/{episodes,table}.csv

Each episode is kept in ``runs/heap``: a command that was stopped goes on. All policies of a
condition play the same heaps, so that differences are those of pairs. A pick takes 0.7 s of CPU,
so that a policy's 30 episodes take 5 minutes; ``plan`` says which of them are worth it.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import torch
from scipy import stats

from unload.heap.env import MAX_PICKS, HeapEnv, stored_heaps
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
from unload.reproduce.heap_variation import sized_heap, sized_job, varied_paths
from unload.reproduce.intervals import RESAMPLES
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish, read_table
from unload.support import checks, files

RULE_HEAPS = 10  # training heaps on which the family is compared
RULE_PHYSICS = "coarse"  # 71 rules are many; "near" would favour those that make boxes fall
PHYSICS = "whole"
# Arguments of HeapEnv, and ``scale``, of the boxes: those of the stored heaps if there is none.
# The networks were trained on none but the first, except those "trained with variation".
CONDITIONS: dict[str, dict] = {
    "as trained": {},
    "camera": {"observation": "camera"},
    "friction 0.35": {"friction": 0.35},
    "friction 0.7": {"friction": 0.7},
    "mass 2 kg": {"mass": 2.0},
    "boxes × 0.8": {"scale": 0.8},
    "boxes × 1.1": {"scale": 1.1},
}
AS_TRAINED = "as trained"
REFERENCE = "best rule"
LEARNED = "learned"
VARIED = "trained with variation"
FEW = "random", "highest", REFERENCE, LEARNED, VARIED  # played under all conditions
ORACLE_HEAPS = 10  # it takes 2.5 minutes of CPU a heap
SIZED_SEED = 7000  # of the heaps of other sizes; no other data uses it
LEVEL = 0.95
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


def learned_name(kind: str, gamma: float) -> str:
    """Name of a variant in the table: what it differs in from the recommended one."""
    best_kind, best_gamma = VARIANTS[0]
    changed = [kind] * (kind != best_kind) + [f"γ={gamma:g}"] * (gamma != best_gamma)
    return ", ".join([LEARNED, *changed])


def players(
    rules: pd.DataFrame,
    falls_weight: float,
    variants: Sequence[tuple[str, float]] = VARIANTS,
    round_number: int = ROUNDS - 1,
    runs_dir: str | Path = files.RUNS,
    variation: bool = False,
) -> dict[str, dict]:
    """Specifications of the policies to compare at a λ, by name, see ``make_policy``.

    The learned ones average the networks of all seeds; the recommended variant's single
    networks are there too, as ``"learned seed 0"`` and so on.

    Args:
        rules: of which the best one is the reference, see ``rules_data``.
        falls_weight: λ.
        variants: learned ones, see ``VARIANTS``.
        round_number: of the networks.
        runs_dir: where they are.
        variation: whether those trained with variation play, see ``heap_variation``.
    """
    chosen = {name: {"rule": name} for name in RULES}
    chosen[REFERENCE] = {"linear": family()[best_rule(rules, falls_weight)]}
    for kind, gamma in variants:
        paths = [str(path) for path in network_paths(round_number, kind, gamma, runs_dir)]
        name = learned_name(kind, gamma)
        chosen[name] = {"networks": paths, "falls_weight": falls_weight}
        if name == LEARNED:
            for seed, path in enumerate(paths):
                one = {"networks": [path], "falls_weight": falls_weight}
                chosen[f"{name} seed {seed}"] = one
    if variation:
        paths = [str(path) for path in varied_paths(runs_dir)]
        chosen[VARIED] = {"networks": paths, "falls_weight": falls_weight}
    chosen["oracle"] = {"oracle": falls_weight}
    return chosen


class Cell(NamedTuple):
    """A policy under a condition.

    Attributes:
        condition: its name.
        falls_weight: λ.
        policy: its name.
        player: its specification, see ``make_policy``.
        heaps: how many it plays, the first ones.
    """

    condition: str
    falls_weight: float
    policy: str
    player: dict
    heaps: int


def plan(
    rules: pd.DataFrame,
    heaps: int = HEAPS["test"],
    conditions: Sequence[str] = tuple(CONDITIONS),
    weights: Sequence[float] = WEIGHTS,
    variants: Sequence[tuple[str, float]] = VARIANTS,
    round_number: int = ROUNDS - 1,
    oracle_heaps: int = ORACLE_HEAPS,
    variation: bool = False,
    runs_dir: str | Path = files.RUNS,
) -> list[Cell]:
    """What is played; all pairs of policies and conditions would take 14 hours of CPU.

    - At the λ of the table, as trained: all policies, the oracle on fewer heaps.
    - At the other λ, as trained: the best rule for that λ, and the learned one.
    - At the λ of the table, under the other conditions: the policies in ``FEW``.

    Each cell takes 5 minutes of CPU with 30 heaps and "whole" physics: 51 of them 4.3 hours, the
    oracle 0.4 more, and ``VARIED`` 7 cells more.
    """
    cells = []
    for weight in dict.fromkeys((SHOWN_WEIGHT, *weights)):
        shown = weight == SHOWN_WEIGHT
        chosen = players(rules, weight, variants, round_number, runs_dir, variation)
        for condition in conditions if shown else [AS_TRAINED]:
            for name, player in chosen.items():
                if condition != AS_TRAINED:
                    played = heaps if name in FEW else 0
                elif not shown:
                    played = heaps if name in (REFERENCE, LEARNED) else 0
                else:
                    played = min(oracle_heaps, heaps) if name == "oracle" else heaps
                if played:
                    cells.append(Cell(condition, weight, name, player, played))
    return cells


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
    return Oracle(env, player["oracle"], again=PHYSICS)


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
    return question, partial(_play, dict(player), dict(condition), split, number, physics, runs_dir)


def _play(
    player: dict, condition: dict, split: str, number: int, physics: str, runs_dir: str | Path
) -> dict:
    torch.set_num_threads(1)
    arguments = dict(condition)
    scale = arguments.pop("scale", None)
    if scale is None:
        heap = stored_heaps(split)[number]
    else:
        heap = sized_heap(SIZED_SEED, number, scale, runs_dir)
    env = HeapEnv(heaps=[heap], physics=physics, **arguments)
    try:
        episode = play(env, make_policy(player, env), heap, seed=number)
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
    oracle_heaps: int = ORACLE_HEAPS,
    variation: bool = False,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """Let policies play the unseen heaps as planned; write ``heap/{episodes,table}.csv``.

    Args:
        heaps: of the test heaps, and of those of each other size.
        physics: that judges.
        conditions: names in ``CONDITIONS``.
        weights: λ of the curve of throughput against falls.
        variants: learned ones, see ``VARIANTS``.
        rounds: of ``heap-learning`` that were made.
        oracle_heaps: that the oracle plays.
        variation: whether the networks of ``heap-variation`` play.
        folder: of the data.
        runs_dir: where networks and episodes are.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Returns:
        ``table.csv``, see ``compared``.
    """
    checks.integer("heaps", heaps, 1, HEAPS["test"])
    checks.integer("oracle_heaps", oracle_heaps, 0, HEAPS["test"])
    for name in conditions:
        checks.one_of("a condition", name, CONDITIONS)
    rules = read_table(
        Path(folder) / NAME / "rules.csv", f"{COMMAND} heap-rules", ["rule", "boxes", "falls"]
    )
    cells = plan(
        rules, heaps, conditions, weights, variants, rounds - 1, oracle_heaps, variation, runs_dir
    )
    sized = [
        sized_job(SIZED_SEED, number, CONDITIONS[name]["scale"])
        for name in conditions
        if "scale" in CONDITIONS[name]
        for number in range(heaps)
    ]
    keep_all(Path(runs_dir) / NAME / "heaps", sized, n_jobs, progress)
    places = [(cell, number) for cell in cells for number in range(cell.heaps)]
    jobs = [
        _job(cell.player, CONDITIONS[cell.condition], "test", number, physics, runs_dir)
        for cell, number in places
    ]
    answers = keep_all(Path(runs_dir) / NAME / "episodes", jobs, n_jobs, progress)
    rows = []
    for (cell, number), answer in zip(places, answers):
        boxes, falls = (float(np.mean(answer.value[part])) for part in ("boxes", "falls"))
        rows.append(
            {
                "condition": cell.condition,
                "falls_weight": cell.falls_weight,
                "policy": cell.policy,
                "heap": number,
                "boxes": boxes,
                "falls": falls,
                "net": boxes - cell.falls_weight * falls,
            }
        )
    episodes = pd.DataFrame(rows)
    table = compared(episodes)
    settings = {
        "heaps": heaps,
        "oracle heaps": oracle_heaps,
        "physics": physics,
        "picks": MAX_PICKS,
        "rounds": rounds,
        "conditions": {name: CONDITIONS[name] for name in conditions},
        "best rules": {str(weight): best_rule(rules, weight) for weight in weights},
    }
    reduced = (
        heaps < HEAPS["test"]
        or oracle_heaps < ORACLE_HEAPS
        or rounds < ROUNDS
        or physics != PHYSICS
        or tuple(conditions) != tuple(CONDITIONS)
    )
    records = [answer.record for answer in answers]
    tables = {"episodes": episodes, "table": table}
    command = f"{COMMAND} heap-table --heaps {heaps} --physics {physics} --rounds {rounds}"
    command += f" --oracle-heaps {oracle_heaps}" + " --variation" * variation
    publish(Path(folder) / NAME, "table", tables, command, settings, reduced, records)
    return table


def compared(episodes: pd.DataFrame) -> pd.DataFrame:
    """Means per pick with intervals, and how much more each policy brings than the best rule.

    Args:
        episodes: one row per condition, λ, policy and heap, with ``boxes``, ``falls`` and
            ``net``, boxes - λ falls, per pick. Each condition and λ has the best rule, on all
            heaps that others have played.

    Returns:
        One row per condition, λ and policy. For each measure its mean, and the 95 % BCa
        bootstrap interval over heaps as ``_low`` and ``_high``. Beside the best rule on the
        same heaps, with intervals of the pairs: ``boxes_ratio`` and ``net_ratio``, the ratios
        of the means; ``net_more``, the difference.
    """
    rows = []
    for key, group in episodes.groupby(["condition", "falls_weight"], sort=False):
        of = {name: each.set_index("heap") for name, each in group.groupby("policy", sort=False)}
        for name, each in of.items():
            row = dict(zip(("condition", "falls_weight"), key)) | {
                "policy": name,
                "heaps": len(each),
            }
            reference = of[REFERENCE].loc[each.index]
            for measure in MEASURES:
                row |= _ends(measure, *mean_interval(each[measure]))
            for measure in ("boxes", "net"):
                ends = ratio_interval(each[measure], reference[measure])
                row |= _ends(f"{measure}_ratio", *ends)
            row |= _ends("net_more", *mean_interval(each["net"] - reference["net"]))
            rows.append(row)
    return pd.DataFrame(rows)


def _ends(name: str, value: float, low: float, high: float) -> dict[str, float]:
    return {name: value, f"{name}_low": low, f"{name}_high": high}


def mean_interval(values: Sequence[float], seed: int = 0) -> tuple[float, float, float]:
    """Mean, and its 95 % BCa bootstrap interval; equal values have one of no width."""
    values = checks.finite_array("values", values, (None,))
    if np.ptp(values) < 1e-12:
        return (float(values.mean()),) * 3
    return float(values.mean()), *_bca((values,), np.mean, seed)


def ratio_interval(
    values: Sequence[float], reference: Sequence[float], seed: int = 0
) -> tuple[float, float, float]:
    """Ratio of two means over the same heaps, and its 95 % BCa bootstrap interval over pairs.

    NaN where the reference's mean is not > 0 in every resample, because such a ratio means
    nothing. If all pairs have the same ratio, the interval has no width.
    """
    values = checks.finite_array("values", values, (None,))
    reference = checks.finite_array("reference", reference, values.shape)
    rows = np.random.default_rng(seed).integers(len(values), size=(RESAMPLES, len(values)))
    if (reference[rows].mean(axis=1) <= 0).any():
        return np.nan, np.nan, np.nan
    ratio = float(values.mean() / reference.mean())
    if np.abs(values - ratio * reference).max() < 1e-12:
        return ratio, ratio, ratio
    return ratio, *_bca((values, reference), _ratio, seed)


def _ratio(values: np.ndarray, reference: np.ndarray, axis: int) -> np.ndarray:
    return values.mean(axis=axis) / reference.mean(axis=axis)


def _bca(samples: tuple[np.ndarray, ...], statistic: Callable, seed: int) -> tuple[float, float]:
    """BCa interval of a statistic of one sample, or of pairs; NaN of fewer than two values."""
    if len(samples[0]) < 2:
        return np.nan, np.nan
    with warnings.catch_warnings():  # samples of few different values: the interval is NaN
        warnings.simplefilter("ignore")
        interval = stats.bootstrap(
            samples, statistic, n_resamples=RESAMPLES, paired=True, confidence_level=LEVEL,
            method="BCa", vectorized=True, axis=-1, rng=np.random.default_rng(seed),
        ).confidence_interval  # fmt: skip
    return float(interval.low), float(interval.high)


def _options(heaps: int) -> dict:
    return JOBS | {"--heaps": {"type": int, "default": heaps, "help": "heaps to play"}}


TABLE_OPTIONS = _options(HEAPS["test"]) | {
    "--physics": {"default": PHYSICS, "choices": PHYSICS_KINDS, "help": "that judges"},
    "--rounds": {"type": int, "default": ROUNDS, "help": "of heap-learning that were made"},
    "--oracle-heaps": {
        "type": int, "default": ORACLE_HEAPS, "help": "that the oracle plays; 0: none"
    },
    "--variation": {"action": "store_true", "help": "the networks of heap-variation play, too"},
}  # fmt: skip
PARTS = {
    "heap-rules": ("the family of rules on training heaps", rules_data, _options(RULE_HEAPS)),
    "heap-table": ("all policies on unseen heaps", table_data, TABLE_OPTIONS),
}
