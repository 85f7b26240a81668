"""The three physics decide alike."""

from functools import partial

import gymnasium
import numpy as np
import pandas as pd
import pytest

from unload import policies, task
from unload.load.substacks import front_walls, stack_load
from unload.reproduce import agreement
from unload.reproduce.figures.lifting import agreement_scatter
from unload.support.provenance import read_provenance


@pytest.fixture(scope="module")
def committed():
    return agreement.read_agreement()


def test_table_decides_as_local():
    states, frame = agreement.collect_lifts(300, seed=7)
    assert len(frame) >= 300 and len(states) == 6 * 5
    assert set(frame["policy"]) == set(agreement.UNLOADED_BY)
    assert set(frame["picks"]) == set(agreement.STAGES)
    assert not len(agreement.disagreements(frame, "table", "local"))
    few = frame[frame["on_top"] < 3]
    assert (few["table"] == few["local"]).all()
    many = frame[frame["on_top"] >= 3]
    assert len(many) > 30 and (many["table"] == 0).all()
    for _, same in frame.groupby("situation"):
        assert same["local"].nunique() == 1


def test_lifts_are_asked_about_in_the_state_they_name():
    states, frame = agreement.collect_lifts(100, seed=3)
    for state, rows in frame.groupby("state"):
        named = states[state]
        assert (rows["picks"] == named.picks).all() and (rows["seed"] == named.seed).all()
        assert named.present[named.visible].all()
        assert set(rows["item"]) <= set(named.visible)
        assert not rows["item"].duplicated().any()
        assert (np.bincount(np.minimum(rows["on_top"], 3), minlength=4) <= agreement.WANTED).all()
    assert [state.present.all() for state in states] == [state.picks == 0 for state in states]


def test_choice_for_full_is_of_whole_states_and_all_close_lifts():
    states = np.repeat(np.arange(20), 12)
    distances = np.random.default_rng(0).uniform(0, 0.46, len(states))
    frame = pd.DataFrame({"state": states, "local": distances})
    chosen = agreement.choose_for_full(frame, 30, np.random.default_rng(0))
    assert (chosen == "drawn").sum() == 36
    assert not set(states[chosen == "drawn"]) & set(states[chosen != "drawn"])
    elsewhere = distances[chosen != "drawn"]
    close = (elsewhere >= agreement.CLOSE[0]) & (elsewhere <= agreement.CLOSE[1])
    assert (close == (chosen[chosen != "drawn"] == "close")).all()
    assert (agreement.choose_for_full(frame, 0, np.random.default_rng(0)) == "").all()


def test_full_is_asked_and_a_stopped_run_goes_on(tmp_path, monkeypatch):
    """Three lifts in a container of two walls, after 30 picks."""
    stack = {"stack": lambda rng: front_walls(stack_load(rng), 2)}
    monkeypatch.setattr(agreement.gymnasium, "make", partial(gymnasium.make, **stack))
    monkeypatch.setattr(agreement, "UNLOADED_BY", {"highest": policies.highest})
    monkeypatch.setattr(agreement, "STAGES", (30,))
    monkeypatch.setattr(agreement, "WANTED", (1, 1, 1, 0))
    folders = {"folder": tmp_path / "data", "runs_dir": tmp_path / "runs", "progress": False}
    frame = agreement.agreement_data(3, 3, seed=5, **folders)
    assert (frame["asked_full"] == "drawn").all() and frame["full"].notna().all()
    assert not len(agreement.disagreements(frame, "local", "full"))
    assert frame["full"].max() == pytest.approx(frame["local"].max(), abs=0.01)
    provenance = read_provenance(tmp_path / "data", agreement.NAME)
    assert provenance["reduced"] and provenance["settings"]["lifts"] == 3
    written = (tmp_path / "data" / "lift_agreement.csv").read_bytes()
    monkeypatch.setattr(agreement, "FullPhysics", None)
    agreement.agreement_data(3, 3, seed=5, **folders)
    assert (tmp_path / "data" / "lift_agreement.csv").read_bytes() == written
    with pytest.raises(TypeError):  # an answer to another question is not taken
        agreement.agreement_data(3, 3, seed=6, **folders)


def test_committed_lifts(committed):
    assert committed.dtypes.astype(str).to_dict() == agreement.DTYPES
    assert len(committed) >= 5000
    assert not committed[["table", "local"]].isna().any(axis=None)
    assert len(agreement.disagreements(committed, "table", "local")) == 0
    assert (committed["on_top"].isin((1, 2))).mean() > 0.6
    assert set(committed["policy"]) == set(agreement.UNLOADED_BY)
    drawn, close = (committed[committed["asked_full"] == why] for why in ("drawn", "close"))
    assert len(drawn) >= 300 and len(close) > 0
    asked = committed["asked_full"] != ""
    assert (committed["full"].notna() == asked).all()
    assert committed.loc[committed["local"].between(*agreement.CLOSE), "full"].notna().all()
    settings = read_provenance(agreement.files.DATA, agreement.NAME)["settings"]
    assert settings["lifts"] == len(committed)
    assert settings["in full, drawn"] == len(drawn)


def test_committed_lifts_that_full_decides_otherwise_are_close(committed):
    differing = agreement.disagreements(committed, "local", "full")
    both = committed.dropna(subset="full")
    differs = (both["local"] >= task.LIFT_THRESHOLD) != (both["full"] >= task.LIFT_THRESHOLD)
    assert differing.equals(both[differs])
    assert len(differing) <= 0.05 * len(both)


def test_committed_lifts_can_be_computed_again(committed):
    _, frame = agreement.collect_lifts(100, agreement.FRESH)
    first = committed[: len(frame)]
    columns = ["policy", "seed", "picks", "item", "on_top", "situation"]
    assert (frame[columns] == first[columns]).all(axis=None)
    assert np.allclose(frame[["table", "local"]], first[["table", "local"]], atol=1e-6)


@pytest.mark.parametrize(
    ("lifts", "full", "message"),
    [(0, 0, "lifts is 0"), (10, 11, "full is 11"), (10, -1, "full is -1")],
)
def test_impossible_counts_are_refused(tmp_path, lifts, full, message):
    with pytest.raises(ValueError, match=message):
        agreement.agreement_data(lifts, full, folder=tmp_path, runs_dir=tmp_path)


def test_unknown_names_are_refused(committed):
    with pytest.raises(ValueError, match="policy is 'lowest'"):
        next(agreement.container_states("lowest", 0))
    with pytest.raises(ValueError, match="other is 'mujoco'"):
        agreement.disagreements(committed, "local", "mujoco")


def test_figure_shows_all_lifts(committed):
    figure = agreement_scatter(committed)
    for axes, physics in zip(figure.axes, ("table", "full")):
        shown = sum(len(points.get_offsets()) for points in axes.collections)
        assert shown == committed[physics].notna().sum()
    with pytest.raises(ValueError, match="frame has no full"):
        agreement_scatter(committed.drop(columns="full"))
