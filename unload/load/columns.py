"""What the columns of a packing list mean, by their names."""

import logging
import re
import unicodedata
from collections.abc import Iterable, Sequence
from typing import NoReturn

import numpy as np

from unload.load.tables import Table
from unload.support import checks

LOGGER = logging.getLogger(__name__)
CENTRE, CORNER = ("x", "y", "z"), ("x_min", "y_min", "z_min")
SIZES = "size_x", "size_y", "size_z"
INCHES, POUNDS = 1 / 0.0254, 1 / 0.45359237  # in a metre, and in a kilogram
LENGTHS = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "in": INCHES}  # of a unit in a metre
# Of other units in a metre, a kilogram or a degree.
UNITS = LENGTHS | {
    "inch": INCHES, "inches": INCHES, "ft": INCHES / 12,
    "kg": 1.0, "g": 1000.0, "lb": POUNDS, "lbs": POUNDS,
    "deg": 1.0, "degrees": 1.0, "grad": 1.0, "rad": np.pi / 180,
}  # fmt: skip
# The names of a column, in lower case, by what it means: in English, German, French and Spanish.
# Of several for an id or a weight the first one counts.
NAMES = {
    "id": "id label name box box_id item item_id sscc nve hu hu_id hu_nr handling_unit carton "
    "carton_id carton_no case_id package_id pallet_id karton kartonnummer packstück packstueck "
    "packstück_nr kolli kolli_nr colis n_colis no_colis palette bulto n_bulto caja",
    "size_x": "size_x dx length l depth d länge laenge tiefe longueur profondeur largo longitud "
    "profundidad",
    "size_y": "size_y dy width w breite b largeur ancho anchura",
    "size_z": "size_z dz height h höhe hoehe hauteur alto altura",
    **{axis: f"{axis} {axis}_center {axis}_centre center_{axis} centre_{axis}" for axis in CENTRE},
    **{f"{axis}_min": f"{axis}_min min_{axis} pos_{axis} {axis}_pos position_{axis}"
       for axis in CENTRE},
    "weight": "weight mass gross_weight bruttogewicht gewicht masse poids_brut poids peso_bruto "
    "peso net_weight nettogewicht poids_net peso_neto",
    "rotation": "rotation yaw pitch roll tilt angle drehung winkel rotación rotacion giro",
}  # fmt: skip
MEANINGS = {name: meaning for meaning, names in NAMES.items() for name in names.split()}
ONE_COUNTS = ("id", "weight")


def plain(name: str) -> tuple[str, float | None]:
    """A column's name in lower case without its unit, and how many of these are 1 m, kg or degree.

    The latter is None where the name says no unit.
    """
    composed = unicodedata.normalize("NFC", name).lower().replace('"', " in ")
    words = re.sub(r"[\W_]+", "_", composed).strip("_")
    head, _, unit = words.rpartition("_")
    scale = UNITS.get(unit) if head else None
    return (head.removesuffix("_in") if scale else words), scale


def is_known(name: str) -> bool:
    """Whether a column of this name has a meaning."""
    return plain(name)[0] in MEANINGS


