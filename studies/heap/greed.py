"""Net by pick: is the learned policy greedy, and would it pay to look ahead?

    python -m studies greed

The learned policy takes the box that is worth most now. It can therefore win the first picks of
an episode and lose later ones, and it may be worth more if it plays last. Three ways play the test
heaps pick by pick: the best rule alone, the networks alone, and the networks from the heap that
the rule leaves after some picks. Nothing is trained. What is computed is kept in ``runs/heap``.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import torch
from matplotlib.figure import Figure

from studies import paths
from studies.heap.boxes import Heap
from studies.heap.env import MAX_PICKS, HeapEnv
from studies.heap.generate import stored_heaps
from studies.heap.learning import Learned, load_networks
from studies.heap.policies import Episode, play
from studies.heap.recording import HEAPS, NAME
from studies.heap.table import LEARNED, LINES, REFERENCE, SHOWN_WEIGHT, best_rule
from studies.heap.table import candidates as rules_by_name
from studies.results import COMMAND, code_of, keep_all, publish, read_table
from studies.statistics import mean_interval, ratio_interval
from studies.style import styled
from unload.support import files

GREED = f"{NAME}/greed"
NETWORKS = paths.DATA / NAME / "networks.safetensors"
PHYSICS = "coarse"  # a third of the time of the whole one
AFTER = 0, 10, 11  # picks of the rule before the networks go on; five or four are left to them
PARTS = {"picks 1–5": (1, 5), "picks 6–10": (6, 10), "picks 11–15": (11, 15)}
COLUMNS = ["heap", "rule_picks", "pick", "boxes", "falls"]


def greed_data(n_jobs: int = 1) -> None:
    """Play the test heaps pick by pick; write ``heap/greed.csv``, one row per pick.

    ``heap`` is the heap's number. ``rule_picks`` says how many picks the best rule has made before
    the networks go on. Of these episodes the networks' picks alone are listed, because the rule's
    are those of the episode of the rule alone, whose ``rule_picks`` is 15. ``boxes`` and ``falls``
    are those of the ``pick``, counted from 1.
    """
    rule = best_rule(read_table(f"{NAME}/rules"), SHOWN_WEIGHT)
    asked: list[tuple[dict, tuple]] = []
    for heap in stored_heaps("test"):
        question = {"rule": rule, "heap": code_of(heap), "physics": PHYSICS}
        asked.append((question, (rule, heap, PHYSICS)))
    by_rule = keep_all(f"{NAME}/greed", _by_rule, asked, n_jobs)
    frames = [_rows(number, MAX_PICKS, answer.value[0]) for number, answer in enumerate(by_rule)]

    # The networks go on from the heap that the rule has left.
    asked, cells = [], []
    for after in AFTER:
        for number, answer in enumerate(by_rule):
            heap = Heap(**answer.value[1][after])
            question = {"networks": files.digest(NETWORKS)}
            question |= {"heap": code_of(heap), "physics": PHYSICS, "picks": MAX_PICKS - after}
            asked.append((question, (heap, PHYSICS, MAX_PICKS - after)))
            cells.append((number, after))
    by_networks = keep_all(f"{NAME}/greed", _by_networks, asked, n_jobs)
    frames += [_rows(*cell, answer.value) for cell, answer in zip(cells, by_networks)]

    settings = {
        "heaps": HEAPS["test"], "physics": PHYSICS, "picks": MAX_PICKS, REFERENCE: rule,
        "λ": SHOWN_WEIGHT, "rule picks": AFTER,
    }  # fmt: skip
    tables = {"greed": pd.concat(frames)}
    publish(GREED, tables, f"{COMMAND} greed", settings, by_rule + by_networks)


def _rows(heap: int, rule_picks: int, counts: np.ndarray) -> pd.DataFrame:
    """The rows of an episode's last picks; counts (picks, 2) of boxes and falls."""
    first = MAX_PICKS - len(counts) + 1
    frame = pd.DataFrame(counts, columns=["boxes", "falls"])
    frame["pick"] = range(first, MAX_PICKS + 1)
    return frame.assign(heap=heap, rule_picks=rule_picks)[COLUMNS]


def _by_rule(rule: str, heap: Heap, physics: str) -> list:
    """Boxes and falls of a rule's picks, (15, 2) int, and the heaps before and after each."""
    env = HeapEnv("test", physics=physics, max_picks=MAX_PICKS)
    episode = play(env, rules_by_name()[rule], heap, seed=0)
    return [_counts(episode), [dict(vars(left)) for left in episode.heaps]]


def _by_networks(heap: Heap, physics: str, picks: int) -> np.ndarray:
    """Boxes and falls of the networks' picks, (picks, 2) int."""
    torch.set_num_threads(1)
    env = HeapEnv("test", physics=physics, max_picks=picks)
    policy = Learned(load_networks(NETWORKS), SHOWN_WEIGHT)
    return _counts(play(env, policy, heap, seed=0))


def _counts(episode: Episode) -> np.ndarray:
    return np.stack([episode.unloaded, episode.falls], axis=1)


def nets(frame: pd.DataFrame, picks: tuple[int, int] = (1, MAX_PICKS)) -> pd.DataFrame:
    """Boxes - falls of some picks of each episode.

    Args:
        frame: see ``greed_data``.
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
        frame: see ``greed_data``.

    Returns:
        A row per part and number of picks of the rule before the networks: the net a pick of the
        ``rule`` alone and of the ``episode``; their ``ratio``, with its 95 % BCa bootstrap
        interval over heaps from ``low`` to ``high``.
    """
    rows = {}
    for part, (first, last) in (PARTS | {"all 15 picks": (1, MAX_PICKS)}).items():
        net = nets(frame, (first, last)) / (last - first + 1)
        for after in net.columns.drop(MAX_PICKS):
            means = net[MAX_PICKS].mean(), net[after].mean()
            rows[part, after] = *means, *ratio_interval(net[after], net[MAX_PICKS])
    index = pd.MultiIndex.from_tuples(rows, names=["part", "rule_picks"])
    return pd.DataFrame(rows.values(), index, ["rule", "episode", "ratio", "low", "high"])


@styled
def net_by_pick(frame: pd.DataFrame) -> Figure:
    """Boxes - falls by the number of the pick: the best rule's and the networks'.

    A dot is a pick's mean over heaps, a line the mean of five picks with its 95 % BCa bootstrap
    interval over heaps.

    Args:
        frame: see ``greed_data``.
    """
    figure, axes = plt.subplots(figsize=(6.4, 3.6))
    for rule_picks, name, label in ((MAX_PICKS, REFERENCE, REFERENCE), (0, LEARNED, "agent")):
        colour, picks = LINES[name], range(1, MAX_PICKS + 1)
        means = [nets(frame, (pick, pick))[rule_picks].mean() for pick in picks]
        axes.plot(picks, means, "o", color=colour, ms=3.5, alpha=0.6)
        for first, last in PARTS.values():
            ends = first - 0.4, last + 0.4
            net = nets(frame, (first, last))[rule_picks] / (last - first + 1)
            mean, low, high = mean_interval(net)
            shown = label if first == 1 else None
            axes.plot(ends, (mean, mean), color=colour, lw=2, label=shown)
            axes.fill_between(ends, low, high, color=colour, alpha=0.15, lw=0)
    axes.set(xlabel="pick", ylabel="boxes − falls", xticks=(1, 5, 10, 15), ylim=(0, None))
    axes.legend()
    return figure
