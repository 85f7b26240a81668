"""Packing lists: what they may hold, and what is refused by row and id."""

import json

import numpy as np
import pandas as pd
import pytest

from unload import Load, read_load
from unload.load.boxes import _SMALLEST_EDGE

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


def assert_same(one: Load, other: Load) -> None:
    for name in ("positions", "sizes", "packages", "walls", "container"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), abs=1e-12)
    assert one.ids.tolist() == other.ids.tolist()


@pytest.mark.parametrize(
    ("separator", "mark", "encoding"),
    [(",", ".", "utf-8-sig"), (",", ".", "utf-16"), ("\t", ".", "utf-8"), ("\t", ",", "utf-8"),
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
        ("label,pos_x,pos_y,pos_z,length_cm,width_cm,height_cm", 100, {}),
        ('Box ID,X Min (mm),Y min [mm],z-min in mm,"L (mm)",W mm,H_mm', 1000, {"units": "m"}),
        ('id,x_min inch,y_min,z_min,"depth ("")",width inches,height in', 1 / 0.0254, {}),
        ("Kolli-Nr.,x_min (ft),y_min,z_min,l,b,h (ft)", 1 / 0.3048, {}),
        ("nr,u,v,w,a,b,c", 1, {"columns": dict(zip("uvwabc", CORNERS.split(","))) | {"nr": "id"}}),
        ("N° colis,pos_x,pos_y,pos_z,Longueur,Largeur,Hauteur", 1, {}),
    ],
)  # fmt: skip
def test_names_and_units(written, columns, factor, arguments):
    expected = read_load(written(*STACK))
    cells = pd.DataFrame([line.split(",") for line in STACK])
    numbers = (cells.iloc[:, 1:].astype(float) * factor).map(repr)
    lines = pd.concat([cells[0], numbers], axis=1).agg(",".join, axis=1)
    assert_same(read_load(written(*lines, columns=columns), **arguments), expected)


def test_a_table_is_a_list_too(written):
    table = pd.read_csv(written(*STACK), index_col=None).set_index(pd.Index([5, 7]))
    assert_same(read_load(table), read_load(written(*STACK)))
    assert not read_load(table).extras
    stops = {"stop": [1, np.nan], "share": [0.5, 1e-5]}
    kept = read_load(table.assign(**stops, note="a")).extras
    assert all(np.array_equal(kept[name], stops[name], equal_nan=True) for name in stops)
    with pytest.raises(ValueError, match=r"the table: row 2 \(id 'b'\): a cell that is no number"):
        read_load(table.assign(size_x=[0.5, None]))


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


def test_small_faults_are_settled_and_logged(written, caplog):
    lines = "a,-0.001,0,0,1,1,1", "b,1,0,0,1,1,1", "c,0.5,0,1.003,1,1,1", "d,2.004,0,0,1,1,1"
    load = read_load(written(*lines))
    assert (load.positions - load.sizes / 2).tolist() == [
        [0, 0, 0], [1, 0, 0], [0.5, 0, 1], [2.004, 0, 0]
    ]  # fmt: skip
    assert "2 of 4 boxes moved by up to 3.0 mm" in caplog.text
    with pytest.raises(ValueError, match=r"row 3 \(id 'c'\): floats.*, tolerance 0.0012 m"):
        read_load(written(*lines), tolerance=0.0012)
    bridge = "e,0,0,1.001,1,2,1"  # stands on the higher of two boxes, and holds down both
    load = read_load(written("a,0,0,0,1,1,1", "d,0,1,0,1,1,1.001", bridge))
    assert load.covered(np.ones(3, bool)).tolist() == [True, True, False]


def test_other_columns_are_kept_and_named(written, caplog):
    columns = f"stop,code,note,name,{CORNERS},id,weight_kg,yaw,pitch"
    lines = "2,07,,B,6,0.1,0,0.5,0.4,0.3,a,1,90,0", "1,11,top,C,6,0.1,0.3,0.5,0.4,0.2,b,1.0,-90,0"
    load = read_load(written(*lines, columns=columns))
    assert load.ids.tolist() == ["a", "b"]
    kept = {name: values.tolist() for name, values in load.extras.items()}
    assert kept == {
        "stop": [2, 1], "code": ["07", "11"], "note": ["", "top"], "name": ["B", "C"],
        "weight_kg": [1, 1], "yaw": [90, -90], "pitch": [0, 0],
    }  # fmt: skip
    assert "kept as they are: stop, code, note, name\n" in caplog.text
    assert "sizes are taken for those after the turns" in caplog.text


