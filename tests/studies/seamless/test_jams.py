"""Jams in seamless walls: what is lifted, and what is counted; and a second engine."""

from dataclasses import astuple, fields
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from studies.results import read_table
from studies.seamless import episodes, jam_tables, jams, mujoco_jams
from studies.seamless.jams import Case, SeamlessPhysics
from unload import task


@pytest.fixture
def simulated(monkeypatch):
    """Instead of a simulation: ``lift`` answers, ``settled`` holds how long a load has settled."""
    simulated = SimpleNamespace(settled=[], lift=lambda physics, box: 0.4 if box % 3 else 0.0)
    monkeypatch.setattr(SeamlessPhysics, "_lift", lambda physics, box: simulated.lift(physics, box))
    monkeypatch.setattr(SeamlessPhysics, "settle", lambda _, time: simulated.settled.append(time))
    return simulated


def test_the_walls_of_a_case_stand_at_the_rear():
    load = jams.load_of(Case(0))
    whole = jams.load_of(Case(0, walls=12))
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    assert low[:, 0].min() == pytest.approx(0) and high[:, 0].max() == pytest.approx(1.75)
    assert len(np.unique(load.walls)) == 3 and len(np.unique(whole.walls)) == 12
    front = whole.positions[whole.walls >= 9]
    assert load.positions[:, 1:] == pytest.approx(front[:, 1:])


def test_a_place_is_that_of_the_box():
    load = jams.load_of(Case(0))
    present = np.ones(len(load), bool)
    high = load.positions[:, 2] + load.sizes[:, 2] / 2
    corner = np.flatnonzero(
        (load.walls == load.walls.max())
        & (load.positions[:, 1] - load.sizes[:, 1] / 2 < 1e-6)
        & (high > high.max() - 1e-6)
    )[0]
    found = jams.place(load, present, corner)
    assert (found["wall"], found["edge"], found["covered"]) == (0, True, False)
    assert found["beside"] >= 1
    behind = np.flatnonzero((load.walls == load.walls.max() - 1) & (load.positions[:, 2] < 0.4))[0]
    assert jams.place(load, present, behind)["covered"]
    present[load.walls == load.walls.max()] = False
    assert not jams.place(load, present, behind)["covered"]


@pytest.mark.pybullet
@pytest.mark.slow
def test_a_published_case_is_simulated_again():
    """One of seamless walls, of which four boxes jam."""
    published = read_table("seamless/jams").query("load == 0 and friction == 0.49 and gap == 0")
    published = published[published["question"] == "fresh"].iloc[0]
    distances = np.array([row["distance"] for row in jams.lifts(Case(0, friction=0.49))])
    assert (len(distances), published["jammed"]) == (published["free"], 4)
    assert (distances < task.LIFT_THRESHOLD).sum() == 4
    assert np.median(distances) == pytest.approx(published["median"], abs=1e-5)


@pytest.mark.pybullet
def test_half_of_the_free_boxes_are_lifted_again_after_others_have_gone(simulated):
    case = Case(0, again=0.25)
    load = jams.load_of(case)
    simulated.lift = lambda physics, box: len(load) - int(physics.present.sum()) + box / 1000
    rows = jams.persistence(case)
    boxes = [row["box"] for row in rows if row["out"] == 0]
    free = jams.visible_free(load, np.ones(len(load), bool))
    assert len(boxes) == len(free) // 2 and np.isin(boxes, free).all()
    assert rows == [
        {"box": box, "out": out, "before": box / 1000, "distance": out + box / 1000}
        for out in jams.PERSISTENCE
        for box in boxes
    ]
    assert simulated.settled == [0.5, 0.25, 0.25, 0.25, 0.25]  # at first, and after each picks
    assert jams.answer("lasting", case) == rows and jams.answer("fresh", case) == jams.lifts(case)


@pytest.mark.pybullet
@pytest.mark.parametrize(("policy", "walls", "most"), [("random", 3, 9), ("highest", 2, 7)])
def test_an_episode_takes_out_what_is_lifted(simulated, set_in, policy, walls, most):
    set_in(episodes, MOST_ATTEMPTS=9, CONTAINER_ATTEMPTS=7)
    rows = episodes.episode(case := Case(0, walls=walls, settle=0.3), policy, "restore")
    assert len(rows) == most and simulated.settled == [0.3]
    load, jammed, highest = jams.load_of(case), [], []
    present, height = np.ones(len(load), bool), load.positions[:, 2]
    for row in rows:
        box, free = row["box"], jams.visible_free(load, present)
        highest.append(height[box] == max(height[np.setdiff1d(free, jammed)]))
        found = jams.place(load, present, box) | {"out": (~present).sum()}
        assert box in free and row == found | {"distance": simulated.lift(None, box)}
        present[box] = stays = row["distance"] == 0
        jammed = [*jammed, box] if stays else []
    assert all(highest) == (policy == "highest")
    assert {row["distance"] for row in rows} == {0.0, 0.4}


def attempt(box, out, jammed, covered=False, beside=1) -> dict:
    distance = 0.0 if jammed else task.LIFT_THRESHOLD
    return {"box": box, "out": out, "covered": covered, "beside": beside, "distance": distance}


