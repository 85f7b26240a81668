"""The policies compared: table and figure."""

import numpy as np
import pandas as pd
import pytest

from unload.reproduce import comparison, robustness
from unload.reproduce.figures import comparison as figures
from unload.reproduce.statistics import bootstrap_interval

RATES = [0.5, 0.25, 0.75]


def write(folder, missing=None):
    """A ``comparison.csv`` in which the recommended agent never fails."""
    rows = [
        {"policy": policy, "mask": mask, "condition": condition, "load": load,
         "success_rate": 1 if policy == "recommended" else rate}
        for condition in comparison.CONDITIONS
        for policy, mask in figures.ROWS
        for load, rate in enumerate(RATES)
        if (policy, mask, condition) != missing
    ]  # fmt: skip
    pd.DataFrame(rows).to_csv(folder / "comparison.csv", index=False)


def write_full(folder, policies, episodes=2):
    rows = [
        {"policy": policy, "after_pick": after_pick, "episode": episode, "success_rate": 0.9}
        for after_pick in robustness.LIFTED_BY
        for policy in policies
        for episode in range(episodes)
    ]
    pd.DataFrame(rows).to_csv(folder / "robustness.csv", index=False)


def test_conditions_are_those_of_the_data():
    played = {*comparison.CONDITIONS, *figures.FULL.values()}
    assert len(figures.CONDITIONS) == len(played)
    assert set(figures.CONDITIONS) == played
    assert set(figures.FULL) < set(robustness.LIFTED_BY)
    assert len(figures.CONDITIONS) % figures.COLUMNS == 0


def test_means_and_intervals_are_over_the_containers(tmp_path):
    write(tmp_path)
    row = figures.comparison_means(tmp_path).loc["paper", False, "σ 2 cm"]
    assert row["runs"] == 3
    assert row["success_rate"] == 0.5
    assert (row["success_rate_low"], row["success_rate_high"]) == bootstrap_interval(RATES)


def test_table_shows_misses_perfection_and_what_is_absent(tmp_path):
    write(tmp_path, missing=("highest", True, "complete"))
    write_full(tmp_path, ["highest"])
    table = figures.comparison_table(tmp_path)
    assert table.index.tolist() == list(figures.CONDITIONS)
    low, high = 100 * np.array(bootstrap_interval(RATES))
    assert table.loc["500 picks", "random"] == f"50.0 ({low:.1f}–{high:.1f})"
    assert table.loc["500 picks", "recommended, no mask"] == "100"
    assert table.loc["complete", "highest"] == "–"
    assert table.loc["full, kept", "highest"] == "90.0 (90.0–90.0)"
    assert table.loc["full, kept", "recommended"] == "–"


def test_nearly_perfect_is_not_called_perfect(tmp_path):
    write(tmp_path)
    path = tmp_path / "comparison.csv"
    rows = pd.read_csv(path)
    rows.loc[rows["policy"] == "nearest", "success_rate"] = 0.99999
    rows.to_csv(path, index=False)
    assert figures.comparison_table(tmp_path).loc["500 picks", "nearest"] != "100"


def test_only_what_should_be_there_is_missed(tmp_path):
    write(tmp_path, missing=("nearest", True, "σ 5 cm"))
    write_full(tmp_path, [policy for policy in comparison.COMPARED if policy != "paper"])
    assert figures.not_played(tmp_path) == ["paper: full, kept", "nearest: σ 5 cm"]
    write_full(tmp_path, ["paper"])  # restored, only the recommended agent plays
    assert "recommended: full, restored" in figures.not_played(tmp_path)
    assert "random: full, restored" not in figures.not_played(tmp_path)
    write(tmp_path)
    write_full(tmp_path, comparison.COMPARED)
    assert figures.not_played(tmp_path) == []


@pytest.mark.parametrize("full", [[], ["random", "highest"]])
def test_figure_draws_the_means_of_every_condition(tmp_path, full):
    write(tmp_path)
    if full:
        write_full(tmp_path, full)
    figure = figures.comparison_msr(tmp_path)
    assert [axes.get_title("left") for axes in figure.axes] == list(figures.CONDITIONS)
    panels = dict(zip(figures.CONDITIONS, figure.axes))

    def dots(condition):
        marked = (line for line in panels[condition].lines if line.get_marker() == "o")
        return {line.get_ydata()[0]: line.get_xdata()[0] for line in marked}

    assert list(dots("complete").values()) == [0.5] * 7 + [1, 1]
    assert dots("full, kept") == {list(comparison.COMPARED).index(each): 0.9 for each in full}
    note = panels["full, kept"].get_title("right")
    assert note == ("2 containers" if full else "")


def test_containers_are_counted(tmp_path):
    write(tmp_path)
    rows = pd.read_csv(tmp_path / "comparison.csv")
    rows[(rows["policy"] != "random") | (rows["load"] < 1)].to_csv(
        tmp_path / "comparison.csv", index=False
    )
    assert figures.comparison_msr(tmp_path).axes[0].get_title("right") == "1–3 containers"


def test_figure_is_saved_as_the_same_bytes(tmp_path, saved_twice):
    write(tmp_path)
    saved_twice(lambda: figures.comparison_msr(tmp_path))


@pytest.mark.parametrize(
    "make",
    [
        figures.comparison_means,
        figures.not_played,
        figures.comparison_table,
        figures.comparison_msr,
    ],
)
def test_missing_or_damaged_data_is_refused(make, tmp_path):
    with pytest.raises(FileNotFoundError, match="python -m unload.reproduce comparison"):
        make(tmp_path)
    (tmp_path / "comparison.csv").write_text("policy,mask\nrandom,True\n")
    with pytest.raises(ValueError, match="comparison.csv has no condition, success_rate"):
        make(tmp_path)
    write(tmp_path)
    (tmp_path / "robustness.csv").write_text("policy,success_rate\nrandom,1\n")
    with pytest.raises(ValueError, match="robustness.csv has no after_pick"):
        make(tmp_path)
