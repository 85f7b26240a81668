"""The best rule, chosen on training heaps, and all policies on the same unseen heaps.

    python -m studies heap

This makes everything about heaps: the heaps, the picks and networks of ``recording``, and what
stands here. Each episode is kept in ``runs/heap``: a command that was stopped goes on. A pick in
the whole physics takes 0.55 s of CPU, and the whole experiment about a day.
"""

import warnings
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import torch
from scipy import stats

from studies import paths
from studies.heap.env import MAX_PICKS, HeapEnv, stored_heaps
from studies.heap.learning import Learned, load_networks
from studies.heap.policies import RULES, TRIED_AGAIN, Oracle, best, linear, play
from studies.heap.recording import (
    CONSTANTS,
    FULL,
    NAME,
    WEIGHTS,
    Size,
    make_heaps,
    make_networks,
)
from studies.results import COMMAND, Result, keep_all, publish, read_table
from studies.statistics import LEVEL, RESAMPLES
from unload.support import checks, files

# A box near the front takes many along if others lie before it and on it; how much each of these
# counts is what the family of linear rules varies.
FAMILY_COLUMNS = {
    "behind": (-1.0, -0.5, 0.0, 0.5),
    "z": (-1.0, -0.5, 0.0, 0.5),
    "clear_in_front": (-1.0, -0.5, 0.0),
    "clear_above": (-0.5, 0.0, 0.5),
}
KEPT = 10  # rules for each price of a fall that play more heaps
RULE_PHYSICS = "coarse"  # the rules are many; "near" would favour those that make boxes fall
PHYSICS = "whole"  # that judges
SHOWN_WEIGHT = 1.0  # λ at which all policies play; at the others, only those that depend on it
REFERENCE, LEARNED, ORACLE = "best rule", "learned", "oracle"
MEASURES = "boxes", "falls", "net"
ENDS = "", "_low", "_high"  # of a mean and its interval
COLUMNS = [
    "falls_weight", "policy", "heaps",
    *(
        name + end
        for name in (*MEASURES, "boxes_ratio", "net_ratio", *(f"{name}_more" for name in MEASURES))
        for end in ENDS
    ),
]  # fmt: skip


def family() -> dict[str, dict[str, float]]:
    """All linear rules of the family by name: the weight of each column.

    Of rules that pick the same, because they are multiples of one another, one is there. No rule
    weighs the size or the tilt of a box.
    """
    rules, directions = {}, set()
    for values in product(*FAMILY_COLUMNS.values()):
        largest = max(map(abs, values))
        direction = tuple(value / largest for value in values) if largest else None
        if direction and direction not in directions:
            directions.add(direction)
            weights = {name: value for name, value in zip(FAMILY_COLUMNS, values) if value}
            rules[" ".join(f"{value:+g} {name}" for name, value in weights.items())] = weights
    return rules


def candidates() -> dict[str, Callable]:
    """The rules that compete, by name: the family, and those in ``RULES`` but *random*."""
    named = {name: rule for name, rule in RULES.items() if name != "random"}
    return named | {name: best(linear(weights)) for name, weights in family().items()}


def choose_rules(
    size: Size = FULL,
    folder: str | Path = paths.DATA,
    runs_dir: str | Path = paths.RUNS,
    n_jobs: int = 1,
) -> pd.DataFrame:
    """Let the rules play training heaps, and the best of them more; write ``heap/rules.csv``.

    Returns:
        One row per rule: ``rule``, ``heaps`` that it has played, ``boxes`` and ``falls`` a pick.
    """
    first = _played(candidates(), size.first_rule_heaps, runs_dir, n_jobs)
    frame = _means(first)
    chosen = {rule: None for weight in WEIGHTS for rule in _ranked(frame, weight)[:KEPT]}
    answers = first | _played(chosen, size.rule_heaps, runs_dir, n_jobs)
    rules = _means(answers)
    settings = {
        "heaps": [size.first_rule_heaps, size.rule_heaps], "split": "train",
        "physics": RULE_PHYSICS, "picks": MAX_PICKS,
    }  # fmt: skip
    results = [answer for of in answers.values() for answer in of]
    command, tables = f"{COMMAND} {NAME}", {"rules": rules}
    publish(Path(folder) / NAME, "rules", tables, command, settings, results, reduced=size != FULL)
    return rules


def _played(
    names: Iterable[str], heaps: int, runs_dir: str | Path, n_jobs: int
) -> dict[str, list[Result]]:
    """The episodes of rules on the first training heaps, by rule."""
    names = list(names)
    jobs = [
        episode_job({"rule": name}, "train", number, RULE_PHYSICS)
        for name in names
        for number in range(heaps)
    ]
    answers = keep_all(Path(runs_dir) / NAME / "episodes", jobs, n_jobs)
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


