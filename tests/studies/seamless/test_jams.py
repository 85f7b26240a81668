"""Jams in seamless walls: what is lifted, and what is counted."""

from dataclasses import replace

import numpy as np
import pytest

from studies.seamless import jam_tables, jams
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
    assert (row["free"], row["jammed"], row["gap"], row["moment"]) == (4, 2, 0.0005, 25)


def test_each_question_has_its_cases():
    cases = list(jams.cases())
    assert len(set(cases)) == len(cases)
    fresh = [case for kind, case in cases if kind == "fresh"]
    found = {(case.load, case.friction, case.gap) for case in fresh}
    wanted = len(jams.LOADS) * len(jams.FRICTIONS) * len(jams.GAPS)
    assert len(found) == len(fresh) == wanted
    questions = [str(jams.question(*case)) for case in cases]
    assert len(set(questions)) == len(cases)
