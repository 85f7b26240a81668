"""The memory of lifts."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from unload.physics import lift_table
from unload.physics.bullet import SETTINGS
from unload.physics.lift_table import FEWEST_SLOTS, LiftTable
from unload.physics.situation import Situation
from unload.support import files


def situation(number: int) -> Situation:
    """One of many different situations."""
    return Situation(np.array([[0, 0, 0, number, 2, 3]], np.int32), 1, None, ())


def entries_of(table: LiftTable) -> list[list[int]]:
    return [array.tolist() for array in table.entries()]


@pytest.fixture
def table() -> LiftTable:
    """A table of 50 lifts, the one of situation k over k mm."""
    table = LiftTable()
    for number in range(50):
        table.add(situation(number), number / 1000)
    return table


def test_a_table_finds_what_was_added(table):
    for number in range(50):
        assert table.find(situation(number)) == number / 1000
    assert table.find(situation(50)) is None and len(table) == 50


def test_a_known_situation_keeps_its_distance(table):
    table.add(situation(3), 0.4)
    assert table.find(situation(3)) == 0.003 and len(table) == 50


def test_a_table_grows_and_forgets_nothing(table):
    old = table.slots
    for number in range(50, 2000):
        table.add(situation(number), number / 1000)
    digests, micrometres = table.slots
    assert len(digests) == len(micrometres) == 4096 and len(table) == 2000
    assert all(table.find(situation(number)) == number / 1000 for number in range(2000))
    # Whoever still reads the first arrays finds in them what they held when they were full.
    assert len(old[0]) == FEWEST_SLOTS and (old[0] != 0).sum() == FEWEST_SLOTS // 2 + 1
    assert table.find(situation(2000)) is None


def test_entries_are_sorted_whatever_the_order_in_which_they_came(table, rng):
    other = LiftTable()
    for number in rng.permutation(50).tolist():
        other.add(situation(number), number / 1000)
    digests, micrometres = table.entries()
    assert digests.dtype == np.uint64 and micrometres.dtype == np.int32
    assert (digests[1:] > digests[:-1]).all() and set(micrometres) == set(range(0, 50_000, 1000))
    assert entries_of(other) == entries_of(table)


def test_threads_find_and_add_at_the_same_time(monkeypatch):
    """While the arrays grow several times: nobody meets a wrong distance, and none is lost."""
    table = LiftTable()

    def work(first: int) -> list:
        wrong = []
        for number in range(first, 6000, 4):
            table.add(situation(number), number / 1000)
            for known in range(first, number, 997):
                if table.find(situation(known)) not in (None, known / 1000):
                    wrong.append(known)
        return wrong

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(work, range(4))) == [[]] * 4
    assert len(table) == 6000
    assert all(table.find(situation(number)) == number / 1000 for number in range(6000))


def test_a_slot_that_another_thread_fills_meanwhile_is_not_taken_for_the_own(monkeypatch):
    table, find_slot = LiftTable(), lift_table.slot_of

    def then_filled(digests, digest):
        slot = find_slot(digests, digest)
        monkeypatch.undo()
        digests[slot], table.slots[1][slot] = digest + np.uint64(1), 400_000
        return slot

    monkeypatch.setattr(lift_table, "slot_of", then_filled)
    assert table.find(situation(0)) is None


@pytest.mark.parametrize("distance", [-0.001, float("nan"), float("inf"), 2148.0])
def test_bad_distances_are_refused(table, distance):
    with pytest.raises(ValueError, match="distance is"):
        table.add(situation(99), distance)
    assert len(table) == 50 and table.find(situation(99)) is None


# --- files --------------------------------------------------------------------------


def test_a_saved_table_finds_the_same(table, tmp_path):
    table.save(tmp_path / "lifts.npz")
    read = LiftTable.load(tmp_path / "lifts.npz")
    assert all(read.find(situation(number)) == number / 1000 for number in range(50))
    assert len(read) == 50
    read.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "lifts.npz").read_bytes()
    read.add(situation(50), 0.05)
    assert len(read) == 51 and read.find(situation(50)) == 0.05


def test_an_empty_table_is_saved_too(tmp_path):
    LiftTable().save(tmp_path / "lifts.npz")
    assert len(LiftTable.load(tmp_path / "lifts.npz")) == 0


def test_a_damaged_file_is_refused(tmp_path):
    (tmp_path / "damaged.npz").write_bytes(b"no zip file")
    with pytest.raises(ValueError, match="damaged.npz"):
        LiftTable.load(tmp_path / "damaged.npz")
    with pytest.raises(FileNotFoundError):
        LiftTable.load(tmp_path / "missing.npz")


def settings_of(**changes) -> np.ndarray:
    """The settings in JSON; a change to None leaves one out."""
    settings = {name: value for name, value in (SETTINGS | changes).items() if value is not None}
    return np.array(json.dumps(settings))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"digests": None}, r"holds \['micrometres', 'settings'\]; expected a lift table"),
        ({"extra": np.zeros(3)}, "expected a lift table"),
        ({"settings": settings_of(friction=0.7)}, "friction is 0.7 there and 0.5 here"),
        ({"settings": settings_of(gap=None)}, "gap is 'missing' there and 0.001 here"),
        ({"settings": settings_of(wind=3)}, "wind is 3 there and 'missing' here"),
        ({"settings": np.array("[]")}, r"has settings '\[\]'; expected those of a physics"),
        ({"settings": np.array("{")}, "has settings '{'"),
        ({"settings": np.array("[" * 100_000)}, "expected those of a physics"),
        ({"settings": np.zeros(2)}, "expected those of a physics"),
        ({"digests": np.array([3, 2], np.uint64)}, "digests out of order"),
        ({"digests": np.array([2, 2], np.uint64)}, "digests out of order"),
        ({"digests": np.array([0, 2], np.uint64)}, "digests out of order"),
        ({"digests": np.array([1, 2])}, "digests of shape .* and dtype int64; .* uint64"),
        ({"digests": np.ones((2, 1), np.uint64)}, r"digests of shape \(2, 1\)"),
        ({"digests": np.uint64(1)}, r"digests of shape \(\)"),
        ({"micrometres": np.array([1, 2, 3], np.int32)}, r"micrometres of shape \(3,\)"),
        ({"micrometres": np.array([1.0, 2.0])}, "micrometres .* dtype float64; .* int32"),
        ({"micrometres": np.array([1, 2])}, "micrometres .* dtype int64; .* int32"),
        ({"micrometres": np.array([-1, 2], np.int32)}, "holds -1 micrometres; expected all >= 0"),
    ],
)
def test_other_files_are_refused_by_name(changes, message, tmp_path):
    good = {
        "digests": np.array([1, 2], np.uint64),
        "micrometres": np.array([5, 6], np.int32),
        "settings": settings_of(),
    }
    arrays = {name: array for name, array in (good | changes).items() if array is not None}
    files.write_arrays(tmp_path / "good.npz", good)
    assert len(LiftTable.load(tmp_path / "good.npz")) == 2
    files.write_arrays(tmp_path / "other.npz", arrays)
    with pytest.raises(ValueError, match=f"other.npz .*{message}"):
        LiftTable.load(tmp_path / "other.npz")
