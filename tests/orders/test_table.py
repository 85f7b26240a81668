"""The cells of CSV and Excel files: what is read, and what is refused in a sentence."""

import io
import re
import zipfile

import numpy as np
import pandas as pd
import pytest

from unload.orders import table
from unload.orders.table import LIMITS, ListError, read_table

NAMES = "id,x_min,y_min,z_min,size_x,size_y,size_z"
BOX = "a,6,0.1,0,0.5,0.4,0.3"
SHEET = "xl/worksheets/sheet1.xml"
CELL = "<c><v>1</v></c>"
MAIN = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'


@pytest.fixture
def read(tmp_path):
    """``read(text)``: the table of a CSV file, given as text or bytes."""

    def reading(text: str | bytes, **options) -> pd.DataFrame:
        content = text if isinstance(text, bytes) else text.encode()
        (tmp_path / "boxes.csv").write_bytes(content)
        return read_table(tmp_path / "boxes.csv", **options)

    return reading


@pytest.fixture
def book(tmp_path):
    """``book(parts)``: the path of an Excel file of two rows, with these parts in place of its own.

    Its sheet does not say how large it is, as openpyxl writes it row by row.
    """
    openpyxl = pytest.importorskip("openpyxl")

    def write(parts: dict[str, str | bytes | None] = {}, rows=(NAMES, BOX)):  # noqa: B006
        own, content = openpyxl.Workbook(write_only=True), io.BytesIO()
        sheet = own.create_sheet()
        for row in rows:
            sheet.append([float(c) if re.fullmatch(r"[\d.]+", c) else c for c in row.split(",")])
        own.save(content)
        with zipfile.ZipFile(content) as old:
            held = {name: old.read(name) for name in old.namelist()} | parts
        with zipfile.ZipFile(tmp_path / "boxes.xlsx", "w", zipfile.ZIP_DEFLATED) as new:
            for name, part in held.items():
                if part is not None:
                    new.writestr(name, part)
        return tmp_path / "boxes.xlsx"

    return write


def sheet(*rows: str) -> str:
    return f"<worksheet {MAIN}><sheetData>{''.join(rows)}</sheetData></worksheet>"


@pytest.mark.parametrize("text", ["", ",,\n,,\n", '"",""'])
def test_files_without_a_name_are_refused(read, text):
    with pytest.raises(
        ListError, match="empty cells only from line 1 on; expected a line of names"
    ):
        read(text)


def test_empty_lines_and_what_has_no_name_are_left_out(read):
    found = read(f",,,,\n\n,{NAMES},,\n\n,{BOX},,\n1,b,5,0.1,0,0.5,0.4,0.3\n")
    assert found.columns.tolist() == NAMES.split(",")
    assert found.to_numpy().tolist() == [BOX.split(","), BOX.replace("a,6", "b,5").split(",")]


def test_a_title_above_the_names_is_refused_with_their_line_and_skipped_with_header(read, book):
    names = NAMES.replace(",", ";")
    for title in ("Packing list, 2026", "Truck;12"):
        text = f"{title}\n\nBoxes;1\n{names}\n{BOX.replace(',', ';')}\n"
        for header, first in ((1, 1), (2, 3), (3, 3)):  # empty lines are passed over
            found = f"line {first} holds fewer than 6 names.* as line 4 may hold them; .* header$"
            with pytest.raises(ListError, match=found):
                read(text, header=header)
        assert read(text, header=4).to_numpy().tolist() == [BOX.split(",")]
    text = f"Ulm, Bonn, Kiel, Rom, Genf, Wien\n{names}\n{BOX.replace(',', ';')}\n"
    assert read(text, header=2).to_numpy().tolist() == [BOX.split(",")]
    path = book(rows=("Packing list", "", NAMES, BOX))
    with pytest.raises(ListError, match="line 1 holds fewer than 6 names.* as line 3 may hold"):
        read_table(path)
    assert read_table(path, header=3).to_numpy().tolist() == [BOX.split(",")]


