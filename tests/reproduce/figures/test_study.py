"""The figures of the study."""

import numpy as np
import pandas as pd
import pytest

from unload.reproduce.figures import study

FIGURES = [study.offline_msr, study.factorial_msr, study.factorial_curves]


@pytest.mark.parametrize("draw", FIGURES)
def test_figure_is_saved_as_the_same_bytes(draw, saved_twice):
    saved_twice(draw)


@pytest.mark.parametrize("draw", FIGURES)
def test_missing_data_names_the_command_that_makes_it(draw, names_its_command):
    names_its_command(draw)


def write_study(folder, experiment, settings):
    """A study of one run per setting; the n-th comes to an MSR of n / 10."""
    rows = [
        {"run": f"run {number}", "features": "positions", "picks": 64, "msr_mask": number / 10,
         "msr_no_mask": number / 10, **each}
        for number, each in enumerate(settings)
    ]  # fmt: skip
    (folder / "study").mkdir(exist_ok=True)
    pd.DataFrame(rows).to_csv(folder / "study" / f"{experiment}.csv", index=False)
    curves = pd.DataFrame({"run": [row["run"] for row in rows]})
    curves.to_csv(folder / "study" / f"{experiment}_curves.csv", index=False)


def test_varied_settings_are_named_by_what_differs(tmp_path):
    base = {"n_features": 64, "batch_size": 256}
    write_study(tmp_path, "search", [base, base | {"n_features": 16}, base | {"batch_size": 64}])
    axes = study.varied_msr("search", list(base), tmp_path).axes[0]
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names == ["unchanged", "n features 16", "batch size 64"]
    strong = [line for line in axes.lines if line.get_marker() != "None" and not line.get_alpha()]
    means = [line.get_xdata()[0] for line in strong]
    assert means == [0, 0, 0.1, 0.1, 0.2, 0.2]
    with pytest.raises(ValueError, match="the experiment has no gamma; expected gamma"):
        study.varied_msr("search", "gamma", tmp_path)


def test_several_studies_share_a_figure(tmp_path):
    write_study(tmp_path, "networks", [{"network": "peq"}, {"network": "stack"}])
    write_study(tmp_path, "rewards", [{"network": "attention"}])
    axes = study.varied_msr(["networks", "rewards"], "network", tmp_path).axes[0]
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names == ["network peq", "network stack", "network attention"]
    with pytest.raises(ValueError, match="experiment is 'nonsense'; expected one of"):
        study.varied_msr("nonsense", "network", tmp_path)


def test_other_columns_of_the_fits_are_refused(tmp_path):
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "offline.csv").write_text("features,seed\npositions,0\n")
    with pytest.raises(ValueError, match="offline.csv has no deadlocked, loss, msr_mask"):
        study.offline_msr(tmp_path)


def test_shares_of_picks_add_up():
    axes = study.ranks_of_picks({"one": np.array([3, 1, 1, 2])}).axes[0]
    assert axes.lines[0].get_xdata().tolist() == [1, 1, 2, 3]
    assert axes.lines[0].get_ydata().tolist() == [0.25, 0.5, 0.75, 1]
