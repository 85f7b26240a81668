"""Jams in seamless walls: what is lifted, and what is counted; and a second engine."""

import xml.etree.ElementTree as ElementTree
from dataclasses import astuple, fields, replace

import numpy as np
import pandas as pd
import pytest

from studies.seamless import episodes, jam_tables, jams, mujoco_jams
from studies.seamless.jams import Case
from unload import task
from unload.load.boxes import ABOVE


def test_the_walls_of_a_case_stand_at_the_rear():
    load = jams.load_of(Case(0))
    whole = jams.load_of(Case(0, walls=12))
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    assert low[:, 0].min() == pytest.approx(0) and high[:, 0].max() == pytest.approx(1.75)
    assert len(np.unique(load.walls)) == 3 and len(np.unique(whole.walls)) == 12
    front = whole.positions[whole.walls >= 9]
    assert load.positions[:, 1:] == pytest.approx(front[:, 1:])


def test_what_is_lifted_is_visible_and_free():
    load = jams.load_of(Case(1, walls=12))
    present = np.ones(len(load), bool)
    boxes = jams.visible_free(load, present)
    assert 30 < len(boxes) < 128
    assert all(not len(load.contacts.of(ABOVE, box)) for box in boxes)
    present[boxes] = False
    assert not np.isin(jams.visible_free(load, present), boxes).any()


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


@pytest.mark.slow
def test_the_more_friction_in_seamless_walls_the_more_jam():
    cases = [Case(0, walls=1, friction=friction) for friction in (0.25, 1.0)]
    cases.append(replace(cases[1], gap=0.001))
    rows = [jam_tables.count_row("fresh", case, jams.lifts(case)) for case in cases]
    few, many, none = (row["jammed"] / row["free"] for row in rows)
    assert few <= 0.1 and many >= 0.3 and none == 0
    assert {row["free"] for row in rows} == {rows[0]["free"]}


@pytest.mark.slow
def test_a_box_that_is_lifted_again_at_once_moves_as_before(monkeypatch):
    """All poses are restored, so that a jam lasts until something else changes."""
    monkeypatch.setattr(jams, "PERSISTENCE", (0, 1))
    rows = jams.persistence(Case(0, walls=1, friction=1.0))
    at_once = [row for row in rows if row["out"] == 0]
    # The first lift of all finds the contacts as they settled, the others those of the poses.
    assert [row["distance"] for row in at_once[1:]] == [row["before"] for row in at_once[1:]]
    assert at_once[0]["distance"] == pytest.approx(at_once[0]["before"], abs=0.01)
    assert {row["out"] for row in rows} == {0, 1}


def test_what_lasts_is_counted():
    lifts = [
        {"box": box, "out": out, "before": before, "distance": distance}
        for out, distances in ((0, (0.1, 0.1, 0.4)), (5, (0.1, 0.3, 0.0)))
        for box, (before, distance) in enumerate(zip((0.1, 0.1, 0.4), distances))
    ]
    first, second = jam_tables.lasting_rows(Case(2), lifts)
    counts = "boxes", "jammed_before", "again_jammed", "newly_jammed"
    assert [first[name] for name in counts] == [3, 2, 2, 0]
    assert [second[name] for name in counts] == [3, 2, 1, 1]
    assert (first["out"], second["out"], second["load"]) == (0, 5, 2)


def test_a_count_is_of_lifts_below_the_threshold():
    lifts = [{"distance": each} for each in (0.0, 0.199, task.LIFT_THRESHOLD, 0.46)]
    row = jam_tables.count_row("fresh", Case(0, gap=0.0005, picks=25), lifts)
    assert (row["free"], row["jammed"], row["gap"], row["picks"]) == (4, 2, 0.0005, 25)


def test_each_question_has_its_cases():
    cases = list(jams.cases())
    assert len(set(cases)) == len(cases)
    fresh = [case for kind, case in cases if kind == "fresh"]
    found = {(case.load, case.friction, case.gap) for case in fresh}
    wanted = len(jams.LOADS) * len(jams.FRICTIONS) * len(jams.GAPS)
    assert len(found) == len(fresh) == wanted
    other = [(case.load, case.gap, case.friction) for case in mujoco_jams.cases()]
    assert len(set(other)) == len(other) == 21


@pytest.mark.slow
@pytest.mark.parametrize("after_pick", episodes.AFTER_PICK)
def test_an_episode_takes_out_what_is_lifted(monkeypatch, after_pick):
    monkeypatch.setattr(episodes, "CONTAINER_ATTEMPTS", 15)
    rows = episodes.episode(Case(0, walls=1, friction=0.64), "highest", after_pick)
    lifted = np.array([row["distance"] >= task.LIFT_THRESHOLD for row in rows])
    out = np.array([row["out"] for row in rows])
    assert 0 < lifted.sum() < len(rows) == 15
    assert (np.diff(out) == lifted[:-1]).all() and out[0] == 0
    boxes = np.array([row["box"] for row in rows])
    assert len(np.unique(boxes[lifted])) == lifted.sum()  # none twice
    for success in np.flatnonzero(lifted):  # nor a jammed one before the next success
        since = boxes[out == out[success]]
        assert len(np.unique(since)) == len(since)