def test_a_line_with_more_cells_than_names_is_refused(read):
    """Decimals between commas would shift all others; a cell in quotes may hold some."""
    with pytest.raises(ListError, match="^line 3 has 8 cells; expected at most 7, as in the line"):
        read(f"{NAMES}\n{BOX}\nb,5,0,1,0,0.5,0.4,0.3\n")
    assert read(f'{NAMES}, note\n{BOX}, "1,5"\n')["note"].tolist() == ["1,5"]


@pytest.mark.parametrize("below", ["", 'b,5,0,1,0,0.5,0.4,12"', 'b,5,0,1,0,0.5,0.4,"12in'])
def test_a_cell_ends_in_its_line(read, below):
    """A quotation mark that was never closed once took in the boxes up to the next one."""
    text = f'The "old" truck\n"7\n{NAMES},note\n{BOX},"12in\n{BOX},5" pipe\n{below}'
    with pytest.raises(ListError, match="^line 4 is no line of CSV: .* expected a cell that"):
        read(text, header=3)
    cells = read(text.replace(',"12in', ',"12"" in, old"'), header=3)["note"]
    assert cells.tolist()[:2] == ['12" in, old', '5" pipe']


@pytest.mark.parametrize("encoding", ["cp1252", "utf-16"])
def test_another_encoding_is_refused_with_how_to_save(read, encoding):
    with pytest.raises(ListError, match=r'codec can\'t decode .*; save it as .*"CSV UTF-8"'):
        read(f"{NAMES}\n{BOX.replace('a', 'ä')}\n".encode(encoding))


def test_an_excel_file_is_read_as_its_cells_show_it(book):
    """7 and 7.0 are the same; what a sheet says of its size counts for nothing."""
    assert read_table(book(rows=(NAMES, BOX.replace("a", "7")))).to_numpy().tolist() == [
        ["7", "6", "0.1", "0", "0.5", "0.4", "0.3"]
    ]
    cells = "".join(f'<c t="inlineStr"><is><t>{name}</t></is></c>' for name in NAMES.split(","))
    box = "".join(f"<c><v>{cell}</v></c>" for cell in BOX.replace("a", "7.0").split(","))
    rows = f"<row>{cells}</row>", f"<row>{box}</row>"
    for size in ("A1", "A1:XFD1048576", "B2:A1"):
        said = sheet(*rows, *["<row/>"] * 4_999)  # formatted ones, say
        said = said.replace("<sheetData>", f'<dimension ref="{size}"/><sheetData>')
        found = read_table(book({SHEET: said}))
        assert found.columns.tolist() == NAMES.split(",") and len(found) == 1
        assert found["id"].tolist() == ["7"]


@pytest.mark.parametrize(
    "parts",
    [
        {SHEET: b"<worksheet"},
        {SHEET: None},
        {SHEET: sheet('<row><c r="??"/></row>')},
        {SHEET: sheet('<row><c t="s"><v>9</v></c></row>')},
        {"xl/workbook.xml": b"<a/>"},
        {"xl/workbook.xml": None},
        {"[Content_Types].xml": None},
    ],
)
def test_a_damaged_excel_file_is_refused_in_a_sentence(book, parts):
    with pytest.raises(ListError, match="boxes.xlsx is not a readable list: .*; expected CSV in"):
        read_table(book(parts))


