"""Figures of speed: the benchmarks, and what the layers of an update store."""

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from studies.speed.parts import three_digits
from studies.style import styled
from unload import task

CACHES = 1, 10  # MB that a processor's caches hold


@styled
def layers(samples: int, n_features: int) -> Figure:
    """What each layer of an update by PyTorch stores of so many samples, in MB."""
    numbers = {
        "observations": 3,
        "features": n_features,
        "after the ReLU": n_features,
        "beside the pooled ones": 4 * n_features,
        "values": 1,
    }
    megabytes = pd.Series(numbers) * samples * task.N_VISIBLE * 4 / 1e6
    figure, axes = plt.subplots(figsize=(5.6, 2.4))
    bars = axes.barh(list(numbers), megabytes)
    axes.bar_label(bars, [f" {each:.3g}" for each in megabytes])
    axes.set(xscale="log", xlabel="MB", xlim=(1e-3, 1e4), title=f"{megabytes.sum():.3g} MB in all")
    axes.axvspan(*CACHES, color="0.9", zorder=0)
    return figure


@styled
def benchmarks(table: pd.DataFrame) -> Figure:
    """The rows of ``data/speeds.csv`` as bars: a panel a kind, beside the first way of its kind."""
    groups = table.groupby("what", sort=False)
    sizes = [len(group) for _, group in groups]
    figure, panels = plt.subplots(
        len(sizes), 1, figsize=(6.4, 0.34 * sum(sizes) + 0.5 * len(sizes)), sharex=True,
        height_ratios=[size + 0.6 for size in sizes],
    )  # fmt: skip
    for number, (axes, (what, group)) in enumerate(zip(panels, groups)):
        axes.barh(range(len(group)), group["ratio"], color=f"C{number}")
        for place, row in enumerate(group.itertuples()):
            text = f"{three_digits(row.value)} {row.unit}"
            axes.text(max(row.ratio, 1) * 1.15, place, text, va="center", fontsize=8)
        axes.set_yticks(range(len(group)), group["how"], fontsize=8)
        axes.set(xscale="log", ylim=(len(group) - 0.4, -0.6))
        axes.set(xlim=(0.5, 20 * table["ratio"].max()))
        axes.set_title(what, loc="left", fontsize=9)
        axes.minorticks_off()
        axes.grid(False, axis="y")
    axes.set_xlabel("times as fast as the first way of its kind")
    return figure
