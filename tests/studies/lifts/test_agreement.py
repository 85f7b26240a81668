"""The three physics decide alike."""

from functools import partial

import gymnasium
import numpy as np
import pandas as pd
import pytest

from studies.lifts import agreement
from studies.policies.robustness import front_walls
from studies.provenance import read_provenance
from studies.statistics import share_interval
from unload import policies
from unload.load.substacks import stack_load
from unload.physics.local import LocalPhysics
from unload.physics.situation import Surroundings


@pytest.fixture(scope="module")
def committed():
    return agreement.read_agreement()


def test_lifts_are_asked_about_in_the_state_they_name():
    states, frame = agreement.collect_lifts(100, 3)
    for state, rows in frame.groupby("state"):
        named = states[state]
        assert (rows["picks"] == named.picks).all() and (rows["seed"] == named.seed).all()
        assert named.present[named.visible].all()
        assert set(rows["item"]) <= set(named.visible)
        assert not rows["item"].duplicated().any()
        assert (np.bincount(np.minimum(rows["on_top"], 3), minlength=4) <= agreement.WANTED).all()
    assert [state.present.all() for state in states] == [state.picks == 0 for state in states]


def test_choice_for_full():
    """A few lifts of each state drawn, others of three and more on top, and all close ones."""
    rng = np.random.default_rng(0)
    states, on_top = np.repeat(np.arange(60), 12), np.tile(np.arange(6), 120)
    distances = rng.uniform(0, 0.46, len(states))
    frame = pd.DataFrame({"state": states, "local": distances, "on_top": on_top})
    why, walls = agreement.choose_for_full(frame, 30, np.random.default_rng(0))
    _, each = np.unique(states[why == "drawn"], return_counts=True)
    assert each.tolist() == [agreement.PER_STATE] * 10
    assert set(on_top[why == "drawn"]) > {0, 1, 2}
    assert (why == "buried").sum() == 30 and on_top[why == "buried"].min() == 3
    close = (distances >= agreement.CLOSE[0]) & (distances <= agreement.CLOSE[1])
    assert (close[why == "close"]).all() and not close[why == ""].any()
    assert ((walls == 0) == (why == "")).all()
    assert (walls[why == "drawn"] == 12).sum() == 2 * agreement.PER_STATE
    assert (walls[np.isin(why, ("buried", "close"))] == 5).all()


def test_full_is_asked_and_a_stopped_run_goes_on(tmp_path, monkeypatch):
    """Three lifts in a container of two walls, after 30 picks."""
    stack = {"stack": lambda rng: front_walls(stack_load(rng), 2)}
    monkeypatch.setattr(agreement.gymnasium, "make", partial(gymnasium.make, **stack))
    monkeypatch.setattr(agreement, "UNLOADED_BY", {"highest": policies.highest})
    monkeypatch.setattr(agreement, "STAGES", (30,))
    monkeypatch.setattr(agreement, "WANTED", (1, 1, 1, 0))
    monkeypatch.setattr(agreement, "LIFT_COUNT", 3)
    monkeypatch.setattr(agreement, "FULL_COUNT", 3)
    monkeypatch.setattr(agreement, "FIRST_SEED", 5)
    folders = tmp_path / "data", tmp_path / "runs"
    agreement.agreement_data(*folders)
    frame = agreement.read_agreement(folders[0])
    assert (frame["asked_full"] == "drawn").all() and frame["full"].notna().all()
    assert not len(agreement.disagreements(frame, "local", "full"))
    assert frame["full"].max() == pytest.approx(frame["local"].max(), abs=0.01)
    provenance = read_provenance(tmp_path / "data", agreement.NAME)
    assert provenance["settings"]["lifts"] == 3
    written = (tmp_path / "data" / "lift_agreement.csv").read_bytes()
    monkeypatch.setattr(agreement, "FullPhysics", None)
    agreement.agreement_data(*folders)
    assert (tmp_path / "data" / "lift_agreement.csv").read_bytes() == written
    monkeypatch.setattr(agreement, "FIRST_SEED", 6)
    with pytest.raises(TypeError):  # an answer to another question is not taken
        agreement.agreement_data(*folders)


