"""Figures of heaps: net by pick."""

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from studies.heap.env import MAX_PICKS
from studies.heap.greed import PARTS, nets
from studies.heap.table import LEARNED, LINES, REFERENCE
from studies.statistics import mean_interval
from studies.style import styled


@styled
def net_by_pick(frame: pd.DataFrame) -> Figure:
    """Boxes - falls by the number of the pick: the best rule's and the networks'.

    A dot is a pick's mean over heaps, a line the mean of five picks with its 95 % BCa bootstrap
    interval over heaps.

    Args:
        frame: see ``greed.greed_data``.
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
