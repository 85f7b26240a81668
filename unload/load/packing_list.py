"""Packing lists: the boxes of a load in a file or a table, as they come."""

import io
import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from unload import task
from unload.load.boxes import CONTACT_TOLERANCE, LARGEST_TOLERANCE, BoxError, Load, check_stacked
from unload.load.settling import settle, uncarried
from unload.support import checks, files

LOGGER = logging.getLogger(__name__)
EXAMPLE = files.SHIPPED / "example.csv"  # of boxes in three walls
CENTRE, CORNER = ("x", "y", "z"), ("x_min", "y_min", "z_min")
SIZES = "size_x", "size_y", "size_z"
INCHES, POUNDS = 1 / 0.0254, 1 / 0.45359237  # in a metre, and in a kilogram
LENGTHS = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "in": INCHES}  # of a unit in a metre
# Of other units in a metre, a kilogram or a degree.
UNITS = LENGTHS | {
    "inch": INCHES, "inches": INCHES, "kg": 1.0, "g": 1000.0, "lb": POUNDS, "lbs": POUNDS,
    "deg": 1.0, "degrees": 1.0, "rad": np.pi / 180,
}  # fmt: skip
# The names of a column, in lower case, by what it means; of several ids the first one counts.
NAMES = {
    "id": "id label name box box_id item item_id",
    "size_x": "size_x dx length l depth d",
    "size_y": "size_y dy width w",
    "size_z": "size_z dz height h",
    **{axis: f"{axis} {axis}_center {axis}_centre center_{axis} centre_{axis}" for axis in CENTRE},
    **{f"{axis}_min": f"{axis}_min min_{axis} pos_{axis} position_{axis}" for axis in CENTRE},
    "weight": "weight mass",
    "rotation": "rotation yaw pitch roll tilt angle",
}
MEANINGS = {name: meaning for meaning, names in NAMES.items() for name in names.split()}
NUMBER = r"-?(0|[1-9]\d*)(\.\d+)?"  # no code with zeros in front


