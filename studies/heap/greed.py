"""Net by pick: is the learned policy greedy, and would it pay to look ahead?

    python -m studies greed

The learned policy takes the box that is worth most now. It can therefore win the first picks of
an episode and lose later ones, and it may be worth more if it plays last. Both play pick by pick
here: the best rule alone, the networks alone, and the networks from the heap that the rule leaves
after some picks. How many these are is chosen on training heaps. Nothing is trained. What is
computed is kept in ``runs/heap``.
"""

from collections.abc import Iterable

import numpy as np
import pandas as pd
import torch

from studies import paths
from studies.heap.boxes import Heap
from studies.heap.env import MAX_PICKS, HeapEnv
from studies.heap.generate import stored_heaps
from studies.heap.learning import Learned, load_networks
from studies.heap.policies import Episode, play
from studies.heap.recording import HEAPS, NAME
from studies.heap.table import PHYSICS, RULE_HEAPS, RULE_PHYSICS, SHOWN_WEIGHT, best_rule
from studies.heap.table import candidates as rules_by_name
from studies.results import COMMAND, Result, keep_all, publish, read_table
from studies.statistics import ratio_interval
from unload.agent.identity import identity
from unload.support import files

GREED = f"{NAME}/greed"
NETWORKS = paths.DATA / NAME / "networks.safetensors"
TRIED = 0, 5, 10, 11, 12, 13  # picks of the rule before the networks, on training heaps
PARTS = {"picks 1–5": (1, 5), "picks 6–10": (6, 10), "picks 11–15": (11, 15)}
COLUMNS = ["split", "heap", "rule_picks", "pick", "boxes", "falls"]


def greed_data(n_jobs: int = 1) -> None:
    """Play pick by pick; write ``heap/greed.csv``, one row per pick.

    ``split`` and ``heap`` name the heap: training heaps are played in the coarse physics, test
    heaps in the whole one. ``rule_picks`` says how many picks the best rule has made before the
    networks go on; of these episodes the networks' picks alone are listed, because the rule's are
    those of the episode of the rule alone, whose ``rule_picks`` is 15. ``boxes`` and ``falls`` are
    those of the ``pick``, counted from 1.
    """
    rule = best_rule(read_table(f"{NAME}/rules"), SHOWN_WEIGHT)
    frame, results = _played("train", RULE_HEAPS, RULE_PHYSICS, rule, TRIED, n_jobs)
    after = best_switch(frame)
    more, others = _played("test", HEAPS["test"], PHYSICS, rule, sorted({0, after}), n_jobs)
    settings = {
        "rule": rule, "λ": SHOWN_WEIGHT, "picks": MAX_PICKS, "tried": TRIED, "chosen": after,
        "heaps": {"train": RULE_HEAPS, "test": HEAPS["test"]},
        "physics": {"train": RULE_PHYSICS, "test": PHYSICS},
    }  # fmt: skip
    tables = {"greed": pd.concat([frame, more])}
    publish(GREED, tables, f"{COMMAND} greed", settings, results + others)


def _played(
    split: str, count: int, physics: str, rule: str, afters: Iterable[int], n_jobs: int
) -> tuple[pd.DataFrame, list[Result]]:
    """The rows of ``greed_data`` of one split, and the results that they are made of."""
    asked: list[tuple[dict, tuple]] = []
    for heap in stored_heaps(split)[:count]:
        question = {"rule": rule, "heap": identity(heap), "physics": physics}
        asked.append((question, (rule, heap, physics)))
    by_rule = keep_all(f"{NAME}/greed", _by_rule, asked, n_jobs)
    frames = [_rows(split, number, MAX_PICKS, of.value[0]) for number, of in enumerate(by_rule)]

    asked, cells = [], []
    for after in afters:
        for number, answer in enumerate(by_rule):
            heap, question = answer.value[1][after], {"networks": files.digest(NETWORKS)}
            question |= {"heap": identity(heap), "physics": physics, "picks": MAX_PICKS - after}
            asked.append((question, (heap, physics, MAX_PICKS - after)))
            cells.append((split, number, after))
    by_networks = keep_all(f"{NAME}/greed", _by_networks, asked, n_jobs)
    frames += [_rows(*cell, answer.value) for cell, answer in zip(cells, by_networks)]
    return pd.concat(frames), by_rule + by_networks