def test_what_is_no_excel_file_and_one_that_ends_early_are_refused(book):
    path = book()
    content = path.read_bytes()
    for damaged in (
        b"",
        b"PK",
        content[: len(content) // 2],
        content.replace(b"sheet1", b"sheet9"),
    ):
        path.write_bytes(damaged)
        with pytest.raises(ListError, match="boxes.xlsx is not a readable list"):
            read_table(path)


def test_a_hidden_sheet_is_passed_over(book, tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    own = openpyxl.load_workbook(book())
    for state in ("hidden", "veryHidden"):
        old = own.create_sheet(state, 0)
        old.append(NAMES.split(","))
        old.append([1] * 7)
        old.sheet_state = state
    own.active = 2
    own.save(tmp_path / "hidden.xlsx")
    assert read_table(tmp_path / "hidden.xlsx").to_numpy().tolist() == [BOX.split(",")]


def test_the_first_sheet_may_be_a_chart(book, tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    own = openpyxl.load_workbook(book())
    chart = openpyxl.chart.BarChart()
    chart.add_data(openpyxl.chart.Reference(own.worksheets[0], min_col=2, min_row=1, max_row=2))
    own.create_chartsheet(index=0).add_chart(chart)
    own.save(tmp_path / "chart.xlsx")
    assert read_table(tmp_path / "chart.xlsx").to_numpy().tolist() == [BOX.split(",")]


@pytest.mark.parametrize(
    ("text", "most"),
    [
        ("," * 200_000, "200,000 cells"),
        (("," * 1_000 + "\n") * 200, "200,000 cells"),
        ("a," * 200 + "a", "200 columns"),
        ("\n" * 20_001, "20,000 lines"),
        (f"{NAMES}\n" * 3_002, "3,000 rows"),
        (f"{NAMES}\n{'a' * 1001}\n", "1,000 characters in a cell"),
        ("x" * 20_000_001, "20,000,000 bytes"),
    ],
)
def test_a_list_that_is_too_long_is_refused_before_a_table_is_made(read, set_in, text, most):
    """100,000 commas once took half a minute."""
    set_in(table, _below_names=None)
    with pytest.raises(ListError, match=f"^the list has more than {most}, the most that are read$"):
        read(text)


@pytest.mark.parametrize(
    ("parts", "most"),
    [
        ({SHEET: sheet('<row><c r="GS1"><v>1</v></c></row>')}, "200 columns"),  # the 201st
        ({SHEET: sheet('<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>')}, "20,000 lines"),
        ({SHEET: sheet(f"<row>{'<c/>' * 199}</row>" * 1_006)}, "200,000 cells"),
        ({SHEET: sheet(f"<row>{CELL}</row>" * 3_002)}, "3,000 rows"),
        ({SHEET: b" " * 1_500_000}, "1,500,000 bytes of XML"),
        ({f"{part}.png": b"" for part in range(1_000)}, "1,000 parts"),
        ({"xl/styles.xml": b" " * 250_001}, "250,000 bytes of styles"),
    ],
)
def test_so_is_an_excel_file(book, set_in, parts, most):
    """One cell at the far end of a sheet once took 7 GB, and a small archive may hold much."""
    set_in(table, _below_names=None)
    path = book(parts)
    with pytest.raises(ListError, match=f"^the list has more than {most}, the most that are read"):
        read_table(path)


def test_what_is_as_long_as_it_may_be_is_read(read, book):
    wide = ",".join(map(str, range(LIMITS["columns"])))
    assert read(f"{wide}\n" + f"{wide}\n" * 10).shape == (10, 200)
    assert read(f"{NAMES}\n" + f"{BOX}\n" * 3_000).shape == (3_000, 7)
    assert read_table(book({SHEET: sheet(*[f"<row>{CELL * 200}</row>"] * 2)})).shape == (1, 200)
    assert read_table(pd.DataFrame(np.ones((3_000, 200)))).shape == (3_000, 200)
    for shape, most in (((2, 201), "200 columns"), ((3_001, 6), "3,000 rows")):
        with pytest.raises(ListError, match=f"more than {most}"):
            read_table(pd.DataFrame(np.ones(shape)))


def test_a_file_is_read_no_further_than_it_may_be_long(monkeypatch):
    """Some files have no end, and no length."""
    monkeypatch.setitem(table.LIMITS, "bytes", 1_000)
    with pytest.raises(ListError, match="more than 1,000 bytes"):
        read_table("/dev/zero")
