"""Packing lists: the boxes of a load in a CSV file."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from unload.load.boxes import (
    BELOW,
    CONTACT_TOLERANCE,
    OVERLAP,
    SMALLEST_EDGE,
    Load,
    outside,
    overlapping,
    slabs,
)
from unload.support import files

EXAMPLE = files.SHIPPED / "example.csv"  # of boxes in three walls
CENTRE, CORNER, SIZES = (
    tuple(name.format(axis) for axis in "xyz") for name in ("{}", "{}_min", "size_{}")
)


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
        FileNotFoundError: there is no such file.
        ValueError: the file is no CSV, or a column is missing; or a box has an edge that is no
            number or too short, has the id of another one, sticks out of the container, overlaps
            another one, or floats: it stands neither on the floor nor, within 0.1 mm, on a box.
            The message names the first rows, counted from 1 without the line of names, and the
            ids.
    """
    try:
        table = pd.read_csv(path, dtype={"id": str}, skipinitialspace=True, keep_default_na=False)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not a readable CSV file: {error}") from error
    if not isinstance(table.index, pd.RangeIndex):  # pandas takes what is too much for an index
        raise ValueError(f"{path} has more cells in a row than names; expected as many")
    place = CENTRE if set(CENTRE) <= set(table.columns) else CORNER
    missing = [name for name in (*place, *SIZES) if name not in table.columns]
    if missing or table.empty:
        raise ValueError(
            f"{path} has {len(table)} rows and the columns {', '.join(table.columns)}; expected "
            f"boxes with x, y, z or x_min, y_min, z_min, and with {', '.join(SIZES)}"
        )
    ids = table["id"] if "id" in table.columns else pd.Series(range(1, len(table) + 1))
    ids = ids.astype(str).to_numpy()

    def refuse(items: Iterable[int], problem: str) -> None:
        named = [f"row {item + 1} (id {str(ids[item])!r})" for item in items]
        if named:
            more = f" and {len(named) - 5} more" if len(named) > 5 else ""
            raise ValueError(f"{path}: {', '.join(named[:5])}{more} {problem}")

    numbers = table[[*place, *SIZES]].apply(pd.to_numeric, errors="coerce").to_numpy(np.float64)
    where, sizes = numbers[:, :3], numbers[:, 3:]
    refuse(np.flatnonzero(pd.Series(ids).duplicated(keep=False)), "share an id; expected one each")
    refuse(np.flatnonzero(~np.isfinite(numbers).all(axis=1)), "hold no number; expected lengths")
    short = sizes.min(axis=1) < SMALLEST_EDGE
    refuse(np.flatnonzero(short), f"are too small; expected edges of {SMALLEST_EDGE} m or more")
    positions = where if place is CENTRE else where + sizes / 2
    low, high = positions - sizes / 2, positions + sizes / 2
    refuse(np.flatnonzero(outside(low, high)), "stick out of the container of 7 × 2.5 × 2.5 m")
    refuse(overlapping(low, high), "overlap; expected disjoint boxes")
    packages = np.unique(np.rint(sizes / OVERLAP), axis=0, return_inverse=True)[1].reshape(-1)
    load = Load(positions, sizes, packages, slabs(low[:, 0] + OVERLAP, high[:, 0]), ids)
    supports = np.diff(load.contacts.starts[BELOW])
    floating = (supports == 0) & (low[:, 2] > CONTACT_TOLERANCE)
    refuse(np.flatnonzero(floating), "float; expected boxes on the floor or on others")
    return load