def _rows(split: str, heap: int, rule_picks: int, counts: np.ndarray) -> pd.DataFrame:
    """The rows of an episode's last picks; counts (picks, 2) of boxes and falls."""
    first = MAX_PICKS - len(counts) + 1
    frame = pd.DataFrame(counts, columns=["boxes", "falls"])
    frame["pick"] = range(first, MAX_PICKS + 1)
    return frame.assign(split=split, heap=heap, rule_picks=rule_picks)[COLUMNS]


def _by_rule(rule: str, heap: Heap, physics: str) -> tuple[np.ndarray, tuple[Heap, ...]]:
    """Boxes and falls of a rule's picks, (15, 2) int, and the heaps before and after each."""
    env = HeapEnv("test", physics=physics, max_picks=MAX_PICKS)
    episode = play(env, rules_by_name()[rule], heap, seed=0)
    return _counts(episode), episode.heaps


def _by_networks(heap: Heap, physics: str, picks: int) -> np.ndarray:
    """Boxes and falls of the networks' picks, (picks, 2) int."""
    torch.set_num_threads(1)
    env = HeapEnv("test", physics=physics, max_picks=picks)
    policy = Learned(load_networks(NETWORKS), SHOWN_WEIGHT)
    return _counts(play(env, policy, heap, seed=0))


def _counts(episode: Episode) -> np.ndarray:
    return np.stack([episode.unloaded, episode.falls], axis=1)


def best_switch(frame: pd.DataFrame) -> int:
    """After how many picks of the rule the networks should go on, of those of ``TRIED``."""
    return int(nets(frame)[list(TRIED)].mean().idxmax())


def nets(frame: pd.DataFrame, picks: tuple[int, int] = (1, MAX_PICKS)) -> pd.DataFrame:
    """Boxes - falls of some picks of each episode.

    Args:
        frame: see ``greed_data``, of one split.
        picks: the first and the last that count.

    Returns:
        A row per heap; a column per number of picks that the rule has made before the networks.
    """
    net = (frame["boxes"] - frame["falls"]).set_axis(
        pd.MultiIndex.from_frame(frame[["rule_picks", "heap", "pick"]])
    )
    rule, found = net[MAX_PICKS].unstack("pick"), {}
    for after in sorted(frame["rule_picks"].unique()):
        episode = rule.copy()
        episode.loc[:, after + 1 :] = net[after].unstack("pick").loc[:, after + 1 :]
        found[after] = episode.loc[:, picks[0] : picks[1]].sum(axis=1)
    return pd.DataFrame(found)


def ratios(frame: pd.DataFrame) -> pd.DataFrame:
    """Net beside that of the rule alone on the same heaps, in the parts of an episode and in all.

    Args:
        frame: see ``greed_data``, of one split.

    Returns:
        A row per part and number of picks of the rule before the networks: ``rule`` and
        ``player``, the nets a pick; their ``ratio``, with its 95 % BCa bootstrap interval over
        heaps from ``low`` to ``high``.
    """
    rows = {}
    for part, (first, last) in (PARTS | {"all 15 picks": (1, MAX_PICKS)}).items():
        net = nets(frame, (first, last)) / (last - first + 1)
        for after in net.columns.drop(MAX_PICKS):
            means = net[MAX_PICKS].mean(), net[after].mean()
            rows[part, after] = *means, *ratio_interval(net[after], net[MAX_PICKS])
    index = pd.MultiIndex.from_tuples(rows, names=["part", "rule_picks"])
    return pd.DataFrame(rows.values(), index, ["rule", "player", "ratio", "low", "high"])
