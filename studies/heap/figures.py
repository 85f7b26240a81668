"""Net by pick: is the learned policy greedy, and would it pay to look ahead?

The learned policy takes the box that is worth most now. It can therefore win the first picks of
an episode and lose later ones, and it may be worth more if it plays last.
"""

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from studies.heap.env import MAX_PICKS
from studies.heap.table import LEARNED, LINES, REFERENCE
from studies.statistics import mean_interval, ratio_interval
from studies.style import styled

PARTS = {"picks 1–5": (1, 5), "picks 6–10": (6, 10), "picks 11–15": (11, 15)}


@styled
def net_by_pick(frame: pd.DataFrame) -> Figure:
    """Boxes - falls by the number of the pick: the best rule's and the networks'.

    A dot is a pick's mean over heaps, a line the mean of five picks with its 95 % BCa bootstrap
    interval over heaps.

    Args:
        frame: see ``nets``.
    """
    figure, axes = plt.subplots(figsize=(6.4, 3.6))
    for rule_picks, name in ((MAX_PICKS, REFERENCE), (0, LEARNED)):
        colour, picks = LINES[name], range(1, MAX_PICKS + 1)
        means = [nets(frame, (pick, pick))[rule_picks].mean() for pick in picks]
        axes.plot(picks, means, "o", color=colour, ms=3.5, alpha=0.6)
        for first, last in PARTS.values():
            ends = first - 0.4, last + 0.4
            net = nets(frame, (first, last))[rule_picks] / (last - first + 1)
            mean, low, high = mean_interval(net)
            label = name if first == 1 else None
            axes.plot(ends, (mean, mean), color=colour, lw=2, label=label)
            axes.fill_between(ends, low, high, color=colour, alpha=0.15, lw=0)
    axes.set(xlabel="pick", ylabel="boxes − falls", xticks=(1, 5, 10, 15), ylim=(0, None))
    axes.legend()
    return figure


def nets(frame: pd.DataFrame, picks: tuple[int, int] = (1, MAX_PICKS)) -> pd.DataFrame:
    """Boxes - falls of some picks of each episode.

    Args:
        frame: ``heap/greed``, a row per pick of the test heaps. Three ways play them: the best rule
            alone, the networks alone, and the networks from the heap that the rule leaves.
            ``rule_picks`` says how many picks the rule has made before the networks go on; of such
            an episode the networks' picks alone are listed, because the rule's are those of the
            rule alone, whose ``rule_picks`` is 15. ``boxes`` and ``falls`` are those of the
            ``pick``, counted from 1.
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
        frame: see ``nets``.

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
