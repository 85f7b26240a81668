"""Whether a run is like the paper's figures, part by part; and what is published of ties."""

import re
from fnmatch import fnmatch

import numpy as np
import pandas as pd
import pytest

from studies import paths
from studies.grid import read_grid
from studies.results import read_table
from studies.ties import training
from studies.ties.criterion import FIG11, FIG12, READINGS, likeness, noisier_readings, scatter
from studies.ties.laboratory import CELLS
from tests.studies.test_statistics import course

# Of ten million picks in twenty windows: falls, rises, sinks slowly; the MSR becomes slower and
# noisier after the loss's peak.
LOSS = np.r_[0.2, 0.15, np.linspace(0.2, 0.5, 10), np.linspace(0.49, 0.45, 8)]
FLAT = np.r_[0.495, 0.47, np.linspace(0.475, 0.5, 10), np.linspace(0.499, 0.495, 8)]
RATES = np.r_[np.linspace(0.15, 0.55, 12), 0.55 + np.resize([0.0, 0.04], 8)]


@pytest.mark.parametrize(
    ("part", "rates", "loss"),
    [
        (None, RATES, LOSS),
        ("starts", np.r_[0.19, RATES[1:]], LOSS),
        ("steady", np.r_[RATES[:13], 0.49, RATES[14:]], LOSS),
        ("slower", np.r_[np.full(12, 0.15), RATES[12:]], LOSS),
        ("noisier", np.r_[RATES[:12] - np.resize([0, 0.02], 12), np.linspace(0.56, 0.6, 8)], LOSS),
        ("ends", RATES + np.linspace(0, 0.1, 20), LOSS),
        ("loss_falls", RATES, np.r_[0.15, LOSS[1:]]),
        ("loss_rises", RATES, FLAT),
        ("loss_sinks", RATES, np.r_[LOSS[:12], np.linspace(0.4, 0.1, 8)]),
    ],
)
def test_each_part_of_the_criterion_is_missed_by_a_run_of_its_own(part, rates, loss):
    found = likeness(course(rates, loss))
    assert [name for name in FIG12 + FIG11 if not found[name]] == ([part] if part else [])
    assert found["fig12"] == (part not in FIG12) and found["fig11"] == (part not in FIG11)
    assert found["both"] == (part is None)


# What is added to the eight points of each window; neither changes the mean of a window.
BENT = 0.01 * np.array([7, 1, -3, -5, -5, -3, 1, 7])  # far from a line, small steps
ZIGZAG = 0.03 * np.array([1, -1, 1, -1, -1, 1, -1, 1])  # near one, large steps


@pytest.mark.parametrize(
    ("before", "after", "noisier"),
    [
        (BENT, ZIGZAG, ["steps"]),
        (ZIGZAG, BENT, ["scatter"]),
        (0 * BENT, BENT, ["scatter", "steps"]),
    ],
)
def test_noisier_has_three_readings(before, after, noisier):
    """Of a run whose MSR rises evenly, with the peak of its loss at half time."""
    rates = np.linspace(0.2, 0.6, 160) + np.r_[np.tile(before, 10), np.tile(after, 10)]
    run = pd.DataFrame({"picks": 62_500 * np.arange(1, 161), "success_rate": rates, "loss": 0.3})
    run.loc[72:79, "loss"] = 0.5
    found = noisier_readings(run)
    assert [*found] == [*READINGS] and found["windows"] is likeness(run)["noisier"]
    assert [name for name in ("scatter", "steps") if found[name]] == noisier


def test_scatter_leaves_out_what_a_window_rises():
    rates = np.r_[0.1, 0.2, 0.3, 0.4, 0.9, 0.7, 0.5, 0.3, 0.5, 0.6, 0.5, 0.6]
    run = pd.DataFrame({"picks": 125_000 * np.arange(1, 13), "success_rate": rates})
    found = scatter(run).to_numpy()
    assert found[:8] == pytest.approx(0, abs=1e-12)
    assert found[8:] == pytest.approx([-0.02, 0.06, -0.06, 0.02])


def test_the_cells_are_those_of_the_plan():
    plan = (paths.DATA / "ties" / "PLAN.md").read_text(encoding="utf-8")
    patterns = re.findall(r"`([a-z_0-9.*]+)`", plan[plan.index("## Runs") :])
    assert not [name for name in training.CELLS if not any(fnmatch(name, p) for p in patterns)]
    assert "ρ = 0.965 along x and y and 0.997 along z" in plan
    assert training.CORRELATIONS["drifting"] == (0.965, 0.965, 0.997)
    anew = training.CELLS["anew_mask"].change.keywords["correlation"]
    assert not any(anew), "nothing is left of the noise before"
    seeds = {seed for cell in training.CELLS.values() for seed in cell.seeds}
    assert (min(seeds), max(seeds)) == (60, 64) and "seeds 60–64" in plan
    assert {len(cell.seeds) for cell in CELLS.values()} == {30}


def test_the_runs_of_the_first_plan_are_all_there():
    table, curves = read_table("ties/earlier"), read_grid(training.EARLIER)
    assert len(table) == 226 and table["cell"].nunique() == 38
    twenty = table[table["cell"].isin(training.EARLIER.cells)].set_index(["cell", "seed"])["end"]
    late = curves[curves["picks"] > 18_000_000].groupby(["cell", "seed"])["success_rate"].mean()
    assert len(late) == 20 and np.allclose(late.sort_index(), twenty.sort_index(), atol=1e-4)