@pytest.mark.parametrize(
    ("name", "good", "bad", "message"),
    [
        ("weight", "1", "0", r"a mass of 0.0 kg; expected >= 0.001 kg.* has weight '0'"),
        ("mass_kg", "1.0", "", "a cell that is no number; .*mass_kg ''"),
        ("pitch deg", "180", "179", "a rotation that is no quarter turn; .* 'pitch deg' in ignore"),
        ("rotation (rad)", "3.1415926536", "1.5", "a rotation that is no quarter turn"),
    ],
)
def test_what_the_task_leaves_out_is_refused_unless_ignored(written, name, good, bad, message):
    path = written(f"{STACK[0]},{good}", f"{STACK[1]},{bad}", columns=f"id,{CORNERS},{name}")
    with pytest.raises(ValueError, match=rf": row 2 \(id 'b'\): {message}"):
        read_load(path)
    for ignored in (name, name.lower().split(" ")[0].removesuffix("_kg")):
        assert str(read_load(path, ignore=[ignored]).extras[name][1]) == bad


def test_two_units_leave_that_of_a_third_column_open(written, caplog):
    columns = "id,x_min,y_min,z_min,length_mm,width_cm,height_mm"
    path = written("a,6,0.1,0,500,40,300", columns=columns)
    with pytest.raises(ValueError, match="says no unit of x_min, y_min, z_min; expected units"):
        read_load(path)
    load = read_load(path, units="m")
    assert load.sizes.tolist() == [[0.5, 0.4, 0.3]]
    assert load.positions[0] == pytest.approx([6.25, 0.3, 0.15])
    read_load(written("a,600,10,0,50,40,30", columns=columns.replace("mm", "cm")))
    assert "in the unit of the other lengths: x_min, y_min, z_min\n" in caplog.text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"units": "yard"}, "units is 'yard'; expected one of None, 'm', 'cm', 'mm', 'in'"),
        ({"tolerance": 1}, r"tolerance is 1; expected a number in \[0, 0.1\]"),
        ({"x_from": "front"}, "x_from is 'front'; expected one of 'rear', 'door'"),
        ({"container": (1, 2)}, "container has shape"),
        ({"ignore": "weight"}, "ignore is 'weight'; expected a list"),
        ({"ignore": ["wight"]}, "has no column 'wight'; expected one of .*'x_min'"),
        ({"columns": {"size_x": ["id"]}}, r"columns is \['id'\]; expected one of 'id', 'size_x'"),
    ],
)
def test_wrong_arguments_are_refused(written, arguments, message):
    with pytest.raises((TypeError, ValueError), match=message):
        read_load(written(*STACK), **arguments)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([UNIT, "b,0,0.5,0,1,1,1"], r"row 1 \(id 'a'\), row 2 \(id 'b'\): overlap by"),
        ([UNIT, "b,0,0,1.01,1,1,1"], r"row 2 .*: floats in load, .* at 1.01 m; .* z_min '1.01'"),
        ([UNIT, "b,0.6,0,1,1,1,1"], r": row 2 \(id 'b'\): tips, because nothing"),
        (["a,0,0,0,350,450,300"], "; in m, expected cm"),
        ([UNIT, "b,6.5,0,0,1,1,1"], r"'b'\): reaches from .* 0.005 m; .* its size as container"),
        ([UNIT, "a,1,0,0,1,1,1"], r"1 \(id 'a'\), row 2 \(id 'a'\): the same .* box \(.* id 'a'\)"),
        (["a,0,0,0,1,1,wide"], r": row 1 \(id 'a'\): a cell that is .*has size_z 'wide'\)"),
        ([f"a,0,0,0,1,1,{_SMALLEST_EDGE / 2}"], r"'a'\): edges of .* m; .* size_z '0.001'"),
        ([f"{n},0,0,{n},1,1,1" for n in range(2, 8)], r"row 5 \(id '6'\) and 1 more: reaches"),
        ([f"{n},0,{n / 2},0,1,0.51,1" for n in range(5)], r"5 \(id '4'\): lies .* to \[1.*2.51 "),
        ([], "has 0 rows and the columns id, x_min, .*; expected boxes with either"),
        (["a,0,0,0,1,1,1,5,5"], "is not a readable list: line 2 has 9 cells; expected 7"),
    ],
)
def test_lists_that_are_no_load_are_refused_by_row_and_id(written, lines, message):
    with pytest.raises(ValueError, match=message):
        read_load(written(*lines))


