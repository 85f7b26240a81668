"""The paper's learning curves beside ours."""

import numpy as np
import pandas as pd
import pytest

from studies.paper import curves


def test_noise_of_the_loss_is_what_the_running_mean_leaves():
    losses = {run: 5 + waves * np.resize([1, -1], 1000) for run, waves in enumerate((0.0, 1.0))}
    left = 24 / 25  # of the waves by a mean over 25 steps
    assert curves.loss_noise(losses) == pytest.approx([0, left], rel=1e-3)


def run_of(msr):
    """A curve of ten million picks, whose loss falls, rises and falls."""
    loss = np.r_[np.linspace(1, 0.1, 7), np.linspace(0.1, 0.8, 7), np.linspace(0.8, 0.2, 6)]
    return pd.DataFrame({"picks": 500_000 * np.arange(1, 21), "success_rate": msr, "loss": loss})


def agreement_of(monkeypatch, *courses):
    """What agrees of runs of one cell, without the cell's name."""
    runs = [("paper_mask", seed, run_of(course)) for seed, course in enumerate(courses)]
    monkeypatch.setattr(curves, "paper_runs", lambda: runs)
    applied = pd.DataFrame({"msr_mask": [0.9, 1], "msr_no_mask": [0.2, 0.4]})
    monkeypatch.setattr(curves, "in_fresh_containers", lambda: applied)
    agrees = curves.training()["agrees"]
    label = f": with the mask, b = 256, {len(runs)} runs"
    of_cell = agrees[agrees.index.str.endswith(label)]
    return {name.removesuffix(label): word for name, word in of_cell.items()}, agrees


def test_runs_like_the_papers_agree(monkeypatch):
    waves = 0.02 * np.resize([1, -1], 6)
    courses = [
        np.r_[np.linspace(0.15, 0.5, 14), np.linspace(0.55, end, 6) + waves]
        for end in (0.61, 0.62, 0.63)
    ]
    found, agrees = agreement_of(monkeypatch, *courses)
    names = [
        "mean reward at the end",
        "MSR at the end",
        "steady rise",
        "… slower and noisier after the loss's peak",
        "loss",
        "… its decrease slower than in tuning",
    ]
    assert found == dict.fromkeys(names, "yes")
    assert agrees["MSR at the start (first episodes)"] == "yes"
    table = curves.training()["here"]
    assert table.iloc[-2:].tolist() == ["30% (20%–40%)", "95% (90%–100%)"]


def test_a_mean_of_60_percent_is_not_enough(monkeypatch):
    falling = np.r_[np.linspace(0.3, 1, 15), np.full(5, 0.3)]
    found, agrees = agreement_of(monkeypatch, falling, np.linspace(0.3, 0.9, 20))
    assert found["mean reward at the end"] == found["MSR at the end"] == "in part"
    assert found["steady rise"] == "yes"  # of one run in two
    assert agrees["mean reward at the start (first episodes)"] == "no"


def test_another_mean_does_not_agree(monkeypatch):
    courses = [np.linspace(0.15, end, 20) for end in (0.67, 0.68, 0.69)]  # each like the paper's
    found, _ = agreement_of(monkeypatch, *courses)
    assert found["mean reward at the end"] == found["MSR at the end"] == "no"


def test_the_slope_of_a_decrease():
    loss = pd.Series([3.0, 1, 2, 1.75, 1.5], index=[1e6, 2e6, 3e6, 4e6, 5e6])
    assert curves.decrease(loss) == pytest.approx(0.25)
    assert curves.decrease(loss.iloc[:3]) == 0
