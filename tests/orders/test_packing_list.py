"""Packing lists: what they may hold, and what is refused by row and id."""

import numpy as np
import pandas as pd
import pytest

from unload import Load, picking_order, read_load
from unload.load.boxes import _SMALLEST_EDGE
from unload.orders.packing_list import ListError

CORNERS = "x_min,y_min,z_min,size_x,size_y,size_z"
UNIT = "a,0,0,0,1,1,1"
STACK = "a,6,0.1,0,0.5,0.4,0.3", "b,6,0.1,0.3,0.5,0.4,0.2"


@pytest.fixture
def written(tmp_path):
    """``written(lines, columns)``: the path of a list of these lines."""

    def write(*lines: str, columns: str = f"id,{CORNERS}") -> str:
        (tmp_path / "boxes.csv").write_text("\n".join([columns, *lines, ""]), encoding="utf-8")
        return tmp_path / "boxes.csv"

    return write


def test_ids_stay_as_they_are_written_and_are_else_the_rows(written):
    rows = [f"{row},0,0,1,1,1" for row in range(3)]
    for ids in (["007", "NA", "7"], ["1", "2", "3"]):
        lines = [f"{name},{row}" for name, row in zip(ids, rows)]
        assert read_load(written(*lines)).ids.tolist() == ids
    assert read_load(written(*rows, columns=CORNERS)).ids.tolist() == ids


def test_a_box_without_an_id_is_refused(written):
    """As from merged cells, of which the first alone holds what is seen."""
    with pytest.raises(ListError, match=r"^row 2 \(id ''\): id is empty; expected one for each"):
        read_load(written(STACK[0], STACK[1].replace("b", " ", 1)))
    table = pd.read_csv(written(*STACK))
    for missing in (None, np.nan, pd.NaT):
        with pytest.raises(ListError, match=r"^row 1 \(.*: id is empty; expected one for each"):
            read_load(table.assign(id=[missing, "b"]))


def assert_same(one: Load, other: Load) -> None:
    for name in ("positions", "sizes", "packages", "walls", "container"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), abs=1e-12)
    assert one.ids.tolist() == other.ids.tolist()


@pytest.mark.parametrize(
    ("separator", "mark", "encoding"),
    [(",", ".", "utf-8-sig"), ("\t", ".", "utf-8"), ("\t", ",", "utf-8"),
     (";", ",", "utf-8-sig"), (";", ".", "utf-8")],
)  # fmt: skip
def test_separators_decimals_and_encodings(written, tmp_path, separator, mark, encoding):
    lines = [f"ID,{CORNERS.upper()},Ort", *(f"{line},Köln 1.2" for line in STACK)]
    text = "\r\n".join(lines).replace(",", separator).replace(".", mark)
    (tmp_path / "list.csv").write_bytes(text.encode(encoding))
    read = read_load(tmp_path / "list.csv")
    assert_same(read, read_load(written(*STACK)))
    assert read.extras["Ort"].tolist() == [f"Köln 1{mark}2"] * 2


@pytest.mark.parametrize(
    ("columns", "factor", "arguments"),
    [
        (f"id,{CORNERS}", 1 / 0.0254, {"units": "in"}),
        ("Id,Pos_X,pos_y,pos_z,LENGTH_cm,width_cm,height_cm", 100, {"units": "cm"}),
        ('ID,X Min (mm),Y min [mm],z-min_mm,"length (mm)",Width mm,Height_mm', 1000, {}),
        ("nr,u,v,w,a,b,c", 1, {"columns": dict(zip("uvwabc", CORNERS.split(","))) | {"nr": "id"}}),
        ("Id,x_min,y_min,z_min,Länge,width,height", 1, {"columns": {"Länge": "size_x"}}),
    ],
)  # fmt: skip
def test_names_and_units(written, columns, factor, arguments):
    expected = read_load(written(*STACK))
    cells = pd.DataFrame([line.split(",") for line in STACK])
    numbers = (cells.iloc[:, 1:].astype(float) * factor).map(repr)
    lines = pd.concat([cells[0], numbers], axis=1).agg(",".join, axis=1)
    assert_same(read_load(written(*lines, columns=columns), **arguments), expected)


