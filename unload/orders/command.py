"""The command ``unload``: an order of picks for a packing list."""

import argparse
import os
import sys
from pathlib import Path

from unload import task
from unload.support import checks, files

DESCRIPTION = """\
Print an order in which the boxes of a packing list can be taken out: pick, id, item, covered
(True if another box lay on it or hung over it), behind (True if another one stood in front of
it), with --by early (True if a box of an earlier stop was left), and the list's other columns.

A line of the list is a box. Its columns, in any order, in capitals or not:
  x_min, y_min, z_min      corner nearest to the origin (pos_x, ...), or x, y, z, the centre
  size_x, size_y, size_z   edges along the axes (length, width, height)
  id                       optional
  rotation                 optional, in degrees: quarter turns

Lengths are in m unless --units or a name says otherwise, as length_mm and "x (cm)" do. The
axes are x (depth, 0 at the rear wall), y (width, 0 at the left wall, seen from the entrance)
and z (height, 0 at the floor). unload.read_load and unload.picking_order say more.

  unload list.csv --units cm --container 13.6 2.48 2.7 --by stop
"""
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # what a formula in a spreadsheet begins with


def main(arguments: list[str] | None = None) -> None:
    """Run the command with these arguments, those of the process if None."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("unload", description=DESCRIPTION, formatter_class=form)
    text = "CSV or Excel file; an example if missing"
    parser.add_argument("list", nargs="?", help=text)
    text = "column of stop numbers: the lowest first, or the highest with --by=-COLUMN"
    parser.add_argument("--by", metavar="COLUMN", help=text)
    parser.add_argument("--output", help="CSV file; the screen if missing")
    text = "PNG file for a picture of the load, its first fifty picks numbered"
    parser.add_argument("--picture", metavar="FILE", help=text)
    parser.add_argument("--units", default="m", help="of lengths: m, cm, mm or in")
    size: dict = {"type": float, "nargs": 3, "metavar": ("LENGTH", "WIDTH", "HEIGHT")}
    text = "its inner size in m; the paper's is 7 2.5 2.5"
    parser.add_argument("--container", default=task.CONTAINER, help=text, **size)
    parser.add_argument("--x-from", default="rear", help="where x is 0: rear (the default) or door")
    text = "in m: how far each box may be from where it belongs (%(default)s)"
    parser.add_argument("--tolerance", type=float, default=0.005, help=text)
    text = "what a column is, such as Länge=size_x; may be repeated"
    parser.add_argument("--column", action="append", default=[], metavar="NAME=MEANING", help=text)
    text = "line of the list that holds the names of its columns, if a title stands above"
    parser.add_argument("--header", type=int, default=1, metavar="N", help=text)
    parser.add_argument("--version", action="version", version=f"unload {task.VERSION}")
    options = vars(parser.parse_args(arguments))

    from unload.orders.order import picking_order  # not before: help takes no time
    from unload.orders.packing_list import EXAMPLE, ListError, read_load

    path, by, output, picture, columns = (
        options.pop(name) for name in ("list", "by", "output", "picture", "column")
    )
    options["columns"] = dict(entry.partition("=")[::2] for entry in columns)
    try:
        _check_names(path, output, picture)
        load = read_load(EXAMPLE if path is None else path, **options)
        order = picking_order(load, by)
        text = order.map(_guarded).rename(columns=_guarded).to_csv(index=False, lineterminator="\n")
        if picture is not None:
            with checks.needed_for("--picture"):
                from unload.drawing.picture import numbered
            drawn = numbered(load, order["item"].to_numpy())
            files.write_atomically(picture, lambda file: file.write(drawn))
        _write(text, output)
    except ListError as error:
        option = {"columns": "column NAME=MEANING", None: ""}.get(error.argument, error.argument)
        parser.exit(1, error.problem + (f"; see the option --{option}\n" if option else "\n"))
    except (ImportError, OSError, TypeError, ValueError) as error:  # ImportError: of an extra
        parser.exit(1, f"{error}\n")
    under, behind = order["covered"].sum(), order["behind"].sum()
    said = f"{len(order)} picks, {under} under and {behind} behind others"
    if by is not None:
        said += f", {order['early'].sum()} before their stop"
    if picture is not None:
        said += f"; the picture is {Path(picture).resolve()}"
    if sys.stderr is not None:  # None if closed: print would take the screen, where the order is
        print(said, file=sys.stderr)


def _check_names(path: str | None, output: str | None, picture: str | None) -> None:
    """Raise ValueError if what is to be written cannot be, or would replace another file."""
    if output is None and sys.stdout is None:
        raise ValueError("the standard output is closed; expected it open, or --output")
    names = [] if path is None else [Path(path)]
    for option, name in {"--output": output, "--picture": picture}.items():
        if name is not None:
            names.append(checks.file(option, name))
            if not os.access(names[-1].resolve().parent, os.W_OK):
                wanted = "expected it in a folder that is there and may be written to"
                raise ValueError(f"{option} is {name!r}; {wanted}")
    # A file that is there may have several names; its inode and device are the same under all.
    identities = {n.stat()[1:3] if n.exists() else n.resolve() for n in names}
    if len(identities) < len(names):
        raise ValueError(f"{' and '.join(map(str, names))} are one file; expected different ones")


def _guarded(cell):
    """A text that a spreadsheet would take for a formula, with an apostrophe before it."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell


def _write(text: str, output: str | None) -> None:
    """Write text as UTF-8, whatever a console has, or as a whole file."""
    if output is not None:
        return files.write_text(output, text)
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(encoding="utf-8")
    sys.stdout.write(text)
