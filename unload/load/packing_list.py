"""Packing lists: the boxes of a load in a CSV file."""

from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
import pandas as pd

from unload.load.boxes import OVERLAP, BoxError, Load, check_stacked, slabs
from unload.support import checks, files

EXAMPLE = files.SHIPPED / "example.csv"  # of boxes in three walls
CENTRE, CORNER = ("x", "y", "z"), ("x_min", "y_min", "z_min")
SIZES = "size_x", "size_y", "size_z"


def read_load(path: str | Path = EXAMPLE) -> Load:
    """Read a packing list.

    The file is CSV with a line of names above the boxes, one line a box, all lengths in m. The
    container's axes are x (depth, 0 at the rear wall and 7 at the entrance), y (width, 0 to 2.5)
    and z (height, 0 to 2.5).

    - ``x``, ``y``, ``z``: centre of the box, or ``x_min``, ``y_min``, ``z_min``: its corner nearest
      to the origin;
    - ``size_x``, ``size_y``, ``size_z``: edge lengths, at least 0.002;
    - ``id``: name of the box; the number of its row if there is no such column.

    Other columns are left out.

    Args:
        path: of the file; by default an example.

    Returns:
        The load in the order of the file, with its ``ids``. Boxes of equal size are of one
        package, and boxes that share a stretch of depth are of one wall.

    Raises:
        TypeError: ``path`` is none.
        FileNotFoundError: there is no such file.
        ValueError: the file is no CSV; a column is missing, given twice or spelled otherwise; there
            are both centres and corners; or a box has an edge that is no number or too short, has
            the id of another one, is not inside the container, overlaps another one, or floats: it
            stands neither on the floor nor, within 0.1 mm, on a box. The message names the first
            rows, counted from 1 without the line of names, and their ids.
    """
    path = checks.path("path", path)
    try:
        # Nothing is unpacked by its ending: a damaged archive is no CSV file, like any other.
        table = pd.read_csv(
            path, dtype=str, skipinitialspace=True, keep_default_na=False, compression=None
        )
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not a readable CSV file: {error}") from error
    if not isinstance(table.index, pd.RangeIndex):  # pandas takes what is too much for an index
        raise ValueError(f"{path} has more cells in a row than names; expected as many")
    place = _place_columns(path, table)
    ids = table["id"] if "id" in table.columns else pd.Series(range(1, len(table) + 1))
    ids = ids.astype(str).to_numpy()
    cells = table[[*place, *SIZES]]

    def refuse(items: Sequence[int] | np.ndarray, problem: str) -> NoReturn:
        named = ", ".join(f"row {item + 1} (id {str(ids[item])!r})" for item in items[:5])
        more = f" and {len(items) - 5} more" if len(items) > 5 else ""
        first = ", ".join(f"{name} {cell!r}" for name, cell in cells.iloc[items[0]].items())
        raise ValueError(f"{path}: {named}{more}: {problem} (the first has {first})")

    # What concerns cells is refused here, what concerns boxes by the load.
    numbers = cells.apply(pd.to_numeric, errors="coerce").to_numpy(np.float64)
    unreadable = np.flatnonzero(~np.isfinite(numbers).all(axis=1))
    if unreadable.size:
        refuse(unreadable, "a cell that is no number; expected lengths in m")

    # Boxes of one size are a package; those that share a stretch of depth are a wall.
    where, sizes = numbers[:, :3], numbers[:, 3:]
    positions = where if place is CENTRE else where + sizes / 2
    packages = np.unique(np.rint(sizes / OVERLAP), axis=0, return_inverse=True)[1].reshape(-1)
    walls = slabs(positions[:, 0] - sizes[:, 0] / 2 + OVERLAP, positions[:, 0] + sizes[:, 0] / 2)
    try:
        load = Load(positions, sizes, packages, walls, ids)
        check_stacked(load)
    except BoxError as error:
        refuse(error.boxes, error.problem)
    return load


def _place_columns(path: Path, table: pd.DataFrame) -> tuple[str, ...]:
    """``CENTRE`` or ``CORNER``, of which a packing list has the columns."""
    # A name that differs in case or space alone would silently count as another column.
    known = {"id", *CENTRE, *CORNER, *SIZES}
    for column in table.columns:
        name = column.strip().lower().partition(".")[0]  # pandas calls a second one "x.1"
        if name in known and column not in known:
            raise ValueError(f"{path} has the column {column!r}; expected {name!r}, and once")

    places = [place for place in (CENTRE, CORNER) if {*place} & {*table.columns}]
    if table.empty or len(places) != 1 or not {*places[0], *SIZES} <= {*table.columns}:
        raise ValueError(
            f"{path} has {len(table)} rows and the columns {', '.join(table.columns)}; expected "
            f"boxes with either x, y, z or x_min, y_min, z_min, and with {', '.join(SIZES)}"
        )
    return places[0]