def episode_job(player: dict, split: str, number: int, physics: str) -> tuple[dict, Callable]:
    """The question of one episode and what plays it, see ``keep_all``.

    Args:
        player: ``{"rule": name}``, ``{"networks": path, "falls_weight": λ}`` or
            ``{"oracle": λ}``.
        split: of the stored heaps.
        number: of the heap.
        physics: see ``Rake``.
    """
    question = {
        "player": dict(player),
        "heap": stored_heaps(split)[number].digest(),
        "number": number,
        "physics": physics,
        "constants": [*CONSTANTS, TRIED_AGAIN],
        "picks": MAX_PICKS,
    }
    if "networks" in player:  # named by what is in them, wherever they are
        question["player"]["networks"] = files.digest(player["networks"])
    return question, partial(_play, player, split, number, physics)


def _play(player: dict, split: str, number: int, physics: str) -> dict[str, float]:
    """Boxes and falls a pick of one episode."""
    torch.set_num_threads(1)
    env = HeapEnv(split, physics=physics, max_picks=MAX_PICKS)
    if "rule" in player:
        policy = (RULES | candidates())[player["rule"]]
    elif "networks" in player:
        policy = Learned(load_networks(player["networks"]), player["falls_weight"])
    else:
        policy = Oracle(env, player["oracle"], physics)
    try:
        episode = play(env, policy, env.heaps[number], seed=number)
    finally:
        env.close()
        if isinstance(policy, Oracle):
            policy.close()
    return {"boxes": float(episode.unloaded.mean()), "falls": float(episode.falls.mean())}


class Cell(NamedTuple):
    """A policy at a price of a fall."""

    falls_weight: float
    policy: str
    player: dict  # see ``episode_job``


def plan(rules: pd.DataFrame, networks: str | Path) -> list[Cell]:
    """What plays: all policies at λ = 1, and at the other λ those that depend on it.

    The oracle takes 4 minutes of CPU a heap, and therefore plays at λ = 1 only.

    Args:
        rules: of which the best one at each λ plays, see ``choose_rules``.
        networks: file of those that the learned policy averages.
    """
    cells = [Cell(SHOWN_WEIGHT, name, {"rule": name}) for name in RULES]
    for weight in WEIGHTS:
        cells.append(Cell(weight, REFERENCE, {"rule": best_rule(rules, weight)}))
        player = {"networks": str(networks), "falls_weight": weight}
        cells.append(Cell(weight, LEARNED, player))
    return [*cells, Cell(SHOWN_WEIGHT, ORACLE, {"oracle": SHOWN_WEIGHT})]


def compare(
    size: Size = FULL,
    folder: str | Path = paths.DATA,
    runs_dir: str | Path = paths.RUNS,
    n_jobs: int = 1,
) -> pd.DataFrame:
    """Let all policies play the unseen heaps; write ``heap/{episodes,table}.csv``.

    Returns:
        ``table.csv``, see ``compared``.

    Raises:
        FileNotFoundError: the rules or the networks are missing.
    """
    place, command = Path(folder) / NAME, f"{COMMAND} {NAME}"
    rules = read_table(place / "rules.csv", command, ["rule", "heaps", "boxes", "falls"])
    cells = plan(rules, place / "networks.safetensors")
    places = [(cell, number) for cell in cells for number in range(size.test)]
    jobs = [episode_job(cell.player, "test", number, PHYSICS) for cell, number in places]
    answers = keep_all(Path(runs_dir) / NAME / "episodes", jobs, n_jobs)
    episodes = pd.DataFrame(
        {"falls_weight": cell.falls_weight, "policy": cell.policy, "heap": number} | answer.value
        for (cell, number), answer in zip(places, answers)
    )
    episodes["net"] = episodes["boxes"] - episodes["falls_weight"] * episodes["falls"]
    table = compared(episodes)
    settings = {
        "heaps": size.test, "physics": PHYSICS, "picks": MAX_PICKS,
        "best rules": {str(weight): best_rule(rules, weight) for weight in WEIGHTS},
    }  # fmt: skip
    tables = {"episodes": episodes, "table": table}
    publish(place, "table", tables, command, settings, answers, reduced=size != FULL)
    return table


