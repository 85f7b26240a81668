"""Packing lists: what they may hold, and what is refused by row and id."""

import numpy as np
import pytest

from unload import read_load, stack_load
from unload.load.boxes import SMALLEST_EDGE

CORNERS = "x_min,y_min,z_min,size_x,size_y,size_z"


@pytest.fixture
def written(tmp_path):
    """``written(lines, columns)``: the path of a list of these lines."""

    def write(*lines: str, columns: str = f"id,{CORNERS}") -> str:
        (tmp_path / "boxes.csv").write_text("\n".join([columns, *lines, ""]), encoding="utf-8")
        return tmp_path / "boxes.csv"

    return write


def test_the_example_is_a_load_of_three_walls():
    load = read_load()
    assert len(load) == 136 and len(np.unique(load.walls)) == 3
    assert len(np.unique(load.packages)) == len(np.unique(load.sizes, axis=0))
    assert load.ids[0] == "M-046" and load.positions[0] == pytest.approx([6.1, 0.15, 0.15])


def test_centres_and_corners_are_the_same_boxes(written):
    corners = read_load(written("a,6,0.1,0,0.5,0.4,0.3", "b,6,0.1,0.3,0.5,0.4,0.2"))
    columns = "note, size_z, id, x, y, z, size_x, size_y"
    lines = "heavy, 0.3, a, 6.25, 0.3, 0.15, 0.5, 0.4", ", 0.2, b, 6.25, 0.3, 0.4, 0.5, 0.4"
    centres = read_load(written(*lines, columns=columns))
    for name in ("positions", "sizes", "packages", "walls"):
        assert getattr(centres, name) == pytest.approx(getattr(corners, name))
    assert corners.ids.tolist() == centres.ids.tolist() == ["a", "b"]


def test_without_ids_boxes_are_called_by_their_rows(written):
    assert read_load(written("0,0,0,1,1,1", "1,0,0,1,1,1", columns=CORNERS)).ids.tolist() == [
        "1", "2"
    ]  # fmt: skip


def test_ids_stay_as_they_are_written(written):
    ids = "007", "NA", "7"
    load = read_load(written(*(f"{name},{row},0,0,1,1,1" for row, name in enumerate(ids))))
    assert load.ids.tolist() == list(ids)


def test_a_load_that_is_written_is_read_again(written, rng):
    load = stack_load(rng, walls=4)
    columns = "x,y,z,size_x,size_y,size_z"
    rows = np.hstack([load.positions, load.sizes]).tolist()
    read = read_load(written(*(",".join(map(repr, row)) for row in rows), columns=columns))
    assert np.array_equal(read.positions, load.positions)
    assert np.array_equal(read.sizes, load.sizes)
    assert np.array_equal(read.walls, load.walls)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (
            ["a,0,0,0,1,1,1", "b,0,0.5,0,1,1,1"],
            r"row 1 \(id 'a'\), row 2 \(id 'b'\): overlap by",
        ),
        (
            ["a,0,0,0,1,1,1", "b,0,0,1.001,1,1,1"],
            r": row 2 \(id 'b'\): floats in load, its lower face at 1.001 m; .* z_min '1.001'",
        ),
        (
            ["a,0,0,0,1,1,1", "b,6.5,0,0,1,1,1"],
            r"'b'\): reaches from .* x_min '6.5'",
        ),
        (["a,0,0,0,1,1,1", "b,1,0,-0.1,1,1,1"], r": row 2 \(id 'b'\): reaches from"),
        (["a,0,0,0,1,1,1", "a,1,0,0,1,1,1"], r"row 1 \(id 'a'\), row 2 \(id 'a'\): the same id"),
        (["a,0,0,0,1,1,wide"], r": row 1 \(id 'a'\): a cell that is no number; .* size_z 'wide'"),
        (["a,0,0,0,1,1,"], r": row 1 \(id 'a'\): a cell that is no number; .* size_z ''"),
        (["a,0,0,inf,1,1,1"], r": row 1 \(id 'a'\): a cell that is no number; .* z_min 'inf'"),
        (
            [f"a,0,0,0,1,1,{SMALLEST_EDGE / 2}"],
            r"'a'\): edges of .* m; .* size_z '0.001'",
        ),
        (["a,0,0,0,1,1,-1"], r": row 1 \(id 'a'\): edges of"),
        ([f"{n},0,0,{n},1,1,1" for n in range(2, 8)], "id '6'.* and 1 more: reaches from"),
        ([], "has 0 rows and the columns id, x_min, .*; expected boxes with either"),
        (["a,0,0,0,1,1,1,5,5"], "has more cells in a row than names"),
    ],
)
def test_lists_that_are_no_load_are_refused_by_row_and_id(written, lines, message):
    with pytest.raises(ValueError, match=message):
        read_load(written(*lines))


def test_files_that_are_no_lists_are_refused(written, tmp_path):
    for columns, message in (
        ("id,x", "has 1 rows and the columns id, x; expected boxes"),
        ("ID,x", "has the column 'ID'; expected 'id', and once"),
        ("x,x", "has the column 'x.1'; expected 'x', and once"),
        ("x,y_min", "columns x, y_min; expected boxes with either x, y, z or x_min"),
    ):
        with pytest.raises(ValueError, match=message):
            read_load(written("a,1", columns=columns))
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\xff\xfe")
    (tmp_path / "empty.csv").write_bytes(b"")
    archives = [f"boxes.csv{ending}" for ending in (".zip", ".gz", ".xz", ".zst", ".bz2")]
    for name in archives:  # damaged: the beginning of one, and then nothing
        (tmp_path / name).write_bytes(b"PK\x03\x04\x1f\x8b\xfd7zXZ\x00(\xb5/\xfd")
    for name in ("picture.csv", "empty.csv", *archives):
        with pytest.raises(ValueError, match=f"{name} is not a readable CSV file"):
            read_load(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        read_load(tmp_path / "missing.csv")
