"""The best rule, chosen on training heaps, and all policies on the same unseen heaps.

    python -m studies heap

This makes everything about heaps: the heaps, the picks and networks of ``recording``, and what
stands here. Each episode is kept in ``runs/heap``: a command that was stopped goes on. A pick in
the whole physics takes 0.55 s of CPU, and the whole experiment about a day.
"""

from collections.abc import Callable, Hashable, Mapping
from itertools import islice, product
from pathlib import Path

import pandas as pd
import torch

from studies import paths
from studies.heap.env import MAX_PICKS, HeapEnv
from studies.heap.generate import stored_heaps
from studies.heap.learning import Learned, load_networks
from studies.heap.policies import RULES, Oracle, best, linear, play
from studies.heap.recording import HEAPS, NAME, WEIGHTS, make_heaps, make_networks
from studies.results import COMMAND, Result, code_of, keep_all, publish, read_table
from studies.statistics import mean_interval, ratio_interval
from studies.style import COLOURS
from unload.support import files

# A box near the front takes many along if others lie before it and on it; how much each of these
# counts is what the family of linear rules varies.
FAMILY_COLUMNS = {
    "behind": (-1.0, -0.5, 0.0, 0.5),
    "z": (-1.0, -0.5, 0.0, 0.5),
    "clear_in_front": (-1.0, -0.5, 0.0),
    "clear_above": (-0.5, 0.0, 0.5),
}
FIRST_HEAPS, RULE_HEAPS = 4, 20  # training heaps that all rules play, and the best of them
KEPT = 10  # rules for each price of a fall that play more heaps
TEST_HEAPS = HEAPS["test"]  # all unseen ones
RULE_PHYSICS = "coarse"  # the rules are many
PHYSICS = "whole"  # that judges
SHOWN_WEIGHT = 1.0  # λ at which all policies play; at the others, only those that depend on it
REFERENCE, LEARNED, ORACLE = "best rule", "learned", "oracle"
RULE_COLUMNS = ["rule", "heaps", "boxes", "falls"]
MEASURES = "boxes", "falls", "net"
ENDS = "", "_low", "_high"  # of a mean and its interval
LINES = {REFERENCE: COLOURS["highest"], LEARNED: "C0", ORACLE: "0.2"}
UNITS = {"boxes": "boxes a pick", "falls": "falls a pick", "net": "boxes − λ falls a pick"}


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


def choose_rules(n_jobs: int = 1) -> None:
    """Let the rules play training heaps, and the best of them more; write ``heap/rules.csv``.

    It has a row per rule: ``rule``, ``heaps`` that it has played, ``boxes`` and ``falls`` a pick.
    """
    first = {name: ({"rule": name}, FIRST_HEAPS) for name in candidates()}
    answers = _played(first, "train", RULE_PHYSICS, n_jobs)
    frame = _means(answers)
    chosen = {rule: None for weight in WEIGHTS for rule in _ranked(frame, weight)[:KEPT]}
    more = {name: ({"rule": name}, RULE_HEAPS) for name in chosen}
    answers |= _played(more, "train", RULE_PHYSICS, n_jobs)
    rules = _means(answers)
    settings = {
        "heaps": [FIRST_HEAPS, RULE_HEAPS], "split": "train", "physics": RULE_PHYSICS,
        "picks": MAX_PICKS,
    }  # fmt: skip
    results = [answer for of in answers.values() for answer in of]
    publish(f"{NAME}/rules", {"rules": rules}, f"{COMMAND} {NAME}", settings, results)


def _played(
    players: Mapping[Hashable, tuple[dict, int]], split: str, physics: str, n_jobs: int
) -> dict[Hashable, list[Result]]:
    """The episodes of players, see ``_play``, each on the first heaps of a split, by their names.

    Networks are known by what is in their file, wherever it is.
    """
    asked = []
    for player, heaps in players.values():
        known = dict(player)
        if "networks" in player:
            known["networks"] = files.digest(player["networks"])
        for number, heap in enumerate(stored_heaps(split)[:heaps]):
            question = {"player": known, "heap": code_of(heap), "number": number}
            question |= {"physics": physics, "picks": MAX_PICKS}
            asked.append((question, (player, split, number, physics)))
    answers = iter(keep_all(f"{NAME}/episodes", _play, asked, n_jobs))
    return {name: list(islice(answers, heaps)) for name, (_, heaps) in players.items()}


