"""The cells of a packing list: of CSV as spreadsheets write it, JSON, Excel, or a pandas table."""

import csv
import io
import json
import logging
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from unload.support import checks
from unload.support.extras import needed_for

LOGGER = logging.getLogger(__name__)
SEPARATORS = ",;\t"
MARKS = (b"\xff\xfe", b"\xfe\xff")  # of UTF-16
BINARY = re.compile("[\0-\x08\x0e-\x1f]")  # characters of no text
TOTAL = re.compile(r"((grand )?total|sum|summe|gesamt|somme|suma)\b", re.IGNORECASE)
TITLE_LINES = 20  # before the names, at most


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


def read_table(path: Any, known: Callable[[str], bool]) -> Table:
    """Read a list.

    Args:
        path: of a file; or a ``pandas.DataFrame``.
        known: whether a cell is the name of a column that has a meaning.

    Raises:
        FileNotFoundError, ValueError: there is no such file, or it is no list.
    """
    if hasattr(path, "columns"):
        rows = [[str(name) for name in path.columns]]
        rows += zip(*(_texts(path.iloc[:, place]) for place in range(len(path.columns))))
        return _table("the table", rows, 0)
    file = checks.path("path", path)
    content, source = file.read_bytes(), str(file)
    if file.suffix.lower() in (".xlsx", ".xlsm", ".xls"):
        return _headed(source, _excel_rows(file), known)
    text = _decoded(source, content)
    if text.lstrip()[:1] in ("[", "{"):
        return _table(source, _json_rows(source, text), 0)

    # The separator is the one by which most names are known; a title need not hold it.
    split = [_csv_rows(source, text, separator) for separator in SEPARATORS]
    first = text.lstrip().partition("\n")[0]
    best = max(
        range(len(split)), key=lambda n: (_header(split[n], known)[1], first.count(SEPARATORS[n]))
    )
    table = _headed(source, split[best], known)
    table.comma = SEPARATORS[best] != ","
    return table


def _decoded(source: str, content: bytes) -> str:
    try:
        text = content.decode("utf-16" if content[:2] in MARKS else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")
        if not BINARY.search(text):
            LOGGER.warning("%s: read as Windows-1252, because it is no UTF-8", source)
    if not text.strip() or BINARY.search(text):
        raise ValueError(f"{source} is not a readable list: {_what(content)}; expected text")
    return text


def _what(content: bytes) -> str:
    return f"it begins with {content[:8]!r}" if content.strip() else "it is empty"


def _csv_rows(source: str, text: str, separator: str) -> list[list[str]]:
    try:
        rows = csv.reader(io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True)
        return [[cell.strip() for cell in row] for row in rows]
    except csv.Error as error:
        raise ValueError(f"{source} is not a readable CSV file: {error}") from error


def _excel_rows(file: Path) -> list[list[str]]:
    with needed_for(f"{file}, an Excel file,"):
        import pandas as pd

        try:
            sheet = pd.read_excel(file, header=None, dtype=object)
        except ImportError:
            raise
        except Exception as error:  # each library of such files has errors of its own
            raise ValueError(f"{file} is not a readable Excel file: {error}") from error
    return [*map(list, zip(*(_texts(sheet[name]) for name in sheet.columns)))]


def _json_rows(source: str, text: str) -> list[list[str]]:
    """A line of names and one for each record; of an object with columns or with a list of them."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{source} is not a readable JSON file: {error}") from error
    if isinstance(value, dict):
        lists = [each for each in value.values() if _are_records(each)]
        if len(lists) == 1:
            value = lists[0]
    if isinstance(value, dict) and value:
        columns = {
            name: [*each.values()] if isinstance(each, dict) else each
            for name, each in value.items()
        }
        lengths = {len(each) if isinstance(each, list) else -1 for each in columns.values()}
        if len(lengths) == 1 and -1 not in lengths:
            return [[*columns], *map(list, zip(*map(_texts, columns.values())))]
    if not _are_records(value):
        raise ValueError(f"{source} holds neither records nor columns; expected a list of objects")
    names = [*dict.fromkeys(name for record in value for name in record)]
    return [names, *(_texts([record.get(name) for name in names]) for record in value)]


def _are_records(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(e, dict) for e in value)


def _texts(values: Any) -> list[str]:
    """Cells as text, empty where there is none."""
    return ["" if value is None or value != value else str(value).strip() for value in values]


def _header(rows: list[list[str]], known: Callable[[str], bool]) -> tuple[int, int]:
    """The line of names, as far as one can tell, and how many of its names are known."""
    counts = [sum(map(known, row)) for row in rows[:TITLE_LINES]]
    most = max(counts, default=0)
    return (counts.index(most) if most else 0), most


def _headed(source: str, rows: list[list[str]], known: Callable[[str], bool]) -> Table:
    return _table(source, rows, _header(rows, known)[0])


def _table(source: str, rows: Sequence[Sequence[str]], header: int) -> Table:
    """The table below its line of names, without comments, totals and empty lines."""
    names = [*rows[header]]
    while names and not names[-1]:
        names.pop()
    kept, left_out = [], [line for line in rows[:header] if any(line)]
    for number, row in enumerate(rows[header + 1 :], header + 2):
        filled = [cell for cell in row if cell]
        if not filled:
            continue
        total = TOTAL.match(filled[0]) and len(filled) < len(names) / 2 + 1
        if row[0].startswith("#") or total:
            left_out.append(row)
            continue
        if any(row[len(names) :]):
            raise ValueError(
                f"{source} is not a readable list: line {number} has {len(row)} cells; expected "
                f"{len(names)}, one for each name"
            )
        kept.append([*row[: len(names)], *[""] * (len(names) - len(row))])
    if left_out:
        first = " ".join(cell for cell in left_out[0] if cell)
        LOGGER.warning("%s: %d lines left out, the first: %s", source, len(left_out), first)
    columns = [*map(list, zip(*kept))] or [[] for _ in names]
    return Table(source, names, dict(zip(names, columns)))
