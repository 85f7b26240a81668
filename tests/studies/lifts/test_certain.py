"""Loads that never repeat, and what is certain of their lifts."""

from contextlib import nullcontext

import numpy as np
import pytest

from studies.lifts import certain
from studies.lifts.own_loads import FAMILIES
from studies.results import read_provenance, read_table
from unload import Load, task
from unload.load.boxes import BELOW, CONTACT_TOLERANCE, check_no_overhang, check_supported
from unload.physics import table
from unload.physics.bullet import ENGINES
from unload.physics.table import MIDDLE


@pytest.mark.parametrize("family", FAMILIES)
def test_loads_whose_joints_lie_anywhere_are_taken_or_refused_rightly(family, rng):
    """Whole ones are taken, and of those that lack some boxes what their definition says."""
    refused = 0
    for _ in range(12):
        load = FAMILIES[family](rng)
        check_supported(load)
        check_no_overhang(load)
        kept = rng.random(len(load)) > 0.02
        load = Load(load.positions[kept], load.sizes[kept])
        hanging = overhangs(load)
        refused += bool(hanging)
        with pytest.raises(ValueError, match="hangs over") if hanging else nullcontext():
            check_no_overhang(load)
    assert refused > 0 or family.endswith("columns")


def overhangs(load: Load) -> list[tuple[int, int]]:
    """All pairs of a box and one under it on which it does not rest, directly or over others."""
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    shared = np.minimum(high[:, None], high) - np.maximum(low[:, None], low)
    rests = np.zeros((len(load), len(load)), bool)
    rests[load.contacts.pairs(BELOW)] = True
    for box in low[:, 2].argsort(kind="stable"):  # what is below has been looked at
        rests[box] |= rests[rests[box]].any(axis=0)
    under = (shared[..., :2] > CONTACT_TOLERANCE).all(axis=-1) & (low[:, None, 2] > low[:, 2])
    return list(zip(*np.nonzero(under & ~rests)))


@pytest.mark.pybullet
def test_a_few_lifts_are_asked_anew(set_in):
    """Of each family and part, from the same seeds: the committed rows, to the micrometre."""
    committed = read_table(certain.NAME)
    assert list(committed) == certain.COLUMNS
    set_in(certain, PARTS={name: (seed, 3) for name, (seed, _) in certain.PARTS.items()})
    found = certain.ask_all()
    first = committed.groupby(["part", "family"], sort=False).head(3).reset_index(drop=True)
    assert found["answer"].tolist() == first["answer"].tolist()
    numbers = [*certain.COLUMNS[2:4], *certain.COLUMNS[5:]]
    np.testing.assert_allclose(found[numbers], first[numbers], atol=1e-6)


def test_the_published_answers_are_right_and_of_todays_bounds():
    frame, settings = read_table(certain.NAME), read_provenance(certain.NAME)["settings"]
    assert all(settings[name] == getattr(table, name.upper()) for name in certain.BOUNDS)
    middle = frame["answer"] == certain.ANSWERS[1]
    assert (frame.loc[middle, "farthest"] <= MIDDLE + 1e-6).all()
    left = frame[~middle & (frame["on_top"] < 3) & (frame["farthest"] < MIDDLE - 1e-6)]
    assert {*left["family"]} <= {"eccentric columns", *certain.STACKS}, "too small ones"
    between = frame[frame["answer"] == certain.ANSWERS[2]]
    assert (between["farthest"] <= np.hypot(MIDDLE, 1) + 1e-6).all()
    assert {"bricked walls", certain.STACKS[1]} <= {*between["family"]}
    assert certain.STACKS[0] not in {*between["family"]}, "these stand alone"
    rows = certain.by_answer(frame)
    assert rows.loc["all", "lifts"] == len(frame) == rows["lifts"].sum() / 2
    assert rows.loc["all", "at most"] < 0.001
    for engine in ENGINES:
        assert not rows.loc[[*certain.ANSWERS[:3]], f"wrong, {engine}"].any(), "by a rule"
        assert rows.loc["all", f"wrong, {engine}"] < len(frame) / 1000
    assert (frame["part"] == "drawn anew").sum() >= 3000
    for part, (families, answer) in certain.ONLY.items():
        drawn = frame[frame["part"] == part]
        assert {*drawn["family"]} == {*families}
        assert {answer} <= {*drawn["answer"]} <= {answer, certain.ANSWERS[-1]}
    assert (rows.loc[[*certain.ANSWERS[:3]], "at most"] < 0.02).all()


def test_wrong_answers_are_counted():
    frame = read_table(certain.NAME).groupby("answer").head(20).copy()
    frame["table_pybullet"] = np.where(frame["pybullet"] < task.LIFT_THRESHOLD, 0.46, 0.0)
    rows = certain.by_answer(frame)
    assert rows["wrong, pybullet"].tolist() == [20, 20, 20, 20, 20, 100]
    assert rows.loc["all", "wrong, mujoco"] == 0
    assert rows.loc["all", "at most"] == 1
