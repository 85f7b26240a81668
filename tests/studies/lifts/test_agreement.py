"""The physics and the engines decide alike; the data of the lift table; lifts of a few boxes."""

from functools import partial

import numpy as np
import pandas as pd
import pytest

from studies import paths
from studies.lifts import agreement, engines
from studies.lifts import lift_table as lifts
from studies.lifts.figures import hard_situations, partly_on_top, record, top_lifts
from studies.policies import margin
from studies.policies.comparison import front_walls
from studies.results import read_provenance, read_table
from unload import policies, task
from unload.env.container import ContainerEnv
from unload.env.vector import ContainerVectorEnv
from unload.load.substacks import stack_load
from unload.physics.bullet import ENGINES, GAP
from unload.physics.local import LocalPhysics, settings_of_lifts
from unload.physics.table import LIFTS_FILE, LiftTable
from unload.support import files


def test_choice_for_full():
    """A few lifts of each state drawn, others of three and more on top, and all close ones."""
    rng = np.random.default_rng(0)
    states, on_top = np.repeat(np.arange(60), 12), np.tile(np.arange(6), 120)
    distances = rng.uniform(0, 0.46, len(states))
    frame = pd.DataFrame({"state": states, "local": distances, "on_top": on_top})
    why, walls = agreement.choose_for_full(frame, 30, np.random.default_rng(0))
    _, each = np.unique(states[why == "drawn"], return_counts=True)
    assert each.tolist() == [agreement.PER_STATE] * 10
    assert (why == "buried").sum() == 30 and on_top[why == "buried"].min() == 3
    close = (distances >= agreement.CLOSE[0]) & (distances <= agreement.CLOSE[1])
    assert (close[why == "close"]).all() and not close[why == ""].any()
    assert (walls[why == "drawn"] == 12).sum() == 2 * agreement.PER_STATE
    assert (walls[np.isin(why, ("buried", "close"))] == 5).all() and not walls[why == ""].any()


def test_a_fresh_lift_is_in_the_boxes_left_in_the_walls_around(full_load):
    present = np.ones(len(full_load), bool)
    present[:3] = False
    (item,) = np.flatnonzero(full_load.walls == 4)[-1:]
    for walls, kept in ((5, [2, 3, 4, 5, 6]), (12, range(12))):
        question, (left, box) = agreement.fresh_lift(full_load, present, item, walls)
        assert np.unique(left.walls).tolist() == [*kept] and question["item"] == box
        assert (left.positions[box] == full_load.positions[item]).all()
        assert len(left) == (present & np.isin(full_load.walls, kept)).sum()


@pytest.mark.pybullet
def test_full_is_asked_once(own_data, set_in):
    """Three lifts in a container of two walls, after 30 picks."""
    stack = {"stack": lambda rng: front_walls(stack_load(rng), 2)}
    set_in(margin, ContainerEnv=partial(ContainerEnv, **stack))
    set_in(agreement, STAGES=(30,), WANTED=(1, 1, 1, 0), LIFT_COUNT=3, FULL_COUNT=3)
    set_in(agreement, UNLOADED_BY={"highest": policies.highest}, FIRST_SEED=5)
    agreement.agreement_data()
    frame = read_table(agreement.NAME)
    assert (frame["asked_full"] == "drawn").all() and frame["full"].notna().all()
    assert not len(agreement.disagreements(frame, "local", "full"))
    assert frame["full"].max() == pytest.approx(frame["local"].max(), abs=0.01)
    assert read_provenance(agreement.NAME)["settings"]["lifts"] == 3
    written = (own_data / "lift_agreement.csv").read_bytes()
    set_in(agreement.FullPhysics, reset=None)
    agreement.agreement_data()
    assert (own_data / "lift_agreement.csv").read_bytes() == written