def read_load(
    path: str | Path | pd.DataFrame = EXAMPLE,
    units: str | None = None,
    columns: Mapping[str, str] | None = None,
    tolerance: float = 0.005,
    container: Sequence[float] | np.ndarray | None = None,
    x_from: str = "rear",
    ignore: Iterable[str] = (),
) -> Load:
    """Read a packing list: a line of names, and one line for each box.

    Cells are separated by commas, or by semicolons or tabs, where decimals may have a comma; the
    text is UTF-8, or UTF-16 with its mark. The container's axes are x (depth, 0 at the rear wall),
    y (width, 0 at the left wall, seen from the entrance) and z (height).

    - ``x_min``, ``y_min``, ``z_min``, also ``pos_x``, ...: the box's corner nearest to the origin;
      or ``x``, ``y``, ``z``, also ``x_center``, ...: its centre;
    - ``size_x``, ``size_y``, ``size_z``, also ``length`` (``l``, ``depth``, ``d``), ``width``
      (``w``), ``height`` (``h``): edges along the axes as the box stands, at least 2 mm;
    - ``id``, also ``label``, ``name``, ``box`` or ``item``: the number of the row if missing;
    - ``weight`` or ``mass``: 1 kg, as in the task;
    - ``rotation``, ``yaw``, ``pitch``, ``roll``, ``tilt`` or ``angle``, in degrees: quarter turns.

    Capitals and spaces make no difference. A name may end in its unit: ``length_mm``, ``x (cm)``,
    ``weight_lb``. Other columns become ``Load.extras``, and are logged.

    Args:
        path: of the file, by default an example; or a table.
        units: of lengths whose names say none: ``"m"``, ``"cm"``, ``"mm"`` or ``"in"``. By default
            that of the other names, which is logged, and m if no name says one.
        columns: name in the list → name above, for other names.
        tolerance: in m, up to 0.1. Boxes that overlap, float or stick out by no more are moved,
            down onto what is below and clear of what is beside; how many and how far is logged.
            A box touches whatever is so little below it.
        container: (3,) its inner length, width and height in m; by default the paper's.
        x_from: ``"rear"``, or ``"door"`` if x counts from there to the box's front or centre.
        ignore: columns that become ``Load.extras`` whatever they say, such as the weight.

    Returns:
        The load in the order of the list, with its ``ids``.

    Raises:
        TypeError: an argument is of another type.
        FileNotFoundError: there is no such file.
        ValueError: an argument is not as described; the list cannot be read, lacks a column or has
            two for the same; or a box is refused. The message names the first rows, counted from 1
            without the line of names, and their ids.
    """
    checks.one_of("units", units, (None, *LENGTHS))
    checks.one_of("x_from", x_from, ("rear", "door"))
    tolerance = checks.real("tolerance", tolerance, 0, LARGEST_TOLERANCE)
    container = task.CONTAINER if container is None else container
    container = checks.finite_array("container", container, (3,))
    source, table, comma = _table(path)
    scale_of, column_of, rest = _columns(source, table, dict(columns or {}), ignore)

    rows = pd.Series(range(1, len(table) + 1)).astype(str)
    ids = table.pop(column_of["id"][0]) if "id" in column_of else rows
    if comma:
        table = table.replace(r"^\s*(-?\d+),(\d+)\s*$", r"\1.\2", regex=True)

    def refuse(items: Sequence[int] | np.ndarray, problem: str, shown: Sequence[str]) -> NoReturn:
        named = ", ".join(f"row {item + 1} (id {ids[item]!r})" for item in items[:5])
        more = f" and {len(items) - 5} more" if len(items) > 5 else ""
        first = ", ".join(f"{name} {cell!r}" for name, cell in table.loc[items[0], shown].items())
        raise ValueError(f"{source}: {named}{more}: {problem} (the first has {first})")

    def numbers(shown: list[str], scale: float = 1.0) -> np.ndarray:
        """Columns in m, kg or degrees, (n, k) float64; ``scale`` is that of names without one."""
        cells = table[shown].apply(pd.to_numeric, errors="coerce").to_numpy(np.float64)
        unreadable = np.flatnonzero(~np.isfinite(cells).all(axis=1))
        if unreadable.size:
            refuse(unreadable, "a cell that is no number; expected one", shown)
        return cells / [scale_of[name] or scale for name in shown]

    # Nothing that the task leaves out is passed over: one mass, and boxes along the axes.
    for meaning, problem in (
        ("weight", "a weight other than 1 kg"),
        ("rotation", "a rotation that is no quarter turn"),
    ):
        for name in column_of.get(meaning, ()):
            cells = numbers([name])[:, 0]
            off = cells - 1 if meaning == "weight" else (cells + 45) % 90 - 45
            if (other := np.flatnonzero(np.abs(off) > 1e-3)).size:
                refuse(other, f"{problem}; expected none, or {name!r} in ignore", [name])
            if meaning == "rotation" and cells.any():
                LOGGER.warning("%s: sizes are taken for those after the turns", source)
    if rest:
        LOGGER.warning("%s: kept but not used: %s", source, ", ".join(rest))

    # Lengths in m, and x from the rear.
    place = CENTRE if CENTRE[0] in column_of else CORNER
    shown = [column_of[name][0] for name in (*place, *SIZES)]
    silent = [name for name in shown if scale_of[name] is None]
    stated = {scale_of[name] for name in shown} - {None}
    if silent and units is None and len(stated) > 1:
        raise ValueError(f"{source} says no unit of {', '.join(silent)}; expected units=...")
    if silent and units is None and stated:
        LOGGER.warning("%s: in the unit of the other lengths: %s", source, ", ".join(silent))
    scale = LENGTHS[units] if units else max(stated, default=1.0)
    centres, sizes = np.hsplit(numbers(shown, scale), 2)
    centres += 0 if place is CENTRE else sizes / 2
    if x_from == "door":
        centres[:, 0] = container[0] - centres[:, 0]

    # What fits stays, to the bit, where the list puts it.
    moves = settle(centres - sizes / 2, sizes, container, tolerance)
    extras = {
        name: pd.to_numeric(cells) if cells.str.fullmatch(NUMBER).all() else cells.astype(object)
        for name, cells in table.drop(columns=shown).items()
    }
    if isinstance(path, pd.DataFrame):  # whose numbers need not be read
        extras |= {name: path[name] for name in extras if is_numeric_dtype(path.get(name))}
    try:
        load = Load(
            centres + moves,
            sizes,
            ids=ids,
            container=container,
            extras=extras,
            contact_tolerance=max(tolerance, CONTACT_TOLERANCE),
        )
        check_stacked(load)
    except BoxError as error:
        problem = f"{error.problem}, tolerance {tolerance} m"
        if scale == 1 and silent and sizes.max() > container.max():
            problem += "; in m, expected units='cm', 'mm' or 'in' otherwise"
        refuse(error.boxes, problem, shown)
    if (tipping := uncarried(load)).size:
        refuse(tipping, "tips, because nothing carries its centre of mass", shown)
    if moves.any():
        LOGGER.warning(
            "%s: %d of %d boxes moved by up to %.1f mm, onto what is below and beside them",
            source, moves.any(axis=1).sum(), len(load), 1000 * np.linalg.norm(moves, axis=1).max(),
        )  # fmt: skip
    return load


