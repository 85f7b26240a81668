"""The table of a packing list: its line of names, and cells, from a CSV or an Excel file."""

import csv
import re
import warnings
from collections.abc import Iterable, Mapping
from io import BytesIO, StringIO
from itertools import islice
from pathlib import Path
from zipfile import ZipFile

import pandas as pd

from unload.support import checks

# The most that is read of a list; lines and cells may be empty ones.
LIMITS = {
    "rows": 3_000,
    "columns": 200,
    "lines": 20_000,
    "cells": 200_000,
    "characters in a cell": 1_000,
    "bytes": 20_000_000,
    # Of an Excel file, which takes a second for a megabyte of cells, and three for one of styles.
    "parts": 1_000,
    "bytes of XML": 1_500_000,
    "bytes of styles": 250_000,
}
_COLUMNS = 6  # that a list has at least


class ListError(ValueError):
    """A list that holds no load.

    Attributes:
        problem: what was found, and what was expected.
        argument: name of the argument of ``read_load`` that may help, or None.
    """

    def __init__(self, problem: str, argument: str | None = None) -> None:
        super().__init__(problem, argument)
        self.problem, self.argument = problem, argument

    def __str__(self) -> str:
        return self.problem + (f"; see the argument {self.argument}" if self.argument else "")


def read_table(path: str | Path | pd.DataFrame, header: int = 1) -> pd.DataFrame:
    """Cells of a list below its line of names: as text, or as they are in a table of pandas.

    Args:
        path, header: see ``unload.read_load``, and so for the errors.
    """
    if isinstance(path, pd.DataFrame):
        table = path.reset_index(drop=True)
    else:
        file = checks.path("path", path)
        with open(file, "rb") as source:
            content = source.read(LIMITS["bytes"] + 1)
        _check("bytes", len(content))
        excel = file.suffix.lower() == ".xlsx"
        try:
            with warnings.catch_warnings(action="ignore"):  # of styles and pictures
                lines = _filled(_excel(content) if excel else _csv(content, header), header)
        except (ListError, ModuleNotFoundError):
            raise
        except Exception as error:  # zipfile, zlib, csv and openpyxl have errors of their own
            wanted = "expected CSV in UTF-8, an .xlsx file, or a table that pandas has read"
            if isinstance(error, UnicodeError):
                wanted = 'save it as what spreadsheets call "CSV UTF-8", or as an .xlsx file'
            said = " ".join(str(error).split())
            raise ListError(f"{file} is not a readable list: {said}; {wanted}") from error
        if not lines:
            wanted = "expected a line of names, and boxes"
            raise ListError(f"the list holds empty cells only from line {header} on; {wanted}")
        table = _below_names(lines)
    _check("columns", table.shape[1])
    _check("rows", len(table))
    if not len(table):
        raise ListError(f"the list has the columns {[*table]!s:.1000} and no row; expected boxes")
    return table


def _check(what: str, count: int, instead: str = "") -> None:
    if count > LIMITS[what]:
        read = f"the most that are read{instead}"
        raise ListError(f"the list has more than {LIMITS[what]:,} {what}, {read}")


def _filled(lines: Iterable[list[str]], header: int) -> dict[int, list[str]]:
    """The lines that are not empty, by their numbers from ``header`` on, up to their last cell."""
    filled: dict[int, list[str]] = {}
    count = 0
    for number, line in enumerate(lines, 1):
        count += len(line)
        _check("lines", number)
        _check("cells", count)
        cells = [*map(str.strip, line)]
        while cells and not cells[-1]:
            cells.pop()
        if cells and number >= header:
            filled[number] = cells
            _check("rows", len(filled) - 1)
            _check("columns", len(cells))
            _check("characters in a cell", max(map(len, cells)))
    return filled


def _below_names(lines: Mapping[int, list[str]]) -> pd.DataFrame:
    """The table of cells whose names stand in the first line; what has no name is left out."""
    (first, names), *rows = lines.items()
    full = [number for number, cells in lines.items() if len(cells) - cells.count("") >= _COLUMNS]
    if full and full[0] > first:
        found = f"line {first} holds fewer than {_COLUMNS} names of columns"
        raise ListError(f"{found}; expected them there, as line {full[0]} may hold them", "header")
    for number, cells in rows:
        if len(cells) > len(names):  # as where commas separate decimals, too
            wanted = f"expected at most {len(names)}, as in the line of names"
            raise ListError(f"line {number} has {len(cells)} cells; {wanted}")
        cells += [""] * (len(names) - len(cells))
    table = pd.DataFrame([cells for _, cells in rows], columns=[*names], dtype=object)
    return table.loc[:, table.columns != ""]


def _csv(content: bytes, header: int) -> Iterable[list[str]]:
    """The cells of each line; where the comma does not separate them, it separates decimals."""
    text = content.decode("utf-8-sig")
    # The line of names is the first with many separators, and has no decimals.
    separator = ","
    for line in islice(StringIO(text, newline=None), header - 1, LIMITS["lines"]):
        mark = max(",;\t", key=line.count)
        if line.count(mark) >= _COLUMNS - 1:
            separator = mark
            break
    for number, line in enumerate(StringIO(text, newline=None), 1):
        # Each line by itself: a quotation mark that is not closed would take in those below.
        reader = csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True)
        try:
            cells = next(reader) if number >= header else []
        except csv.Error as error:
            wanted = "expected a cell that begins with a quotation mark to end with one there"
            raise ListError(f"line {number} is no line of CSV: {error}; {wanted}") from error
        if separator != ",":
            cells = [re.sub(r"^(-?\d+),(\d+)$", r"\1.\2", cell.strip()) for cell in cells]
        yield cells


def _excel(content: bytes) -> Iterable[list[str]]:
    """The cells of each line of the first sheet of cells that is not hidden."""
    with checks.needed_for("an Excel file"):
        from openpyxl import load_workbook
    # Pictures are left out. Of what remains the archive tells the length, and reading more than
    # that fails; so these limits hold for a few bytes, too, that unpack to gigabytes.
    copy, instead = BytesIO(), "; save it as CSV"
    with ZipFile(BytesIO(content)) as parts, ZipFile(copy, "w") as reduced:
        _check("parts", len(parts.infolist()), instead)
        xml = [part for part in parts.infolist() if part.filename.endswith((".xml", ".rels"))]
        styles = [part.file_size for part in xml if part.filename == "xl/styles.xml"]
        _check("bytes of styles", sum(styles), instead)
        _check("bytes of XML", sum(part.file_size for part in xml), instead)
        for part in xml:
            reduced.writestr(part.filename, parts.read(part))
    book = load_workbook(copy, read_only=True, data_only=True, keep_links=False)
    sheet = [each for each in book.worksheets if each.sheet_state == "visible"][0]
    sheet.reset_dimensions()  # what a file says of its sheet's size may be wrong
    return ([*map(_text, line)] for line in sheet.iter_rows(values_only=True))


def _text(cell: object) -> str:
    """A cell of Excel, where 7 and 7.0 are the same."""
    return "" if cell is None else str(cell).removesuffix(".0" if isinstance(cell, float) else "")