class Columns:
    """The columns of a table by what they mean; what was understood is logged.

    Args:
        table: the list.
        renamed: name in the list → meaning, or one of its names, by the caller.
        ignore: names of columns without a meaning.

    Attributes:
        ids: of the rows, their numbers from 1 if the list has none.
    """

    def __init__(self, table: Table, renamed: dict[str, str], ignore: Iterable[str]) -> None:
        self._table, self._source, names = table, table.source, [*table.cells]
        words = {name: plain(name)[0] for name in names}
        self._scales = {name: plain(name)[1] for name in names}
        twice = [name for name in names if [*words.values()].count(words[name]) > 1]
        if twice or len(names) < len(table.names):
            wanted = "expected a line of names, each once"
            raise ValueError(f"{self._source} has the columns {table.names}; {wanted}")
        ignored = {*ignore}
        for name in ({*renamed} - {*names}) | (ignored - {*names, *words.values()}):
            raise ValueError(f"{self._source} has no column {name!r}; expected one of {names}")

        # A column means what the caller says, or what its name says, or nothing here.
        self._of: dict[str, list[str]] = {}
        rest = []
        for name in names:
            said = renamed.get(name, words[name])
            meaning = MEANINGS.get(str(said), said if name in renamed else None)
            if {name, words[name]} & ignored:
                continue
            if meaning is None:
                rest.append(name)
            else:
                self._of.setdefault(checks.one_of("columns", meaning, NAMES), []).append(name)
        for meaning in ONE_COUNTS:
            ranks = [*renamed, *NAMES[meaning].split()]
            several = self._of.get(meaning, [])
            several.sort(key=lambda name: ranks.index(name if name in renamed else words[name]))
            rest += several[1:]
            del several[1:]

        places = [place for place in (CENTRE, CORNER) if {*place} & {*self._of}]
        needed = [*places[0], *SIZES] if len(places) == 1 else []
        if not len(table) or [len(self.of(name)) for name in needed] != [1] * 6:
            raise ValueError(
                f"{self._source} has {len(table)} rows and the columns {', '.join(names)}; "
                "expected boxes with either x, y, z or x_min, y_min, z_min, and with size_x, "
                "size_y, size_z, each once; columns can say what other names mean"
            )
        understood = [
            f"{name} as {meaning}"
            for meaning, found in self._of.items()
            for name in found
            if name not in renamed and words[name] != meaning
        ]
        for how, columns in (("read", understood), ("kept as they are:", rest)):
            if columns:
                LOGGER.warning("%s: %s %s", self._source, how, ", ".join(columns))
        rows = [str(row + 1) for row in range(len(table))]
        self.ids = table.cells.get(self.first("id"), rows)

    def of(self, meaning: str) -> list[str]:
        """The names of the columns of a meaning."""
        return self._of.get(meaning, [])

    def first(self, meaning: str) -> str | None:
        """The name of the column of a meaning, None without one."""
        return next(iter(self.of(meaning)), None)

    def numbers(self, names: list[str], usual: float = 1.0) -> np.ndarray:
        """Columns in m, kg or degrees, (n, k) float64, with ``usual`` where a name says no unit."""
        cells = [[_number(cell) for cell in self._table.with_points(name)] for name in names]
        numbers = np.array(cells).T
        unreadable = ~np.isfinite(numbers)
        if (rows := np.flatnonzero(unreadable.any(axis=1))).size:
            shown = [name for name, wrong in zip(names, unreadable[rows[0]]) if wrong]
            self.refuse(rows, "a cell that is no number; expected one", shown)
        return numbers / [self._scales[name] or usual for name in names]

    def refuse(self, rows: Sequence[int] | np.ndarray, problem: str, shown: list[str]) -> NoReturn:
        """Raise a ValueError that names rows, and shows cells of the first."""
        named = ", ".join(f"row {row + 1} (id {self.ids[row]!r})" for row in rows[:5])
        more = f" and {len(rows) - 5} more" if len(rows) > 5 else ""
        cells = ", ".join(f"{name} {self._table.cells[name][rows[0]]!r}" for name in shown)
        raise ValueError(f"{self._source}: {named}{more}: {problem} (the first has {cells})")

    def unit(self, lengths: list[str], units: str | None) -> float:
        """How many are 1 m where a length's name says no unit: of ``units``, or as the others'."""
        silent = [name for name in lengths if self._scales[name] is None]
        stated = {self._scales[name] for name in lengths} - {None}
        if silent and units is None and stated:
            if len(stated) > 1:
                wanted = "expected units"
                raise ValueError(f"{self._source} says no unit of {', '.join(silent)}; {wanted}")
            found = ", ".join(silent)
            LOGGER.warning("%s: in the unit of the other lengths: %s", self._source, found)
        return LENGTHS[units] if units else max(stated, default=1.0)


def _number(cell: str) -> float:
    try:
        return np.nan if "_" in cell else float(cell)
    except ValueError:
        return np.nan