@pytest.mark.parametrize("mark", [",", "."])
def test_what_may_be_thousands_or_decimals_of_mm_is_refused(written, mark):
    """1.200 was once 1.2 mm, and the order that of another load. In m it is clear."""

    def read(*lines: str, units: str = "mm") -> Load:
        path = written(*(line.replace(".", mark) for line in lines), columns=columns)
        return read_load(path, units)

    columns = f"id,{CORNERS}".replace(",", ";")
    lines = "a;0;600;0;600;400;300", "b;0;1.200;0;600;400;300.5"
    with pytest.raises(ListError, match=r"^row 2 \(id 'b'\): '1.200' in mm may have thousands or"):
        read(*lines)
    for clear in ("c;1000.125;0;0;600;400;300", "c;1000;0.0;0;600;400;300"):
        assert read(*lines, clear).positions[1, 1] == pytest.approx(0.2012)
    assert read("b;0;1.200;0;1;1;1", units="m").positions[0, 1] == 1.7


def test_a_table_is_a_list_too(written):
    table = pd.read_csv(written(*STACK), index_col=None).set_index(pd.Index([5, 7]))
    assert_same(read_load(table), read_load(written(*STACK)))
    assert not read_load(table).extras
    stops = {"stop": [1, np.nan], "share": [0.5, 1e-5]}
    kept = read_load(table.assign(**stops, note="a")).extras
    assert all(np.array_equal(kept[name], stops[name], equal_nan=True) for name in stops)
    with pytest.raises(ValueError, match=r"^row 2 \(id 'b'\): size_x is 'nan'; expected a number"):
        read_load(table.assign(size_x=[0.5, None]))


def test_a_sheet_is_a_list_too(written, tmp_path):
    """Ids stay text, and what is empty around the table is left out."""
    pytest.importorskip("openpyxl")
    table = pd.read_csv(written(*STACK)).assign(id=["007", "b"], stop=[2, 10])
    table.to_excel(tmp_path / "list.xlsx", index=False, startrow=2, startcol=1)
    load = read_load(tmp_path / "list.xlsx")
    assert load.ids.tolist() == ["007", "b"] and load.extras["stop"].tolist() == [2, 10]
    assert np.array_equal(load.positions, read_load(written(*STACK)).positions)


def test_x_may_count_from_the_entrance_of_a_container_of_ones_own(written):
    """Corners and centres are the same boxes, with spaces and in any order of the columns, too."""
    corners = "a,0.5,0.1,0,0.5,0.4,0.3", "b,0.5,0.1,0.3,0.5,0.4,0.2"
    centres = "heavy, 0.3, a, 0.75, 0.3, 0.15, 0.5, 0.4", ", 0.2, b, 0.75, 0.3, 0.4, 0.5, 0.4"
    others = "note, size_z, id, x, y, z, size_x, size_y"
    for lines, columns in ((corners, f"id,{CORNERS}"), (centres, others)):
        load = read_load(written(*lines, columns=columns), x_from="door")
        assert_same(load, read_load(written(*STACK)))
    path = written("a,11,0.1,0,0.5,0.4,0.3")
    assert read_load(path, container=(12.03, 2.35, 2.39)).positions[0, 0] == 11.25
    assert read_load(path, container=(12, 2, 2), x_from="door").positions[0, 0] == 0.75


def test_corners_that_are_read_as_centres_are_refused_with_what_to_write(written, tmp_path):
    """Of a box on the floor the centre is none. What does not help is not said."""
    columns, lines = "id,X (cm),y,z,size_x,size_y,size_z", ("a,600,1,0,1,1,1", "b,600,1,1,1,1,1")
    said = "inside the container.*; if these are no centres but corners: X .cm.=x_min, y=y_min, z="
    with pytest.raises(ListError, match=f"{said}z_min; see the argument columns$"):
        read_load(written(*lines, columns=columns))
    meant = {"X (cm)": "x_min", "y": "y_min", "z": "z_min"}
    load = read_load(written(*lines, columns=columns), columns=meant)
    assert load.positions.tolist() == [[6.5, 1.5, 0.5], [6.5, 1.5, 1.5]]
    for line, argument in (("a,0,0.6,0.6,1,1,1", "container"), ("a,500,1,0,99,1,1", "units")):
        with pytest.raises(
            ListError, match=f"inside the container.* m; see the argument {argument}$"
        ):
            read_load(written(line, columns=columns))