def compared(episodes: pd.DataFrame) -> pd.DataFrame:
    """Means per pick with intervals, and how much more each policy brings than the best rule.

    Args:
        episodes: one row per λ, policy and heap, with ``boxes``, ``falls`` and ``net``,
            boxes - λ falls, per pick. At each λ the best rule has played the same heaps.

    Returns:
        One row per λ and policy. For each measure its mean, and the 95 % BCa bootstrap interval
        over heaps as ``_low`` and ``_high``. Beside the best rule on the same heaps, with
        intervals of the pairs: the ratios of the means, ``boxes_ratio`` and ``net_ratio``, and
        the differences ``boxes_more``, ``falls_more`` and ``net_more``.
    """
    rows = []
    for weight, group in episodes.groupby("falls_weight", sort=False):
        of = {name: each.set_index("heap") for name, each in group.groupby("policy", sort=False)}
        reference = of[REFERENCE]
        for name, each in of.items():
            row = {"falls_weight": weight, "policy": name, "heaps": len(each)}
            for measure in MEASURES:
                row |= _ends(measure, *mean_interval(each[measure]))
                more = each[measure] - reference[measure]
                row |= _ends(f"{measure}_more", *mean_interval(more))
            for measure in ("boxes", "net"):
                ratio = ratio_interval(each[measure], reference[measure])
                row |= _ends(f"{measure}_ratio", *ratio)
            rows.append(row)
    return pd.DataFrame(rows)[COLUMNS]


def _ends(name: str, value: float, low: float, high: float) -> dict[str, float]:
    return {name: value, f"{name}_low": low, f"{name}_high": high}


def mean_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Mean, and its 95 % BCa bootstrap interval; equal values have one of no width."""
    values = checks.finite_array("values", values, (None,))
    if np.ptp(values) < 1e-12:
        return (float(values.mean()),) * 3
    return float(values.mean()), *_bca((values,), np.mean)


def ratio_interval(
    values: Sequence[float], reference: Sequence[float]
) -> tuple[float, float, float]:
    """Ratio of two means over the same heaps, and its 95 % BCa bootstrap interval over pairs.

    NaN where the reference's mean is not > 0 in every resample, because such a ratio means
    nothing. If all pairs have the same ratio, the interval has no width.
    """
    values = checks.finite_array("values", values, (None,))
    reference = checks.finite_array("reference", reference, values.shape)
    rows = np.random.default_rng(0).integers(len(values), size=(RESAMPLES, len(values)))
    if (reference[rows].mean(axis=1) <= 0).any():
        return np.nan, np.nan, np.nan
    ratio = float(values.mean() / reference.mean())
    if np.abs(values - ratio * reference).max() < 1e-12:
        return ratio, ratio, ratio
    return ratio, *_bca((values, reference), _ratio)


def _ratio(values: np.ndarray, reference: np.ndarray, axis: int) -> np.ndarray:
    return values.mean(axis=axis) / reference.mean(axis=axis)


def _bca(samples: tuple[np.ndarray, ...], statistic: Callable) -> tuple[float, float]:
    """BCa interval of a statistic of one sample, or of pairs; NaN of fewer than two values."""
    if len(samples[0]) < 2:
        return np.nan, np.nan
    with warnings.catch_warnings():  # samples of few different values: the interval is NaN
        warnings.simplefilter("ignore")
        interval = stats.bootstrap(
            samples, statistic, n_resamples=RESAMPLES, paired=True, confidence_level=LEVEL,
            method="BCa", vectorized=True, axis=-1, rng=np.random.default_rng(0),
        ).confidence_interval  # fmt: skip
    return float(interval.low), float(interval.high)


def read_heap_table(folder: str | Path = paths.DATA) -> pd.DataFrame:
    """``heap/table.csv``, see ``compared``.

    Raises:
        FileNotFoundError: it is missing; the message names the command.
    """
    return read_table(Path(folder) / NAME / "table.csv", f"{COMMAND} {NAME}", COLUMNS)


def by_price(table: pd.DataFrame) -> pd.DataFrame:
    """The learned policy beside the best rule at each λ, as text, with 95 % intervals.

    Args:
        table: see ``compared``.

    Returns:
        One row per λ: boxes and falls a pick of both, and of boxes - λ falls the ratio and the
        difference.
    """
    by = table.set_index(["policy", "falls_weight"])
    rows = {}
    for weight in WEIGHTS:
        row = {}
        for name in (REFERENCE, LEARNED):
            for measure in ("boxes", "falls"):
                row[f"{measure}, {name}"] = f"{by.loc[(name, weight), measure]:.2f}"
        for title, measure in (("ratio", "net_ratio"), ("difference", "net_more")):
            value, low, high = (by.loc[(LEARNED, weight), f"{measure}{e}"] for e in ENDS)
            row[title] = f"{value:.2f} ({low:.2f} to {high:.2f})"
        rows[f"λ = {weight:g}"] = row
    return pd.DataFrame(rows).T


def heap_data(n_jobs: int) -> None:
    """Make all data of heaps: the heaps that the package needs, and what ``data/heap`` holds."""
    for step in (make_heaps, make_networks, choose_rules, compare):
        step(n_jobs=n_jobs)
