"""Packing lists: the boxes of a load in a CSV or Excel file, or in a table of pandas."""

import logging
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
import pandas as pd

from unload import task
from unload.load.boxes import CONTACT_TOLERANCE, LARGEST_TOLERANCE, BoxError, Load, check_supported
from unload.orders.settling import settle, uncarried
from unload.orders.table import ListError, read_table
from unload.support import checks, files

LOGGER = logging.getLogger(__name__)
EXAMPLE = files.SHIPPED / "example.csv"  # of boxes in three walls
UNITS = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "in": 1 / 0.0254}  # of a unit in a metre
CENTRE, CORNER = ("x", "y", "z"), ("x_min", "y_min", "z_min")
SIZES = ("size_x", "size_y", "size_z")
ROTATIONS = ("rotation", "yaw", "pitch", "roll")
# What a column is, by its name in lower case.
COLUMN_NAMES = {name: name for name in (*CENTRE, *CORNER, *SIZES, *ROTATIONS, "id")}
COLUMN_NAMES |= zip(("pos_x", "pos_y", "pos_z", "length", "width", "height"), CORNER + SIZES)
LARGEST_NUMBER = 1e6  # a length in mm is smaller
# What makes a cell of another column a number: not a code, which has zeros in front or more digits
# than a float64 holds.
NUMBER_PATTERN = r"-?(?=(\.?\d){1,15}$)(0|[1-9]\d*)(\.\d+)?"


def read_load(
    path: str | Path | pd.DataFrame = EXAMPLE,
    units: str = "m",
    columns: Mapping[str, str] | None = None,
    tolerance: float = 0.005,
    container: Sequence[float] | np.ndarray = tuple(task.CONTAINER),
    x_from: str = "rear",
    header: int = 1,
) -> Load:
    """Read a packing list: a line of names, and one line for each box.

    The container's axes are x (depth, 0 at the rear wall), y (width, 0 at the left wall, seen from
    the entrance) and z (height). Columns that are read, in capitals or not:

    - ``x_min``, ``y_min``, ``z_min`` or ``pos_x``, ``pos_y``, ``pos_z``: the box's corner nearest
      to the origin; or ``x``, ``y``, ``z``: its centre;
    - ``size_x``, ``size_y``, ``size_z`` or ``length``, ``width``, ``height``: edges along the axes
      as the box stands, at least 2 mm;
    - ``id``: the number of the row if there is no such column;
    - ``rotation``, ``yaw``, ``pitch`` or ``roll``, in degrees: quarter turns only, because sizes
      are those after the turns.

    A length's name may end in its unit: ``length_mm``, ``x (cm)``. In mm, a number such as 1.200 is
    refused unless another one shows that its mark is of decimals, as 0.000 and 1200.5 do.

    Rotations and all other columns, such as a stop or a weight, become ``Load.extras``. Each line
    is one box; quantities are ignored. In a file, columns without a name are left out.

    Args:
        path: of a CSV file (UTF-8; separated by commas, or by semicolons or tabs, where decimals
            may have a comma) or of an Excel file (``.xlsx``, first visible sheet); or a
            ``pandas.DataFrame``, for a list that has to be read otherwise. At most 3,000 rows and
            200 columns, see ``unload.orders.table.LIMITS``.
        units: of lengths whose names say none: ``"m"``, ``"cm"``, ``"mm"`` or ``"in"``.
        columns: name in the list → name above, for other names: ``{"Länge": "size_x"}``.
        tolerance: in m, up to 0.1, how far each box may be from where it belongs, see
            ``unload.orders.settling.settle``. How many were moved and how far is logged, and
            which overlaps this may hide. A box lies on any whose top is at most so far below it.
        container: (3,) its inner length, width and height in m; by default the paper's.
        x_from: ``"rear"``, or ``"door"`` if x counts from there to the box's front or centre.
        header: of a file, the number of the line of names, if a title stands above; empty lines
            are passed over.

    Returns:
        The load in the order of the list, with its ``ids``.

    Raises:
        TypeError: an argument is of another type.
        FileNotFoundError: there is no such file.
        ModuleNotFoundError: the file needs an extra; the message names it.
        ListError: a ValueError, too: the list cannot be read, is too long, lacks a column or has
            two for the same; or a box is refused. The message names the first rows, counted from 1
            without the line of names, and their ids.
    """
    checks.one_of("units", units, UNITS)
    checks.one_of("x_from", x_from, ("rear", "door"))
    tolerance = checks.real("tolerance", tolerance, 0, LARGEST_TOLERANCE)
    container = checks.finite_array("container", container, (3,))
    checks.entries("columns", {} if columns is None else columns, ())
    header = checks.integer("header", header, 1)
    listed = _List(read_table(path, header), columns or {}, units)
    centres, sizes = listed.boxes()
    if x_from == "door":
        centres[:, 0] = container[0] - centres[:, 0]

    # What fits stays, to the bit, where and as large as the list says.
    moves, smaller = settle(centres - sizes / 2, sizes, container, tolerance)
    try:
        load = Load(
            centres + moves,
            sizes - smaller,
            ids=listed.ids,
            container=container,
            extras=listed.extras(),
            contact_tolerance=max(tolerance, CONTACT_TOLERANCE),
        )
        check_supported(load)
    except BoxError as error:
        outside = np.abs(centres - container / 2) + sizes / 2 - container / 2
        problem, argument = error.problem, "tolerance"
        if outside.max() > 2 * container.max():  # so far outside that the unit must be wrong
            argument = "units"
        elif listed.place is CENTRE and centres[:, 2].min() <= tolerance:
            corners = ", ".join(f"{listed.names[c]}={corner}" for c, corner in zip(CENTRE, CORNER))
            problem += f"; if these are no centres but corners: {corners}"
            argument = "columns"
        elif outside.max() > LARGEST_TOLERANCE:
            argument = "container"
        listed.refuse(np.array(error.boxes), problem, argument if error.misplaced else None)
    if (tipping := uncarried(load)).size:
        listed.refuse(tipping, "tips, because nothing carries its centre of mass", "tolerance")
    for edits, what in ((moves, "moved by"), (smaller, "taken for smaller, by")):
        if edits.any():
            count, most = edits.any(axis=1).sum(), 1000 * np.linalg.norm(edits, axis=1).max()
            LOGGER.warning("%d of %d boxes %s up to %.1f mm", count, len(load), what, most)
    if moves.any() or smaller.any():
        # In mm; two boxes may overlap by twice the sum of the fault, the largest move and half of
        # what an edge lost.
        hidden = 2000 * (tolerance + np.abs(moves).max() + smaller.max() / 2)
        LOGGER.warning("An order may overlook overlaps of up to %.0f mm", hidden)
    return load