def _table(path: str | Path | pd.DataFrame) -> tuple[str, pd.DataFrame, bool]:
    """What a list is called, its cells as text, and whether decimals may have a comma."""
    if isinstance(path, pd.DataFrame):
        table = path.reset_index(drop=True).astype(str)
        return "the table", table.set_axis(table.columns.astype(str), axis=1), False
    path = checks.path("path", path)
    content = path.read_bytes()
    try:
        marked = content[:2] in (b"\xff\xfe", b"\xfe\xff")
        text = content.decode("utf-16" if marked else "utf-8-sig")
        first_line = text.lstrip().partition("\n")[0]
        separator = max(",;\t", key=first_line.count)
        # Names are a row like the others, so that pandas neither renames nor takes away one.
        table = pd.read_csv(
            io.StringIO(text), sep=separator, header=None, dtype=str, skipinitialspace=True,
            keep_default_na=False,
        )  # fmt: skip
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not a readable CSV file: {error}") from error
    table = table.fillna("").apply(lambda cells: cells.str.strip())
    names, table = table.iloc[0], table[1:].reset_index(drop=True)
    return str(path), table.set_axis([*names], axis=1), separator != ","


def _columns(
    source: str, table: pd.DataFrame, renamed: dict[str, str], ignore: Iterable[str]
) -> tuple[dict[str, float | None], dict[str, list[str]], list[str]]:
    """The unit in each name, None if none; what columns there are of each meaning; and the rest."""
    plain, scale_of = {}, {}
    for name in table.columns:
        words = re.sub(r"[\W_]+", "_", name.lower().replace('"', " in ")).strip("_")
        head, _, unit = words.rpartition("_")
        scale_of[name] = UNITS.get(unit) if head else None
        plain[name] = head.removesuffix("_in") if scale_of[name] else words
    twice = [name for name in plain if [*plain.values()].count(plain[name]) > 1]
    if twice or len(plain) < len(table.columns):
        raise ValueError(f"{source} has {[*table.columns]}; expected each column once")
    ignored = {*ignore}
    for name in ({*renamed} - {*plain}) | (ignored - {*plain, *plain.values()}):
        raise ValueError(f"{source} has no column {name!r}; expected one of {[*plain]}")

    # A column means what the caller says, or what its name says, or nothing here.
    renamed = {name: MEANINGS.get(str(said), said) for name, said in renamed.items()}
    column_of: dict[str, list[str]] = {}
    rest = []
    for name in plain:
        meaning = renamed.get(name, MEANINGS.get(plain[name]))
        if {name, plain[name]} & ignored:
            continue
        if meaning is None:
            rest.append(name)
        else:
            column_of.setdefault(checks.one_of("columns", meaning, NAMES), []).append(name)

    # Of several that could be the id, one that the caller names, or else the first in ``NAMES``.
    ids, ranks = column_of.get("id", []), [*renamed, *NAMES["id"].split()]
    ids.sort(key=lambda name: ranks.index(name if name in renamed else plain[name]))
    rest += ids[1:]

    places = [place for place in (CENTRE, CORNER) if {*place} & {*column_of}]
    needed = [*places[0], *SIZES] if len(places) == 1 else []
    if table.empty or [len(column_of.get(name, [])) for name in needed] != [1] * 6:
        raise ValueError(
            f"{source} has {len(table)} rows and the columns {', '.join(plain)}; expected boxes "
            "with either x, y, z or x_min, y_min, z_min, and with size_x, size_y, size_z, each "
            "once; columns={...} says what other names mean"
        )
    return scale_of, column_of, rest