@pytest.mark.pybullet
def test_committed_lifts_can_be_computed_again():
    committed = read_table(agreement.NAME)
    assert list(committed) == agreement.COLUMNS
    assert len(agreement.disagreements(committed, "table", "local")) == 0
    of = {why: committed[committed["asked_full"] == why] for why in agreement.ASKED_FULL}
    assert len(of["drawn"]) >= agreement.FULL_COUNT and len(of["buried"]) == agreement.FULL_COUNT
    assert agreement.LIFT_COUNT <= len(committed) < agreement.LIFT_COUNT + 100
    close = committed["local"].between(*agreement.CLOSE)
    assert committed.loc[close, "full"].notna().all()
    settings = read_provenance(agreement.NAME)["settings"]
    assert settings["lifts"] == len(committed)
    assert all(settings[f"in full, {why}"] == len(rows) for why, rows in of.items())
    assert settings["lift table"] == files.digest(LIFTS_FILE), "another table ships: compare again"
    _, frame = agreement.collect_lifts(220, agreement.FIRST_SEED)
    assert frame["policy"].unique().tolist() == [*agreement.UNLOADED_BY]
    first = committed[: len(frame)]
    columns = ["policy", "seed", "picks", "item", "on_top", "situation"]
    assert (frame[columns] == first[columns]).all(axis=None)
    assert np.allclose(frame[["table", "local"]], first[["table", "local"]], atol=1e-6)


@pytest.mark.pybullet
def test_lift_data_depends_on_the_command_alone(own_data, set_in):
    shipped = read_provenance(LIFTS_FILE.with_suffix(""))["settings"]
    planned = [lifts.EPISODES, lifts.RANDOM_SHARE * lifts.EPISODES, lifts.SEED]
    set_in(task, NUM_ENVS=1)
    set_in(lifts, EPISODES=1, _filling_policies=lambda rng: [policies.random, policies.highest])
    seeds, reset = [], ContainerVectorEnv.reset
    set_in(ContainerVectorEnv, reset=lambda env, seed: seeds.append(seed) or reset(env, seed=seed))
    for name in "ab":
        set_in(lifts, LIFTS_FILE=own_data / f"{name}.npz")
        lifts.lift_data()
    assert (own_data / "a.npz").read_bytes() == (own_data / "b.npz").read_bytes()
    assert max(seeds) > 1_000_000  # of the loads, so that hardly any is met twice
    count = len(LiftTable.load(own_data / "a.npz"))
    assert count > 50 and [*shipped.values()][:3] == planned
    assert read_provenance("b")["settings"]["lifts"] == count


@pytest.mark.pybullet
def test_committed_lifts_of_the_second_engine_can_be_computed_again(monkeypatch):
    """Of all situations of the other comparison; a few are asked again."""
    table = read_table(engines.NAME)
    known = read_table(agreement.NAME).drop_duplicates("situation").reset_index()
    assert (table[["situation", "on_top"]] == known[["situation", "on_top"]]).all(axis=None)
    assert np.allclose(table["pybullet"], known["local"], atol=1e-6)
    assert read_provenance(engines.NAME)["settings"]["mujoco"] == settings_of_lifts("mujoco")
    lifted = table[[*ENGINES]] >= task.LIFT_THRESHOLD
    lifting = (paths.ROOT / "notebooks/10_lifting.ipynb").read_text(encoding="utf-8")
    assert f"{len(table):,} situations" in lifting
    assert (lifted["pybullet"] == lifted["mujoco"]).all()
    monkeypatch.setattr(engines, "LIFT_COUNT", 60)
    found = engines.compare_lifts()
    pd.testing.assert_frame_equal(found, table[: len(found)], rtol=0, atol=1e-4)


@pytest.mark.pybullet
def test_a_gap_lets_all_boxes_of_a_top_layer_rise_alike():
    close, apart = (top_lifts(gap, seed=0) for gap in (0, GAP))
    assert len(close) == len(apart) > 5
    assert np.ptp(apart) < 0.001 and apart.min() > 0.46
    assert close.min() < 0.35, "friction holds some of those that touch"


@pytest.mark.pybullet
def test_a_recorded_lift_moves_the_box_as_far_as_the_physics_says():
    found, physics = hard_situations(1, seed=0), LocalPhysics()
    assert len({each.key for each in found}) == len(found) > 100
    assert all(map(partly_on_top, found))
    inner = [each for each in found if each.floor is None and not each.sides]
    for situation in inner[:5]:
        sizes, poses = record(situation, (0, task.LIFT_TIME))
        assert sizes.shape == (len(situation.boxes), 2) and poses.shape == (2, len(sizes), 3)
        # Along x, which is not seen from the front, boxes hardly move.
        moved = np.hypot(*(poses[1] - poses[0])[0, :2])
        assert moved == pytest.approx(physics.simulate(situation), abs=0.01)
        assert (poses[0, situation.dynamic :] == poses[1, situation.dynamic :]).all()
