"""Packing lists: the boxes of a load in a file or a table, as they come.

``tables`` reads the cells, and ``columns`` what they mean.
"""

import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from unload import task
from unload.load.boxes import CONTACT_TOLERANCE, LARGEST_TOLERANCE, BoxError, Load, check_stacked
from unload.load.columns import CENTRE, CORNER, LENGTHS, SIZES, Columns, is_known
from unload.load.settling import settle, uncarried
from unload.load.tables import Table, read_table
from unload.support import checks, files

if TYPE_CHECKING:  # of a third of a second to import
    import pandas as pd

LOGGER = logging.getLogger(__name__)
EXAMPLE = files.SHIPPED / "example.csv"  # of boxes in three walls
NUMBER = re.compile(r"-?(0|[1-9]\d*)(\.\d+)?")  # no code with zeros in front


def read_load(
    path: "str | Path | pd.DataFrame" = EXAMPLE,
    units: str | None = None,
    columns: Mapping[str, str] | None = None,
    tolerance: float = 0.005,
    container: Sequence[float] | np.ndarray | None = None,
    x_from: str = "rear",
    ignore: Iterable[str] = (),
) -> Load:
    """Read a packing list: a line of names, and one line for each box.

    Cells are separated by commas, or by semicolons or tabs, where decimals may have a comma; the
    text is UTF-8, UTF-16 with its mark, or Windows-1252. Lines before the names, comments (``#``)
    and totals at the end are left out and logged. JSON holds records or columns; ``.xlsx`` needs
    the extra ``unload[excel]``. The container's axes are x (depth, 0 at the rear wall), y (width, 0
    at the left wall, seen from the entrance) and z (height).

    - ``x_min``, ``y_min``, ``z_min``, also ``pos_x``, ...: the box's corner nearest to the origin;
      or ``x``, ``y``, ``z``, also ``x_center``, ...: its centre;
    - ``size_x``, ``size_y``, ``size_z``, also ``length`` (``l``, ``depth``, ``d``), ``width``
      (``w``), ``height`` (``h``): edges along the axes as the box stands, at least 2 mm;
    - ``id``, also ``label``, ``name``, ``box`` or ``item``: the number of the row if missing;
    - ``weight`` or ``mass``: 1 kg each if missing, as in the task;
    - ``rotation``, ``yaw``, ``pitch``, ``roll``, ``tilt`` or ``angle``, in degrees: quarter turns.

    A line is one box, whatever a quantity says. Capitals and spaces make no difference, and
    ``unload.load.columns`` lists further names, also German, French and Spanish ones. A name may
    end in its unit: ``length_mm``, ``x (cm)``, ``weight_lb``. Other columns become
    ``Load.extras``. What was understood is logged.

    Args:
        path: of the file, by default an example; or a table.
        units: of lengths whose names say none: ``"m"``, ``"cm"``, ``"mm"`` or ``"in"``. By default
            that of the other names, which is logged, and m if no name says one.
        columns: name in the list → name above, for other names.
        tolerance: in m, up to 0.1, how far each box may be from where it belongs. Boxes that
            overlap, float or stick out by no more are moved, down onto what is below and clear of
            what is beside; where a row is too long for the container its boxes are made smaller by
            no more. How many and how far is logged. A box touches whatever is so little below it.
        container: (3,) its inner length, width and height in m; by default the paper's.
        x_from: ``"rear"``, or ``"door"`` if x counts from there to the box's front or centre.
        ignore: columns that become ``Load.extras`` whatever they say, such as the weight.

    Returns:
        The load in the order of the list, with its ``ids``.

    Raises:
        TypeError: an argument is of another type.
        FileNotFoundError: there is no such file.
        ModuleNotFoundError: the file needs an extra; the message names it.
        ValueError: an argument is not as described; the list cannot be read, lacks a column or has
            two for the same; or a box is refused. The message names the first rows, counted from 1
            without the line of names, and their ids.
    """
    checks.one_of("units", units, (None, *LENGTHS))
    checks.one_of("x_from", x_from, ("rear", "door"))
    tolerance = checks.real("tolerance", tolerance, 0, LARGEST_TOLERANCE)
    container = task.CONTAINER if container is None else container
    container = checks.finite_array("container", container, (3,))
    checks.entries("columns", renamed := {} if columns is None else columns, ())
    if isinstance(ignore, str) or not isinstance(ignore, Iterable):
        raise TypeError(f"ignore is {ignore!r}; expected a list of names of columns")
    table = read_table(path, lambda name: name in renamed or is_known(name))
    known = Columns(table, dict(renamed), ignore)

    # A box turned otherwise than by quarter turns is none along the axes.
    for name in known.of("rotation"):
        angles = known.numbers([name])[:, 0]
        if (turned := np.flatnonzero(np.abs((angles + 45) % 90 - 45) > 1e-3)).size:
            problem = "a rotation that is no quarter turn; expected none"
            known.refuse(turned, f"{problem}, or {name!r} in ignore", [name])
        if angles.any():
            LOGGER.warning("%s: sizes are taken for those after the turns", table.source)
    masses, weight = None, known.first("weight")
    if weight is not None:
        masses = known.numbers([weight])[:, 0]

    # Lengths in m, and x from the rear.
    place = CENTRE if known.first(CENTRE[0]) else CORNER
    shown = [known.first(name) for name in (*place, *SIZES)]
    usual = known.unit(shown, units)
    listed, sizes = np.hsplit(known.numbers(shown, usual), 2)
    half = sizes / 2

    def centres_of(place: Sequence[str]) -> np.ndarray:
        centres = listed + (0 if place is CENTRE else half)
        if x_from == "door":
            centres[:, 0] = container[0] - centres[:, 0]
        return centres

    # What fits stays, to the bit, where and as large as the list says.
    centres = centres_of(place)
    low, high = centres - half, centres + half
    moves, smaller = settle(low, sizes, container, tolerance)
    try:
        load = Load(
            centres + moves,
            sizes - smaller,
            ids=np.array(known.ids),
            container=container,
            ceiling=container[2],
            extras=_extras(path, table, shown, known.first("id")),
            masses=masses,
            contact_tolerance=max(tolerance, CONTACT_TOLERANCE),
        )
        check_stacked(load)
    except BoxError as error:
        for start, name in (("a mass", weight), ("the same id", known.first("id"))):
            if error.problem.startswith(start):
                known.refuse(error.boxes, error.problem, [name])
        first, problem = error.boxes[0], f"{error.problem}, tolerance {tolerance} m"
        if moves[first].any() or smaller[first].any():  # whose coordinates the list does not hold
            problem = (
                f"lies from {low[first]} to {high[first]} m; expected a place within {tolerance} m "
                "on the floor or on others, clear of those beside it and of the walls"
            )
        other = CORNER if place is CENTRE else CENTRE
        outside = [  # whether any box sticks out
            (abs(centres_of(each) - container / 2) + half > container / 2 + tolerance).any()
            for each in (place, other)
        ]
        if usual == 1 and sizes.max() > container.max():
            problem += "; in m, expected cm, mm or in as units otherwise"
        elif outside[0] and not outside[1]:
            named = dict(zip(shown, other))
            problem += f"; all lie inside if these are {', '.join(other)}: columns {named}"
        elif outside[0] and (container == task.CONTAINER).all():
            problem += "; if it is not the paper's container, expected its size as container"
        known.refuse(error.boxes, problem, shown)
    if (tipping := uncarried(load)).size:
        known.refuse(tipping, "tips, because nothing carries its centre of mass", shown)
    for changes, what in ((moves, "moved by"), (smaller, "taken for smaller, by")):
        if changes.any():
            LOGGER.warning(
                "%s: %d of %d boxes %s up to %.1f mm, to fit what is below and beside them",
                table.source, changes.any(axis=1).sum(), len(load), what,
                1000 * np.linalg.norm(changes, axis=1).max(),
            )  # fmt: skip
    return load


def _extras(path, table: Table, shown: list[str], id_: str | None) -> dict[str, np.ndarray]:
    """What a list says besides, as numbers where all cells are; of a table as they are."""
    extras = {}
    for name in table.cells:
        if name in shown or name == id_:
            continue
        cells = table.with_points(name)
        extras[name] = np.array(cells, object)
        if hasattr(path, "columns"):
            given = path.iloc[:, table.names.index(name)]
            if given.dtype.kind in "biuf":
                extras[name] = given.to_numpy()
        elif all(map(NUMBER.fullmatch, cells)):
            number = float if "." in "".join(cells) else int
            extras[name] = np.array([number(cell) for cell in cells])
    return extras