class _List:
    """A packing list by what its columns mean; a refusal names rows and their ids.

    Attributes:
        names: of the columns, by their meaning.
        ids: (n,) texts.
        place: what says where a box is, ``CENTRE`` or ``CORNER``.
    """

    def __init__(self, table: pd.DataFrame, columns: Mapping[str, str], units: str) -> None:
        self._table, self._units = table, units
        self.names = _columns_by_meaning([*table], columns)
        self.place = CENTRE if {*CENTRE} <= {*self.names} else CORNER
        named = table[self.names["id"]] if "id" in self.names else 1 + np.arange(len(table))
        self.ids = np.array([*map(str, named)])
        missing = np.flatnonzero(pd.isna(named) | (self.ids == ""))
        if missing.size:
            self.refuse(missing, f"{self.names['id']} is empty; expected one for each box")

    def refuse(self, rows: np.ndarray, problem: str, argument: str | None = None) -> NoReturn:
        """Raise ListError for these rows, (k,) int64, and the argument that may help."""
        shown = ", ".join(f"row {row + 1} (id {str(self.ids[row])!r})" for row in rows[:5])
        more = f" and {len(rows) - 5} more" if len(rows) > 5 else ""
        raise ListError(f"{shown}{more}: {problem}", argument)

    def boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """The centres of all boxes, x as the list counts it, and their edges, (n, 3) in m each."""
        # A box turned otherwise than by quarter turns is none along the axes.
        for turn in (name for name in ROTATIONS if name in self.names):
            turned = np.flatnonzero(np.abs((self._numbers(turn) + 45) % 90 - 45) > 1e-3)
            if turned.size:
                self.refuse(turned, f"a {self.names[turn]} that is no quarter turn; expected one")
        self._check_decimals()
        lengths = [self._numbers(name) / UNITS[self._unit(name)] for name in (*self.place, *SIZES)]
        places, sizes = np.hsplit(np.stack(lengths, axis=1), 2)
        return places if self.place is CENTRE else places + sizes / 2, sizes

    def extras(self) -> dict[str, np.ndarray]:
        """The columns that are neither a place, an edge nor the id, by their names."""
        read = (*self.place, *SIZES, "id")
        others = [name for meaning, name in self.names.items() if meaning not in read]
        return {str(name): _extra(self._table[name]) for name in others}

    def _unit(self, meaning: str) -> str:
        return _split_unit(self.names[meaning])[1] or self._units

    def _numbers(self, meaning: str) -> np.ndarray:
        """The cells of a column, (n,) float64."""
        name = self.names[meaning]
        cells = pd.to_numeric(self._table[name], errors="coerce").to_numpy(float)
        if (wrong := np.flatnonzero(~(np.abs(cells) <= LARGEST_NUMBER))).size:
            wanted = f"expected a number, at most {LARGEST_NUMBER:,.0f}"
            self.refuse(wrong, f"{name} is {str(self._table[name][wrong[0]])!r}; {wanted}")
        return cells

    def _check_decimals(self) -> None:
        """Refuse lengths in mm such as 1.200, unless another one shows what the mark is of."""
        lengths = (*self.place, *SIZES)
        in_mm = self._table[[self.names[name] for name in lengths if self._unit(name) == "mm"]]
        # 1.200 may be 1200 with a mark of thousands; in 0.000 and 1200.5 it can be of decimals
        # only.
        texts = [cell for cell in in_mm.to_numpy().ravel() if isinstance(cell, str)]
        unclear = [cell for cell in texts if re.fullmatch(r"-?[1-9]\d{0,2}\.\d{3}", cell)]
        if unclear and not any(re.match(r"-?(0|\d{4,})\.", cell) for cell in texts):
            found = f"{unclear[0]!r} in mm may have thousands or decimals"
            rows = np.flatnonzero(in_mm.isin(unclear).any(axis=1))
            self.refuse(rows, f"{found}; expected 1200 or 1.2")


