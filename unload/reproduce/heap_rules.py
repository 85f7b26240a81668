"""Rules on training heaps: which of them is the best one for a price of a fall.

    python -m unload.reproduce heap-rules

All rules play a few heaps, and the best of them more. It takes 1.5 hours of CPU.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from unload.heap.env import MAX_PICKS
from unload.heap.rules import RULES, family
from unload.reproduce.heap import HEAPS, NAME
from unload.reproduce.heap_episodes import episode_job
from unload.reproduce.heap_learning import WEIGHTS
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
    """Let the rules play training heaps; write ``heap/rules.csv``.

    Returns:
        One row per rule: ``rule``, ``heaps`` that it has played, ``boxes`` and ``falls`` per
        pick.
    """
    checks.integer("heaps", heaps, 1, HEAPS["train"])
    first = min(FIRST_HEAPS, heaps)
    answers = _played(list(candidates()), first, runs_dir, n_jobs, progress)
    frame = _means(answers)
    chosen = {name: None for weight in WEIGHTS for name in _ranked(frame, weight)[:KEPT]}
    answers |= _played(list(chosen), heaps, runs_dir, n_jobs, progress)
    frame = _means(answers)
    settings = {
        "heaps": [first, heaps], "split": "train", "physics": PHYSICS, "picks": MAX_PICKS
    }  # fmt: skip
    records = [answer.record for of in answers.values() for answer in of]
    command, reduced = f"{COMMAND} heap-rules --heaps {heaps}", heaps < RULE_HEAPS
    publish(Path(folder) / NAME, "rules", {"rules": frame}, command, settings, reduced, records)
    return frame


def _played(
    names: Sequence[str], heaps: int, runs_dir: str | Path, n_jobs: int, progress: bool
) -> dict[str, list[Result]]:
    """The episodes of rules on the first heaps, by rule."""
    players = candidates()
    jobs = [
        episode_job(players[name], {}, "train", number, PHYSICS, runs_dir)
        for name in names
        for number in range(heaps)
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
