"""Rules on training heaps: which of them is the best one for a price of a fall.

    python -m unload.reproduce heap-rules

All rules play a few heaps, and the best of them more; then the same on heaps of varied friction,
mass and size, those of ``heap-variation``. It takes 2 hours of CPU.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from unload.heap.env import MAX_PICKS
from unload.heap.rules import RULES, family
from unload.reproduce.heap import HEAPS, NAME
from unload.reproduce.heap_episodes import episode_job, varied_job
from unload.reproduce.heap_learning import SHOWN_WEIGHT, WEIGHTS
from unload.reproduce.heap_variation import SEED, varied_properties
from unload.reproduce.results import COMMAND, JOBS, Result, keep_all, publish
from unload.support import checks, files

FIRST_HEAPS, RULE_HEAPS = 4, 20  # training heaps that all rules play, and that the best play
KEPT = 10  # rules for each price of a fall that play all of these heaps
PHYSICS = "coarse"  # the rules are many; "near" would favour those that make boxes fall
OPTIONS = JOBS | {
    "--heaps": {"type": int, "default": RULE_HEAPS, "help": "heaps that the best rules play"}
}


def candidates() -> dict[str, dict]:
    """The rules that compete, by name: the family, and those in ``RULES`` but *random*."""
    named = {name: {"rule": name} for name in RULES if name != "random"}
    return named | {name: {"linear": weights} for name, weights in family().items()}


def rules_data(
    heaps: int = RULE_HEAPS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """Let the rules play training heaps; write ``heap/{rules,rules_varied}.csv``.

    Returns:
        ``rules.csv``, one row per rule: ``rule``, ``heaps`` that it has played, ``boxes`` and
        ``falls`` per pick. ``rules_varied.csv`` holds the same for heaps of which each has its
        own friction, mass and size; its best rules are those for the λ of the table.
    """
    checks.integer("heaps", heaps, 1, HEAPS["train"])
    first = min(FIRST_HEAPS, heaps)
    usual = [{}] * heaps
    varied = [varied_properties(number)._asdict() for number in range(heaps)]
    jobs = [varied_job(condition, number, SEED) for number, condition in enumerate(varied)]
    keep_all(Path(runs_dir) / NAME / "heaps", jobs, n_jobs, progress)
    tables, records = {}, []
    for name, conditions, weights in (
        ("rules", usual, WEIGHTS),
        ("rules_varied", varied, (SHOWN_WEIGHT,)),
    ):
        answers = _played(candidates(), conditions[:first], runs_dir, n_jobs, progress)
        frame = _means(answers)
        chosen = {rule: None for weight in weights for rule in _ranked(frame, weight)[:KEPT]}
        answers |= _played(chosen, conditions, runs_dir, n_jobs, progress)
        tables[name] = _means(answers)
        records += [answer.record for of in answers.values() for answer in of]
    settings = {
        "heaps": [first, heaps], "split": "train", "varied": varied, "physics": PHYSICS,
        "picks": MAX_PICKS,
    }  # fmt: skip
    command, reduced = f"{COMMAND} heap-rules --heaps {heaps}", heaps < RULE_HEAPS
    publish(Path(folder) / NAME, "rules", tables, command, settings, reduced, records)
    return tables["rules"]


def _played(
    names: Iterable[str],
    conditions: Sequence[dict],
    runs_dir: str | Path,
    n_jobs: int,
    progress: bool,
) -> dict[str, list[Result]]:
    """The episodes of rules on the first heaps, each under its condition, by rule."""
    players, names, heaps = candidates(), list(names), len(conditions)
    jobs = [
        episode_job(players[name], condition, "train", number, PHYSICS, runs_dir, SEED)
        for name in names
        for number, condition in enumerate(conditions)
    ]
    answers = keep_all(Path(runs_dir) / NAME / "episodes", jobs, n_jobs, progress)
    return {name: answers[place * heaps : (place + 1) * heaps] for place, name in enumerate(names)}


def _means(answers: dict[str, list[Result]]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {"rule": name, "heaps": len(of)}
            | {part: np.mean([each.value[part] for each in of]) for part in ("boxes", "falls")}
            for name, of in answers.items()
        ]
    )


def _ranked(rules: pd.DataFrame, falls_weight: float) -> list[str]:
    """Rules by boxes - λ falls, the best one first."""
    net = rules["boxes"] - falls_weight * rules["falls"]
    return rules["rule"][net.sort_values(ascending=False, kind="stable").index].tolist()


def best_rule(rules: pd.DataFrame, falls_weight: float) -> str:
    """The rule with the most boxes - λ falls, of those that have played the most heaps."""
    return _ranked(rules[rules["heaps"] == rules["heaps"].max()], falls_weight)[0]


PARTS = {"heap-rules": ("which rule is the best on training heaps", rules_data, OPTIONS)}