def _means(answers: dict[str, list[Result]]) -> pd.DataFrame:
    episodes = pd.DataFrame(
        {"rule": rule} | answer.value for rule, of in answers.items() for answer in of
    )
    rules = episodes.groupby("rule", sort=False)
    return rules.mean().assign(heaps=rules.size()).reset_index()[RULE_COLUMNS]


def _ranked(rules: pd.DataFrame, falls_weight: float) -> list[str]:
    """Rules by boxes - λ falls, the best one first."""
    net = rules["boxes"] - falls_weight * rules["falls"]
    return rules["rule"][net.sort_values(ascending=False, kind="stable").index].tolist()


def best_rule(rules: pd.DataFrame, falls_weight: float) -> str:
    """The rule with the most boxes - λ falls, of those that have played the most heaps."""
    return _ranked(rules[rules["heaps"] == rules["heaps"].max()], falls_weight)[0]


def _play(player: dict, split: str, number: int, physics: str) -> dict[str, float]:
    """Boxes and falls a pick of one episode.

    Args:
        player: ``{"rule": name}``, ``{"networks": path, "falls_weight": λ}`` or
            ``{"oracle": λ}``.
        split: of the stored heaps.
        number: of the heap.
        physics: see ``Rake``.
    """
    torch.set_num_threads(1)
    env = HeapEnv(split, physics=physics, max_picks=MAX_PICKS)
    if "rule" in player:
        policy = (RULES | candidates())[player["rule"]]
    elif "networks" in player:
        policy = Learned(load_networks(player["networks"]), player["falls_weight"])
    else:
        policy = Oracle(env, player["oracle"])
    episode = play(env, policy, env.heaps[number], seed=number)
    return {"boxes": float(episode.unloaded.mean()), "falls": float(episode.falls.mean())}


def plan(rules: pd.DataFrame, networks: str | Path) -> dict[tuple[float, str], dict]:
    """What plays, see ``_play``, by λ and policy: those that depend on λ at each, others at λ = 1.

    The oracle takes 4 minutes of CPU a heap, and therefore plays at λ = 1 only.

    Args:
        rules: of which the best one at each λ plays, see ``choose_rules``.
        networks: file of those that the learned policy averages.
    """
    players = {(SHOWN_WEIGHT, name): {"rule": name} for name in RULES}
    for weight in WEIGHTS:
        players[weight, REFERENCE] = {"rule": best_rule(rules, weight)}
        players[weight, LEARNED] = {"networks": str(networks), "falls_weight": weight}
    return players | {(SHOWN_WEIGHT, ORACLE): {"oracle": SHOWN_WEIGHT}}


def compare(n_jobs: int = 1) -> None:
    """Let all policies play the unseen heaps; write ``heap/{episodes,table}.csv``."""
    rules = read_table(f"{NAME}/rules")
    planned = plan(rules, paths.DATA / NAME / "networks.safetensors")
    players = {cell: (player, TEST_HEAPS) for cell, player in planned.items()}
    played = _played(players, "test", PHYSICS, n_jobs)

    # What a policy brings is weighed by the λ that it has played for.
    episodes = pd.DataFrame(
        {"falls_weight": weight, "policy": policy, "heap": number} | answer.value
        for (weight, policy), of in played.items()
        for number, answer in enumerate(of)
    )
    episodes["net"] = episodes["boxes"] - episodes["falls_weight"] * episodes["falls"]
    settings = {
        "heaps": TEST_HEAPS, "physics": PHYSICS, "picks": MAX_PICKS,
        "best rules": {str(weight): best_rule(rules, weight) for weight in WEIGHTS},
    }  # fmt: skip
    results = [answer for of in played.values() for answer in of]
    tables = {"episodes": episodes, "table": compared(episodes)}
    publish(f"{NAME}/table", tables, f"{COMMAND} {NAME}", settings, results)


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
            intervals = {measure: mean_interval(each[measure]) for measure in MEASURES}
            for measure in ("boxes", "net"):
                ratio = ratio_interval(each[measure], reference[measure])
                intervals[f"{measure}_ratio"] = ratio
            for measure in MEASURES:
                more = each[measure] - reference[measure]
                intervals[f"{measure}_more"] = mean_interval(more)
            for measure, ends in intervals.items():
                row |= {f"{measure}{end}": value for end, value in zip(ENDS, ends)}
            rows.append(row)
    return pd.DataFrame(rows)


def heap_data(n_jobs: int) -> None:
    """Make all data of heaps: the heaps, recorded picks, networks, and the policies compared."""
    for step in (make_heaps, make_networks, choose_rules, compare):
        step(n_jobs=n_jobs)