def test_files_that_are_no_lists_are_refused(written):
    for columns, message in (
        ("X,x (cm)", r"the columns \['X', 'x \(cm\)'\]; expected a line of names, each once"),
        (f"x,y,z,{CORNERS},id", "expected boxes with either x, y, z or x_min, y_min, z_min"),
        (f"{CORNERS},depth", "size_z, each once; columns can say"),
        ("\x1f\x8b", "boxes.csv is not a readable list: it is empty, or no"),
    ):
        with pytest.raises(ValueError, match=message):
            read_load(written("a,1", columns=columns))


@pytest.mark.parametrize(
    ("name", "cells"), [("Bruttogewicht", "0.25 1"), ("Poids brut g", "250 1000")]
)
def test_weights_are_masses_in_kg(written, name, cells):
    lines = [f"{line},{cell},9" for line, cell in zip(STACK, cells.split())]
    load = read_load(written(*lines, columns=f"id,{CORNERS},{name},net weight"))
    assert load.masses.tolist() == [0.25, 1] and load.extras["net weight"].tolist() == [9, 9]


def test_what_stands_around_the_boxes_of_a_sheet_is_left_out_and_said(tmp_path, written, caplog):
    """As German Excel writes it; a box is left out by no word alone."""
    names = f"id;{CORNERS};Empfänger".replace(",", ";")
    boxes = [line.replace(",", ";").replace(".", ",") + ";Köln" for line in STACK]
    boxes[1] = boxes[1].replace("b;", "Total;", 1)
    text = "Packliste, Müller;;;;;;;", "# 3.3.2026", "", names, *boxes, "Gesamt;;;;;;2;", ";;;;;;;"
    (tmp_path / "sheet.csv").write_bytes("\r\n".join(text).encode("cp1252"))
    load = read_load(tmp_path / "sheet.csv")
    assert load.ids.tolist() == ["a", "Total"] and load.extras["Empfänger"][0] == "Köln"
    assert np.array_equal(load.positions, read_load(written(*STACK)).positions)
    assert "read as Windows-1252, because it is no UTF-8" in caplog.text
    assert "3 lines left out, the first: Packliste, Müller\n" in caplog.text


def test_json_holds_records_or_columns(tmp_path, written):
    table, path = pd.read_csv(written(*STACK)), tmp_path / "list.json"
    records = table.to_dict("records")
    for content in (records, table.to_dict("list"), {"truck": 7, "boxes": records}):
        path.write_text(json.dumps(content), encoding="utf-8")
        assert_same(read_load(path), read_load(written(*STACK)))
    path.write_text('{"x": 1}', encoding="utf-8")
    with pytest.raises(ValueError, match="expected JSON records, or columns of equal length"):
        read_load(path)


def test_a_row_that_is_too_long_becomes_smaller(written, caplog):
    """Two rows, each 4 mm longer than the container is wide."""
    lines = [f"{n},{x},{0.5 * n},0,1,0.5008,1" for x in (0, 1) for n in range(5)]
    load = read_load(written(*(line.replace(",", f"-{row},", 1) for row, line in enumerate(lines))))
    assert (load.positions + load.sizes / 2)[:, 1].max() <= 2.5
    assert 0 < (0.5008 - load.sizes[:, 1]).max() < 0.005
    assert "boxes taken for smaller, by up to" in caplog.text