def test_what_is_counted_of_all_cases_is_written(own_data, set_in):
    """Each case by itself; attempts by what was taken out, by place, and by what was between."""
    asked = [("fresh", Case(0)), ("lasting", Case(1)), ("width", Case(2, gap=-0.0001, picks=25))]
    lifts = [{"distance": distance} for distance in (0.1, task.LIFT_THRESHOLD, 0.46)]
    lasting = [
        {"box": box, "out": out, "before": before, "distance": distance}
        for out, distances in ((0, (0.1, 0.1, 0.2)), (5, (0.1, 0.3, 0.0)))
        for box, (before, distance) in enumerate(zip((0.1, 0.1, 0.2), distances))
    ]

    def answer(kind, case) -> list[dict]:
        return lasting if kind == "lasting" else lifts[: case.load + 1]

    # Of these episodes the first three are of seamless walls, three, and restored.
    played = [
        (Case(0, friction=1.0), "random", "restore"), (Case(1, friction=1.0), "random", "restore"),
        (Case(1, friction=1.0), "highest", "restore"),
        (Case(2, gap=0.001), "random", "restore"), (Case(3), "random", "keep"),
        (Case(4, walls=12), "random", "restore"),
    ]  # fmt: skip
    attempts = [
        attempt(7, 1, True), attempt(8, 1, False), attempt(7, 2, True), attempt(9, 24, False),
        attempt(7, 30, False), attempt(6, 31, True, True, 5), attempt(5, 31, False, True, 3),
    ]  # fmt: skip
    set_in(jams, cases=lambda: asked, answer=answer)
    set_in(episodes, cases=lambda: played, episode=lambda *_: attempts)
    jam_tables.both_data(1)
    tables = {
        name: read_table(f"seamless/{name}")
        for name in ("jams", "jam_lasting", "jam_episodes", "jam_first", "jam_again")
    }
    counted = tables["jams"][["question", "load", "gap", "moment", "free", "jammed", "median"]]
    assert counted.to_numpy().tolist() == [
        ["fresh", 0, 0, 0, 1, 1, 0.1], ["width", 2, -0.0001, 25, 3, 1, 0.2],
    ]  # fmt: skip
    counts = ["load", "out", "boxes", "jammed_before", "again_jammed", "newly_jammed"]
    assert tables["jam_lasting"][counts].to_numpy().tolist() == [
        [1, 0, 3, 2, 2, 0],
        [1, 5, 3, 2, 1, 1],
    ]
    assert tables["jam_episodes"].to_numpy().tolist() == [
        [case.load, case.walls, case.friction, case.gap, policy, after_pick, *counts]
        for case, policy, after_pick in played
        for counts in ((0, 4, 2), (25, 3, 1))
    ]
    assert tables["jam_first"].to_numpy().tolist() == [[1, False, 1, 9, 3], [1, True, 3, 6, 3]]
    # Box 7 of two episodes; of the first attempts with one neighbour a third jammed.
    again = tables["jam_again"][["between", "attempts", "jammed", "neighbours"]]
    assert again.to_numpy() == pytest.approx(np.array([[1, 2, 2, 2 / 3], [26, 2, 0, 2 / 3]]))


def test_what_is_published_are_the_planned_cases():
    def rows(table, names) -> list[tuple]:
        return [*table.drop_duplicates(names)[names].round(6).itertuples(index=False, name=None)]

    cases, names = [*jams.cases()], [field.name for field in fields(Case)]
    counted = read_table("seamless/jams").rename(columns={"moment": "picks"})
    assert (counted["free"][counted["walls"] == 12] == jams.MOST_LIFTS).all()
    planned = [(kind, *astuple(case)) for kind, case in cases if kind != "lasting"]
    planned = pd.DataFrame(planned, columns=["question", *names])
    assert len(counted) == len(planned)
    assert rows(counted, [*planned]) == rows(planned, [*planned])

    lasting = rows(read_table("seamless/jam_lasting"), ["load", "friction", "again"])
    of = [case for kind, case in cases if kind == "lasting"]
    assert lasting == [(case.load, case.friction, case.again) for case in of]

    keys = ["load", "walls", "friction", "gap", "policy", "after_pick"]
    played = read_table("seamless/jam_episodes")
    counts = played[played["policy"] == "random"].groupby(keys)[["attempts", "jammed"]].sum()
    for (load, walls, *_), (attempts, jammed) in counts.iterrows():
        left = len(jams.load_of(Case(load, walls))) - attempts + jammed
        most = episodes.MOST_ATTEMPTS if walls == 3 else episodes.CONTAINER_ATTEMPTS
        assert left == episodes.LEFT or attempts == most
    assert rows(played, keys) == [
        (case.load, case.walls, case.friction, case.gap, policy, after_pick)
        for case, policy, after_pick in episodes.cases()
    ]

    other = rows(read_table("seamless/mujoco_jams"), ["load", "friction", "gap", "settle"])
    of = mujoco_jams.cases()
    assert other == [(case.load, case.friction, case.gap, case.settle) for case in of]


def test_free_boxes_with_a_gap_are_lifted_by_the_second_engine_too(own_data, monkeypatch):
    mujoco, steps = pytest.importorskip("mujoco"), []
    step = mujoco.mj_step
    monkeypatch.setattr(mujoco, "mj_step", lambda *given: steps.append(step(*given)))
    case = Case(0, walls=1, friction=0.25, gap=0.001, settle=0.1)
    monkeypatch.setattr(mujoco_jams, "cases", lambda: [case])
    mujoco_jams.mujoco_data(1)
    (row,) = read_table("seamless/mujoco_jams").itertuples()
    load = jams.load_of(case)
    assert row.free == len(jams.visible_free(load, np.ones(len(load), bool)))
    assert (row.settle, row.jammed) == (0.1, 0) and row.median == pytest.approx(0.46, abs=0.02)
    times = [case.settle, *[task.LIFT_TIME] * row.free]
    assert len(steps) == sum(round(time / case.time_step) for time in times)