def test_bounds_count_each_kind_of_lift():
    columns = ["situation", "on_top", "asked_full", "local", "full"]
    rows = [
        (0, 0, "drawn", 0.4, 0.4),
        (0, 0, "drawn", 0.4, 0.1),
        (1, 4, "buried", 0.0, 0.0),
        (2, 1, "close", 0.1, 0.3),
        (3, 1, "", 0.0, np.nan),
    ]
    frame = pd.DataFrame(rows, columns=columns).assign(seed=0, picks=100)
    frame["table"] = frame["local"]
    bounds = agreement.error_bounds(frame)
    counted = bounds[["lifts", "states", "situations", "differ"]].T.to_dict("list")
    assert counted == {
        "table, local": [4, 1, 4, 0],
        "table, local: three or more on top": [1, 1, 1, 0],
        "local, full: drawn": [2, 1, 1, 1],
        "local, full: three or more on top": [1, 1, 1, 0],
        "local, full: close": [1, 1, 1, 1],
        "local, full: all": [4, 1, 3, 2],
    }
    for _, row in bounds.iterrows():
        assert (row["low"], row["high"]) == share_interval(int(row["differ"]), int(row["lifts"]))


def test_committed_lifts(committed):
    assert list(committed) == agreement.COLUMNS
    assert len(agreement.disagreements(committed, "table", "local")) == 0
    of = {why: committed[committed["asked_full"] == why] for why in agreement.ASKED_FULL}
    assert len(of["drawn"]) >= agreement.FULL_COUNT and len(of["buried"]) == agreement.FULL_COUNT
    close = committed["local"].between(*agreement.CLOSE)
    assert committed.loc[close, "full"].notna().all()
    settings = read_provenance(agreement.paths.DATA, agreement.NAME)["settings"]
    assert settings["lifts"] == len(committed)
    assert all(settings[f"in full, {why}"] == len(rows) for why, rows in of.items())
    assert settings["lift table"] == agreement.table_digest(), "another table ships: compare again"


def test_committed_lifts_can_be_computed_again(committed):
    _, frame = agreement.collect_lifts(100, agreement.FIRST_SEED)
    first = committed[: len(frame)]
    columns = ["policy", "seed", "picks", "item", "on_top", "situation"]
    assert (frame[columns] == first[columns]).all(axis=None)
    assert np.allclose(frame[["table", "local"]], first[["table", "local"]], atol=1e-6)


@pytest.fixture(scope="module")
def state():
    """A container of three walls from which a third of the free boxes has been taken."""
    load, rng = stack_load(np.random.default_rng(4), 3), np.random.default_rng(0)
    present = np.ones(len(load), bool)
    surroundings = Surroundings(load, present)
    free = [item for item in range(len(load)) if not surroundings.on_top(item)]
    present[rng.choice(free, len(free) // 3, replace=False)] = False
    visible = rng.choice(np.flatnonzero(present), 30, replace=False)
    return agreement.State("random", 4, 0, load, present, visible)


def test_boxes_left_are_those_of_the_walls_around(monkeypatch, state):
    monkeypatch.setattr(agreement, "NEAR_WALLS", 1)
    left, items = agreement.boxes_left(state, 1, 1)
    assert set(left.walls) == {1}
    assert (items == np.flatnonzero(state.present & (state.load.walls == 1))).all()
    assert (left.positions == state.load.positions[items]).all()
    monkeypatch.setattr(agreement, "NEAR_WALLS", 3)
    assert set(agreement.boxes_left(state, 0, 3)[0].walls) == {0, 1}
    left, items = agreement.boxes_left(state, 0, agreement.WALLS)
    assert (items == np.flatnonzero(state.present)).all()


def test_a_fresh_world_lifts_the_item_it_was_asked_about(monkeypatch, state):
    """With fewer walls around, the item has another number; its distance is that of ``local``."""
    monkeypatch.setattr(agreement, "NEAR_WALLS", 1)
    local = LocalPhysics()
    local.reset(state.load)
    for item in np.flatnonzero(~state.present):
        local.remove(item)
    blocked = {item: bool(local.surroundings.on_top(item)) for item in state.visible.tolist()}
    for wanted in (True, False):
        item = next(item for item, is_so in blocked.items() if is_so == wanted)
        question, compute = agreement.fresh_job(state, item, 1)
        assert set(question) == {"settings", "boxes", "item"}
        assert compute() == pytest.approx(local.lift(item), abs=0.01)
    local.close()
    another, _ = agreement.fresh_job(state, item, agreement.WALLS)
    assert another != question