def test_small_faults_are_settled_and_logged(written, caplog):
    lines = "a,-0.001,0,0,1,1,1", "b,1,0,0,1,1,1", "c,0.5,0,1.003,1,1,1", "d,2.004,0,0,1,1,1"
    load = read_load(written(*lines))
    assert (load.positions - load.sizes / 2).tolist() == [
        [0, 0, 0], [1, 0, 0], [0.5, 0, 1], [2.004, 0, 0]
    ]  # fmt: skip
    assert load.contact_tolerance == 0.005
    assert "2 of 4 boxes moved by up to 3.0 mm" in caplog.text
    assert "may overlook overlaps of up to 16 mm" in caplog.text  # twice 5 + 3
    with pytest.raises(ValueError, match=r"row 3 \(id 'c'\): floats.*see the argument tolerance"):
        read_load(written(*lines), tolerance=0.0012)
    assert len(read_load(written(*STACK), tolerance=0)) == 2
    bridge = "e,0,0,1.001,1,2,1"  # stands on the higher of two boxes, and holds down both
    load = read_load(written("a,0,0,0,1,1,1", "d,0,1,0,1,1,1.001", bridge))
    assert load.covered(np.ones(3, bool)).tolist() == [True, True, False]


def test_other_columns_are_kept(written):
    """As numbers where all cells are written as numbers; a weight is one of them."""
    columns = f"stop,code,parcel,note,name,{CORNERS},id,weight_kg,yaw,pitch"
    lines = (
        "2,07,3401234500000017,,B,6,0.1,0,0.5,0.4,0.3,a,25,90,0",
        "1,11,1.5,top,C,6,0.1,0.3,0.5,0.4,0.2,b,123456789.012345,-90,0",
    )
    load = read_load(written(*lines, columns=columns))
    assert load.ids.tolist() == ["a", "b"]
    kept = {name: values.tolist() for name, values in load.extras.items()}
    assert kept == {
        "stop": [2, 1], "code": ["07", "11"], "parcel": ["3401234500000017", "1.5"],
        "note": ["", "top"], "name": ["B", "C"],
        "weight_kg": [25, 123456789.012345], "yaw": [90, -90], "pitch": [0, 0],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"units": "yard"}, "units is 'yard'; expected one of 'm', 'cm', 'mm', 'in'"),
        ({"tolerance": 1}, r"tolerance is 1; expected a number in \[0, 0.1\]"),
        ({"x_from": "front"}, "x_from is 'front'; expected one of 'rear', 'door'"),
        ({"container": (1, 2)}, "container has shape"),
        ({"columns": {"size_x": ["id"]}}, r"columns is \['id'\]; expected one of 'x', 'y'"),
        ({"columns": {"sizex": "size_x"}}, "columns is 'sizex'; expected one of 'id', 'x_min'"),
        ({"columns": ["size_x"]}, r"columns is \['size_x'\]; expected a dict"),
    ],
)
def test_wrong_arguments_are_refused(written, arguments, message):
    with pytest.raises((TypeError, ValueError), match=message):
        read_load(written(*STACK), **arguments)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([UNIT, "b,0,0.5,0,1,1,1"], r"row 1 \(id 'a'\), row 2 \(id 'b'\): overlap by.*tolerance"),
        ([UNIT, "b,0,0,1.01,1,1,1"], r"row 2 .*: floats in load, .* at 1.01 m; .* tolerance$"),
        ([UNIT, "b,0.6,0,1,1,1,1"], r"row 2 \(id 'b'\): tips, because nothing.*tolerance$"),
        (["a,0,0,0,350,450,300"], "see the argument units$"),
        (["a,0,0,30,0.3,0.3,0.3"], "see the argument units$"),
        ([UNIT, "b,6.5,0,0,1,1,1"], r"'b'\): reaches from .* see the argument container$"),
        (["b,6.006,0,0,1,1,1"], r"'b'\): reaches from .* see the argument tolerance$"),
        ([UNIT, "a,1,0,0,1,1,1"], r"1 \(id 'a'\), row 2 \(id 'a'\): the same .* each box$"),
        (
            ["a,0,0,0,1,1,wide"],
            r"row 1 \(id 'a'\): size_z is 'wide'; expected a number, at most 1,000,000$",
        ),
        (["a,0,0,0,1,1"], r"row 1 \(id 'a'\): size_z is ''; expected a number"),
        (["a,1e308,0,0,1,1,1"], r"row 1 \(id 'a'\): x_min is '1e308'; expected a number, at most"),
        (["a,0,0,0,1,1,0"], r"row 1 \(id 'a'\): edges of \[1. 1. 0.\] m; expected >= 0.002 m$"),
        (["a,0,0,0,1,1,-1"], r"row 1 \(id 'a'\): edges of \[ 1.  1. -1.\] m; expected >= 0.002 m$"),
        ([f"a,0,0,0,1,1,{_SMALLEST_EDGE / 2}"], r"'a'\): edges of .* m; expected >= 0.002 m$"),
        ([f"{n},0,0,{n},1,1,1" for n in range(2, 8)], r"row 5 \(id '6'\) and 1 more: reaches"),
        ([f"{n},0,{n / 2},0,1,0.51,1" for n in range(5)], r"5 \(id '4'\): reaches"),
        ([], "has the columns .*'x_min'.* and no row; expected boxes"),
    ],
)
def test_lists_that_are_no_load_are_refused_by_row_and_id(written, lines, message):
    with pytest.raises(ValueError, match=message):
        read_load(written(*lines))


