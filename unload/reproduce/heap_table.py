"""Policies on the same unseen heaps: table, conditions, and throughput against falls.

    python -m unload.reproduce heap-table

Each episode is kept in ``runs/heap``: a command that was stopped goes on. All policies of a
condition play the same heaps, so that differences are those of pairs. A pick takes 0.55 s of CPU,
so that a policy's 30 episodes take 4 minutes; ``plan`` says which of them are worth it.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from unload.heap.env import MAX_PICKS
from unload.heap.rake import PHYSICS as PHYSICS_KINDS
from unload.heap.rules import RULES
from unload.reproduce.heap import HEAPS, NAME
from unload.reproduce.heap_episodes import PHYSICS, episode_job, varied_job
from unload.reproduce.heap_learning import (
    LEARNED,
    ROUNDS,
    SHOWN_WEIGHT,
    VARIANTS,
    WEIGHTS,
    Variant,
    network_paths,
)
from unload.reproduce.heap_rules import best_rule, candidates
from unload.reproduce.heap_variation import varied_paths
from unload.reproduce.intervals import mean_interval, ratio_interval
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish, read_table
from unload.support import checks, files

# See ``episode_job``. The networks were trained on none but the first, except those "trained with
# variation", which know other frictions, masses and sizes, but no camera.
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
VARIED = "trained with variation"
VARIED_RULE = "rule chosen with variation"
LINEAR = "linear"
SEED = "seed "  # and its number: one network of the learned policy
BY_PROBABILITY = "by probability"  # of a fall, instead of the number of falls
FEW = "random", REFERENCE, VARIED_RULE, LEARNED, VARIED  # played under all conditions
CURVES = REFERENCE, LINEAR, LEARNED  # played at all λ
# Variants that differ from the learned policy in more than one thing, each with one nearer to it.
BASES = {
    "γ = 0.5": "sums only",
    "γ = 0.8": "sums only",
    "pooled": "sums only",
    "own row": "pooled",
    LINEAR: "own row",
}
ORACLE_HEAPS = 30  # it takes 4 minutes of CPU a heap
MEASURES = "boxes", "falls", "net"


def players(
    rules: pd.DataFrame,
    falls_weight: float,
    variants: Mapping[str, Variant] = VARIANTS,
    round_number: int = ROUNDS - 1,
    runs_dir: str | Path = files.RUNS,
    varied_rules: pd.DataFrame | None = None,
) -> dict[str, dict]:
    """Specifications of the policies to compare at a λ, by name, see ``make_policy``.

    The learned ones average the networks of all seeds; the recommended variant's single
    networks are there too, as ``"seed 0"`` and so on, and the average that weighs the
    probability of a fall.

    Args:
        rules: of which the best one is the reference, see ``rules_data``.
        falls_weight: λ.
        variants: learned ones, by name.
        round_number: of the networks.
        runs_dir: where they are.
        varied_rules: on heaps of varied friction, mass and size. If they are given, the best of
            them plays, and so do the networks of ``heap_variation``.
    """
    chosen = {name: {"rule": name} for name in RULES}
    chosen[REFERENCE] = candidates()[best_rule(rules, falls_weight)]
    for name, variant in variants.items():
        paths = [str(path) for path in network_paths(round_number, variant, runs_dir)]
        chosen[name] = {"networks": paths, "falls_weight": falls_weight}
        if name == LEARNED:
            for seed, path in enumerate(paths):
                one = {"networks": [path], "falls_weight": falls_weight}
                chosen[f"{SEED}{seed}"] = one
            chosen[BY_PROBABILITY] = chosen[name] | {"by_probability": True}
    if varied_rules is not None:
        chosen[VARIED_RULE] = candidates()[best_rule(varied_rules, falls_weight)]
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
    variants: Mapping[str, Variant] = VARIANTS,
    round_number: int = ROUNDS - 1,
    oracle_heaps: int = ORACLE_HEAPS,
    varied_rules: pd.DataFrame | None = None,
    runs_dir: str | Path = files.RUNS,
) -> list[Cell]:
    """What is played; all pairs of policies and conditions would take a day of CPU.

    - At the λ of the table, as trained: all policies.
    - At the other λ, as trained: the policies in ``CURVES``, of which the best rule is another
      one for each λ.
    - At the λ of the table, under the other conditions: the policies in ``FEW``.

    Each cell takes 4 minutes of CPU with 30 heaps and "whole" physics, all together 4.5 hours, and
    the oracle 2 more.
    """
    cells = []
    for weight in dict.fromkeys((SHOWN_WEIGHT, *weights)):
        shown = weight == SHOWN_WEIGHT
        chosen = players(rules, weight, variants, round_number, runs_dir, varied_rules)
        for condition in conditions if shown else [AS_TRAINED]:
            for name, player in chosen.items():
                if condition != AS_TRAINED:
                    played = heaps if name in FEW else 0
                elif not shown:
                    played = heaps if name in CURVES else 0
                else:
                    played = min(oracle_heaps, heaps) if name == "oracle" else heaps
                if played:
                    cells.append(Cell(condition, weight, name, player, played))
    return cells


def table_data(
    heaps: int = HEAPS["test"],
    physics: str = PHYSICS,
    conditions: Sequence[str] = tuple(CONDITIONS),
    weights: Sequence[float] = WEIGHTS,
    variants: Mapping[str, Variant] = VARIANTS,
    rounds: int = ROUNDS,
    oracle_heaps: int = ORACLE_HEAPS,
    variation: bool = True,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """Let policies play the unseen heaps as planned; write ``heap/{episodes,table}.csv``.

    Args:
        heaps: of the test heaps, and of those of each condition that has its own.
        physics: that judges.
        conditions: names in ``CONDITIONS``.
        weights: λ of the curve of throughput against falls.
        variants: learned ones, by name.
        rounds: of ``heap-learning`` that were made.
        oracle_heaps: that the oracle plays.
        variation: whether the networks of ``heap-variation`` play, and the rule that was chosen
            on its heaps.
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
    rules = _read_rules(folder, "rules")
    varied_rules = _read_rules(folder, "rules_varied") if variation else None
    cells = plan(
        rules,
        heaps,
        conditions,
        weights,
        variants,
        rounds - 1,
        oracle_heaps,
        varied_rules,
        runs_dir,
    )
    varied = [varied_job(CONDITIONS[name], n) for name in conditions for n in range(heaps)]
    varied = [job for job in varied if job is not None]
    keep_all(Path(runs_dir) / NAME / "heaps", varied, n_jobs, progress)
    places = [(cell, number) for cell in cells for number in range(cell.heaps)]
    jobs = [
        episode_job(cell.player, CONDITIONS[cell.condition], "test", number, physics, runs_dir)
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
    if variation:
        settings[VARIED_RULE] = best_rule(varied_rules, SHOWN_WEIGHT)
    reduced = (
        heaps < HEAPS["test"]
        or oracle_heaps < ORACLE_HEAPS
        or rounds < ROUNDS
        or physics != PHYSICS
        or tuple(conditions) != tuple(CONDITIONS)
        or not variation
        or tuple(weights) != tuple(WEIGHTS)
        or dict(variants) != VARIANTS
    )
    records = [answer.record for answer in answers]
    tables = {"episodes": episodes, "table": table}
    command = f"{COMMAND} heap-table --heaps {heaps} --physics {physics} --rounds {rounds}"
    command += f" --oracle-heaps {oracle_heaps}" + " --no-variation" * (not variation)
    publish(Path(folder) / NAME, "table", tables, command, settings, reduced, records)
    return table


def _read_rules(folder: str | Path, name: str) -> pd.DataFrame:
    path = Path(folder) / NAME / f"{name}.csv"
    return read_table(path, f"{COMMAND} heap-rules", ["rule", "heaps", "boxes", "falls"])


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
        of the means; ``net_more``, the difference. ``net_to_base`` is the difference to
        ``base``, from which the policy differs in one thing: by ``BASES``, or else the learned
        policy; NaN where that has not played.
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
            base, ends = BASES.get(name, LEARNED), (np.nan,) * 3
            if base in of:
                ends = mean_interval((each["net"] - of[base]["net"]).dropna())
            row |= {"base": base} | _ends("net_to_base", *ends)
            rows.append(row)
    return pd.DataFrame(rows)


def _ends(name: str, value: float, low: float, high: float) -> dict[str, float]:
    return {name: value, f"{name}_low": low, f"{name}_high": high}


OPTIONS = JOBS | {
    "--heaps": {"type": int, "default": HEAPS["test"], "help": "heaps to play"},
    "--physics": {"default": PHYSICS, "choices": PHYSICS_KINDS, "help": "that judges"},
    "--rounds": {"type": int, "default": ROUNDS, "help": "of heap-learning that were made"},
    "--oracle-heaps": {
        "type": int, "default": ORACLE_HEAPS, "help": "that the oracle plays; 0: none"
    },
    "--no-variation": {
        "dest": "variation", "action": "store_false", "help": "without heap-variation's networks"
    },
}  # fmt: skip
PARTS = {"heap-table": ("all policies on unseen heaps", table_data, OPTIONS)}