def test_jams_of_an_episode_are_counted_by_what_was_taken_out():
    attempts = [{"out": out, "distance": 0.3 * (out % 2)} for out in (0, 1, 24, 25, 49, 50)]
    rows = jam_tables.episode_rows(Case(3, friction=1.0), "random", "keep", attempts)
    assert [(row["out"], row["attempts"], row["jammed"]) for row in rows] == [
        (0, 3, 2), (25, 2, 0), (50, 1, 1)
    ]  # fmt: skip
    assert (rows[0]["load"], rows[0]["friction"], rows[0]["policy"]) == (3, 1.0, "random")


def attempt(load, box, out, jammed, covered=False, beside=1) -> dict:
    """An attempt of the random policy at a friction of 1."""
    about = {"load": load, "friction": 1.0, "policy": "random", "box": box, "out": out}
    return about | {"covered": covered, "beside": beside, "distance": 0.0 if jammed else 0.4}


def test_first_attempts_are_counted_by_place():
    rows = [
        attempt(0, 7, 0, True), attempt(0, 7, 3, False),  # the second one is no first one
        attempt(1, 7, 0, False), attempt(0, 8, 0, True, True, 5), attempt(0, 9, 0, True, True, 3),
    ]  # fmt: skip
    first = jam_tables.first_attempts(jam_tables.in_classes(pd.DataFrame(rows)))
    assert first.to_dict("records") == [
        {"friction": 1.0, "covered": False, "beside": 1, "free": 2, "jammed": 1},
        {"friction": 1.0, "covered": True, "beside": 3, "free": 2, "jammed": 2},
    ]


def test_attempts_at_boxes_that_jammed_are_counted_by_the_successes_between():
    rows = [
        attempt(0, 7, 0, True), attempt(0, 8, 0, False), attempt(0, 7, 1, True),
        attempt(0, 9, 1, False), attempt(0, 7, 30, False), attempt(0, 6, 31, True, True, 2),
        attempt(1, 7, 31, True),
    ]  # fmt: skip
    attempts = jam_tables.in_classes(pd.DataFrame(rows))
    found = jam_tables.again(attempts, jam_tables.first_attempts(attempts))
    assert found["between"].tolist() == [1, 26]
    assert found["attempts"].tolist() == [1, 1] and found["jammed"].tolist() == [1, 0]
    # Of the four first attempts with one neighbour two jammed.
    assert found["neighbours"].tolist() == [0.5, 0.5]


def test_the_model_of_the_second_engine_holds_the_boxes_of_the_case():
    case = Case(0, walls=1, friction=0.49, gap=0.001)
    world = ElementTree.fromstring(mujoco_jams.model_of(case)).find("worldbody")
    load, bodies = jams.load_of(case), world.findall("body")
    assert len(bodies) == len(load)
    # Floor and walls leave the container free, and reach as far as it does.
    low, high = np.zeros(3), task.CONTAINER
    for geom, axis, side in zip(world.findall("geom"), (2, 1, 1, 0), (0, 0, 1, 0), strict=True):
        at, half = (np.fromstring(geom.get(name), sep=" ") for name in ("pos", "size"))
        face = (at - half)[axis] if side else (at + half)[axis]
        assert face == pytest.approx((low, high)[side][axis])
        others = np.arange(3) != axis
        assert (at - half <= low)[others].all() and (at + half >= high)[others].all()
    for body, position, size in zip(bodies, load.positions, load.sizes):
        assert np.fromstring(body.get("pos"), sep=" ") == pytest.approx(position)
        halves = np.fromstring(body.find("geom").get("size"), sep=" ")
        assert 2 * halves == pytest.approx(size - [0.001, 0.001, 0])


def test_what_is_published_are_the_planned_cases():
    def rounded(rows) -> list[tuple]:
        return [tuple(round(x, 6) if isinstance(x, float) else x for x in row) for row in rows]

    names = [field.name for field in fields(Case)]
    counted = jam_tables.read_jams().rename(columns={"moment": "picks"})[["question", *names]]
    planned = [(kind, *astuple(case)) for kind, case in jams.cases() if kind != "lasting"]
    assert rounded(counted.itertuples(index=False)) == rounded(planned)

    keys = ["load", "friction", "again"]
    lasting = jam_tables.read_jams("jam_lasting").drop_duplicates(keys)[keys]
    planned = [case for kind, case in jams.cases() if kind == "lasting"]
    planned = [(case.load, case.friction, case.again) for case in planned]
    assert list(lasting.itertuples(index=False, name=None)) == planned

    keys = ["load", "walls", "friction", "gap", "policy", "after_pick"]
    played = jam_tables.read_jams("jam_episodes").drop_duplicates(keys)[keys]
    assert list(played.itertuples(index=False, name=None)) == [
        (case.load, case.walls, case.friction, case.gap, policy, after_pick)
        for case, policy, after_pick in episodes.cases()
    ]

    other = mujoco_jams.read_mujoco()[["load", "friction", "gap", "settle"]]
    planned = [(case.load, case.friction, case.gap, case.settle) for case in mujoco_jams.cases()]
    assert list(other.itertuples(index=False, name=None)) == planned


def test_free_boxes_with_a_gap_are_lifted_by_the_second_engine_too():
    pytest.importorskip("mujoco")
    lifted = mujoco_jams.distances(Case(0, walls=1, friction=0.25, gap=0.001))
    assert np.median(lifted) == pytest.approx(0.46, abs=0.02)