def _columns_by_meaning(names: list, columns: Mapping[str, str]) -> dict[str, str]:
    """Map each meaning to its column; a column without one keeps its own name."""
    for name, meaning in columns.items():
        checks.one_of("columns", name, names)
        checks.one_of("columns", meaning, COLUMN_NAMES)
    by_meaning: dict[str, str] = {}
    for name in names:
        meaning = COLUMN_NAMES.get(columns.get(name) or _split_unit(name)[0], name)
        if meaning in by_meaning:
            raise ListError(f"the list has the columns {names!s:.1000}; expected one {meaning!r}")
        by_meaning[meaning] = name
    missing = ", ".join(name for name in SIZES if name not in by_meaning)
    # Both kinds of place, or neither.
    if ({*CENTRE} <= {*by_meaning}) == ({*CORNER} <= {*by_meaning}):
        missing = "either x, y, z or x_min, y_min, z_min"
    if missing:
        raise ListError(f"the list has the columns {names!s:.1000}; expected {missing}", "columns")
    return by_meaning


def _split_unit(name: object) -> tuple[str, str | None]:
    """A column's name in lower case without its unit, and the unit, None if it states none."""
    words = re.sub(r"[\W_]+", "_", str(name).lower()).strip("_")
    head, _, unit = words.rpartition("_")
    return (head, unit) if head and unit in UNITS else (words, None)


def _extra(cells: pd.Series) -> np.ndarray:
    """Cells of another column: numbers where all are written as such, else as they are."""
    if all(isinstance(cell, str) and re.fullmatch(NUMBER_PATTERN, cell) for cell in cells):
        return pd.to_numeric(cells).to_numpy()
    return cells.to_numpy() if cells.dtype.kind in "biuf" else cells.to_numpy(object)
