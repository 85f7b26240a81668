"""The cells of a packing list: of CSV as spreadsheets write it, JSON, Excel, or a pandas table."""

import csv
import io
import json
import logging
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from unload.support import checks

LOGGER = logging.getLogger(__name__)
SEPARATORS = ",;\t"
MARKS = (b"\xff\xfe", b"\xfe\xff")  # of UTF-16
BINARY = re.compile("[\0-\x08\x0e-\x1f]")  # characters of no text
TOTAL = re.compile(r"((grand )?total|sum|summe|gesamt|somme|suma)\b", re.IGNORECASE)
COMMA = re.compile(r"^(-?\d+),(\d+)$")  # a decimal one
TITLE_LINES = 20  # before the names, at most
# The line of names, as far as one can tell, and how many of its names are known.
Header = tuple[int, int]


@dataclass
class Table:
    """A list's cells.

    Attributes:
        source: what the list is called in messages.
        names: of its columns, in order.
        cells: name → text of each row, without spaces around it.
        comma: whether numbers may have a decimal comma.
    """

    source: str
    names: list[str]
    cells: dict[str, list[str]]
    comma: bool = False

    def __len__(self) -> int:
        return len(next(iter(self.cells.values()), []))

    def with_points(self, name: str) -> list[str]:
        """The cells of a column, its numbers with decimal points."""
        cells = self.cells[name]
        return [COMMA.sub(r"\1.\2", cell) for cell in cells] if self.comma else cells


def read_table(path: Any, known: Callable[[str], bool]) -> Table:
    """Read a list.

    Args:
        path: of a file; or a ``pandas.DataFrame``.
        known: whether a cell is the name of a column that has a meaning.

    Raises:
        FileNotFoundError, ValueError: there is no such file, or it is no list.
    """
    if hasattr(path, "columns"):
        return _table("the table", _rows_of(path), 0)
    file = checks.path("path", path)
    content, source = file.read_bytes(), str(file)
    if file.suffix.lower() in (".xlsx", ".xlsm", ".xls"):
        rows = _rows_of(_excel(file))[1:]  # the first has pandas' own names
        return _table(source, rows, _header(rows, known)[0])
    text = _decoded(source, content)
    if text.lstrip()[:1] in ("[", "{"):
        return _table(source, _rows_of(_json(source, text)), 0)

    # The separator is the one by which most names are known; a title need not hold it.
    first, best = text.lstrip().partition("\n")[0], (-1, -1)
    for separator in SEPARATORS:
        lines = io.StringIO(text, newline="")
        try:
            read = [*csv.reader(lines, delimiter=separator, skipinitialspace=True)]
        except csv.Error as error:
            raise ValueError(f"{source} is not a readable CSV file: {error}") from error
        split = [[cell.strip() for cell in row] for row in read]
        line, count = _header(split, known)
        if (count, first.count(separator)) > best:
            best = count, first.count(separator)
            rows, header, comma = split, line, separator != ","
    return _table(source, rows, header, comma)


def _decoded(source: str, content: bytes) -> str:
    try:
        text = content.decode("utf-16" if content[:2] in MARKS else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")
        if not BINARY.search(text):
            LOGGER.warning("%s: read as Windows-1252, because it is no UTF-8", source)
    if not text.strip() or BINARY.search(text):
        raise ValueError(f"{source} is not a readable list: it is empty, or no text")
    return text


def _json(source: str, text: str) -> Any:
    """The pandas table of records or columns, or of the only list of records in an object."""
    import pandas as pd

    try:
        value = json.loads(text)
        if isinstance(value, dict):
            lists = [each for each in value.values() if isinstance(each, list)]
            value = lists[0] if len(lists) == 1 else value
        return pd.DataFrame(value, dtype=object)
    except (AttributeError, TypeError, ValueError, RecursionError) as error:
        wanted = "expected JSON records, or columns of equal length"
        raise ValueError(f"{source} is not a readable list: {error}; {wanted}") from error


def _excel(file: Path) -> Any:
    """The pandas table of the first sheet."""
    with checks.needed_for(f"{file}, an Excel file,"):
        import pandas as pd

        try:
            return pd.read_excel(file, header=None, dtype=object)
        except ImportError:
            raise
        except Exception as error:  # each library of such files has errors of its own
            raise ValueError(f"{file} is not a readable Excel file: {error}") from error


def _rows_of(table: Any) -> list[list[str]]:
    """The names of a pandas table, and its rows as text, empty where there is nothing."""
    filled = table.astype(object).where(table.notna(), "")
    return [[str(cell).strip() for cell in row] for row in [table.columns, *filled.to_numpy()]]


def _header(rows: list[list[str]], known: Callable[[str], bool]) -> Header:
    counts = [sum(map(known, row)) for row in rows[:TITLE_LINES]]
    most = max(counts, default=0)
    return (counts.index(most) if most else 0), most


def _table(source: str, rows: list[list[str]], header: int, comma: bool = False) -> Table:
    """The table below its line of names, without comments, totals and empty lines."""
    names = [*rows[header]] if rows else []
    while names and not names[-1]:
        names.pop()
    kept, left_out = [], [line for line in rows[:header] if any(line)]
    for number, row in enumerate(rows[header + 1 :], header + 2):
        filled = [cell for cell in row if cell]
        if not filled:
            continue
        total = TOTAL.match(filled[0]) and len(filled) <= len(names) / 2
        if row[0].startswith("#") or total:
            left_out.append(row)
        elif any(row[len(names) :]):
            wanted = f"expected {len(names)}, one for each name"
            raise ValueError(
                f"{source} is not a readable list: line {number} has {len(row)} cells; {wanted}"
            )
        else:
            kept.append([*row[: len(names)], *[""] * (len(names) - len(row))])
    if left_out:
        first = " ".join(cell for cell in left_out[0] if cell)
        LOGGER.warning("%s: %d lines left out, the first: %s", source, len(left_out), first)
    columns = [*map(list, zip(*kept))] or [[] for _ in names]
    return Table(source, names, dict(zip(names, columns)), comma)