@pytest.mark.parametrize("angle", ["179", "15.0", ""])
def test_a_box_that_is_not_turned_by_quarters_is_refused(written, angle):
    path = written(f"{STACK[0]},180", f"{STACK[1]},{angle}", columns=f"id,{CORNERS},Rotation")
    with pytest.raises(ValueError, match=r"row 2 \(id 'b'\): .*Rotation"):
        read_load(path)


def test_columns_are_refused_by_their_names(written):
    for columns, message in (
        (f"x,y,z,{CORNERS},id", "expected either x, y, z or x_min, y_min, z_min; .* columns$"),
        (f"{CORNERS},length", "expected one 'size_x'$"),
        (f"{CORNERS},note,note", "expected one 'note'$"),
        ("x,y,z,size_x,Breite,height", r"\['x', .* 'height'\]; expected size_y; .* columns$"),
    ):
        cells = ",".join("1" for _ in columns.split(","))
        with pytest.raises(ValueError, match=message):
            read_load(written(cells, columns=columns))


def test_a_sentence_holds_no_more_names_than_one_reads(written):
    """Of a list with many columns, which have long ones."""
    long = ",".join(f"{number:0900}" for number in range(190))
    whole, row = f"{CORNERS},{long}", "1,1,0" + 193 * ",1"
    for columns, lines, arguments in (
        (whole, [], {}),
        (f"id,{long}", ["1"], {}),
        (f"{whole},note,note", [row], {}),
        (whole, [row], {"columns": {"Länge": "size_x"}}),
    ):
        with pytest.raises(ValueError, match="^.{1000,1200}$"):
            read_load(written(*lines, columns=columns), **arguments)
    with pytest.raises(ValueError, match="^.{1000,1200}$"):
        picking_order(read_load(written(row, columns=whole)), "stop")


def test_a_row_that_is_too_long_becomes_smaller(written, caplog):
    """Two rows, each 15 mm longer than the container is wide."""
    lines = [f"{n},{x},{0.5 * n},0,1,0.503,1" for x in (0, 1) for n in range(5)]
    load = read_load(written(*(line.replace(",", f"-{row},", 1) for row, line in enumerate(lines))))
    assert (load.positions + load.sizes / 2)[:, 1].max() <= 2.5
    assert (0.503 - load.sizes[:, 1]).max() == pytest.approx(0.003)
    assert "10 of 10 boxes taken for smaller, by up to 3.0 mm" in caplog.text
    assert "may overlook overlaps of up to 16 mm" in caplog.text  # twice 5 + 3 / 2 + 3 / 2
