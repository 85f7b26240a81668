"""The family of rules on training heaps: which of them is the best one for a price of a fall.

python -m unload.reproduce heap-rules
"""

from pathlib import Path

import numpy as np
import pandas as pd

from unload.heap.env import MAX_PICKS
from unload.heap.rules import family
from unload.reproduce.heap import HEAPS, NAME
from unload.reproduce.heap_episodes import episode_job
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish
from unload.support import checks, files

RULE_HEAPS = 10  # training heaps on which the family is compared
RULE_PHYSICS = "coarse"  # 71 rules are many; "near" would favour those that make boxes fall
OPTIONS = JOBS | {"--heaps": {"type": int, "default": RULE_HEAPS, "help": "heaps to play"}}


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
        episode_job({"linear": weights}, {}, "train", number, RULE_PHYSICS, runs_dir)
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


PARTS = {"heap-rules": ("the family of rules on training heaps", rules_data, OPTIONS)}
