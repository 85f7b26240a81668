"""The command line, ``unload``: the order of picks for a packing list, and training."""

import argparse
import inspect
import re
import signal
import sys
from collections.abc import Callable
from dataclasses import fields
from importlib import import_module
from pathlib import Path

from unload.task import VERSION

DESCRIPTION = """\
Print in which order the boxes of a packing list are picked, as CSV: pick, id, item,
distance (m), unloaded (False for a pick that fails), behind (True if another box stands in
front of it), and the list's other columns.

A line of the list is a box. Its columns, in any order; capitals make no difference:
  x_min, y_min, z_min      corner nearest to the origin (pos_x, ...), or x, y, z, the centre
  size_x, size_y, size_z   edges along the axes (length or depth, width, height)
  id                       or label, name; optional
  weight, rotation         optional: 1 kg, and quarter turns
Lengths are in m unless --units or a name says otherwise, as length_mm and "x (cm)" do. The axes
are x (depth, 0 at the rear wall), y (width, 0 at the left wall, seen from the entrance) and z
(height, 0 at the floor). unload.read_load and unload.picking_order say more.

"unload train" trains an agent; "unload train --help" says how.
"""
TRAIN_DESCRIPTION = """\
Train an agent, or go on with a run that was stopped, and print where its policy is. The
options are the fields of unload.TrainConfig, whose defaults are the paper's; * marks
those that are the package's own choice.
"""

FORMULA = ("=", "+", "-", "@", "\t", "\r")  # what a formula in a spreadsheet begins with


def main(arguments: list[str] | None = None) -> None:
    """Run the command line with these arguments, those of the process if None."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments[:1] == ["train"]:
        train_by(arguments[1:])
    else:
        print_order(arguments)


def print_order(arguments: list[str]) -> None:
    """Print the order of picks for a packing list."""
    # Little else, because help should take no time.
    from unload.physics.bullet import engine_of
    from unload.support.files import SHIPPED

    parser = _parser("unload", DESCRIPTION)
    shipped = ", ".join(sorted(file.stem for file in SHIPPED.glob("policies/*.safetensors")))
    known = f"reachable (the default), highest, nearest, random, {shipped}, or a file of weights"
    parser.add_argument("list", nargs="?", help="CSV file; an example if missing")
    parser.add_argument("--policy", default="reachable", help=known)
    parser.add_argument("--output", default=sys.stdout, help="file; the screen if missing")
    parser.add_argument("--units", help="of lengths: m, cm, mm or in")
    size: dict = {"type": float, "nargs": 3, "metavar": ("LENGTH", "WIDTH", "HEIGHT")}
    parser.add_argument("--container", help="its inner size in m; the paper's is 7 2.5 2.5", **size)
    parser.add_argument("--x-from", default="rear", help="where x is 0: rear (the default) or door")
    text = "in m: gaps and overlaps up to this are closed (%(default)s)"
    parser.add_argument("--tolerance", type=float, default=0.005, help=text)
    text = "a column to keep whatever it says, such as weight; may be repeated"
    parser.add_argument("--ignore", action="append", default=[], metavar="COLUMN", help=text)
    text = "what a column of another name means, such as Tiefe=size_x; may be repeated"
    parser.add_argument("--column", action="append", default=[], metavar="NAME=MEANING", help=text)
    version = f"unload {VERSION}, lifts by {engine_of()}"
    parser.add_argument("--version", action="version", version=version)
    options = vars(parser.parse_args(arguments))

    from unload.agent.order import picking_order
    from unload.load.packing_list import EXAMPLE, read_load

    path, policy, output = (options.pop(name) for name in ("list", "policy", "output"))
    columns = dict(each.partition("=")[::2] for each in options.pop("column"))
    try:
        load = read_load(EXAMPLE if path is None else path, columns=columns, **options)
        order = picking_order(load, policy)
        order["distance"] = order["distance"].map("{:.6f}".format)
        order = order.apply(lambda column: column.map(_as_text)).rename(columns=_as_text)
        order.to_csv(output, index=False, lineterminator="\n")
    except (ImportError, OSError, ValueError) as error:  # ImportError: of an engine
        parser.exit(1, f"{error}\n")
    failed, behind = (~order["unloaded"]).sum(), order["behind"].mean()
    print(f"{len(order)} picks, {failed} failed, {behind:.0%} behind other boxes", file=sys.stderr)
    left = len(load) - order["unloaded"].sum()
    if left:
        parser.exit(1, f"{left} boxes are left, of which none that is visible can be lifted\n")


def _as_text(cell):
    """A text that a spreadsheet would take for a formula, with an apostrophe before it."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell


def train_by(arguments: list[str]) -> None:
    """Train with the fields of ``TrainConfig`` as options."""
    from unload.agent.config import TrainConfig

    parser = _parser("unload train", TRAIN_DESCRIPTION)
    parser.add_argument("--run-dir", required=True, help="folder of the run")
    parser.add_argument("--stack", type=_named, help="module:function that makes the loads")
    parser.add_argument("--lifts", help="file of lifts that have been computed")
    explained = _explained(TrainConfig)
    for field in fields(TrainConfig):
        kind: dict = {"type": type(field.default)}
        if field.name == "network":
            kind = {"type": lambda text: _named(text) if ":" in text else text}
        elif isinstance(field.default, bool):
            kind = {"action": argparse.BooleanOptionalAction}
        text = f"{explained[field.name]} ({field.default})".replace("%", "%%")
        option = "--" + field.name.replace("_", "-")
        parser.add_argument(option, default=field.default, help=text, **kind)
    given = vars(parser.parse_args(arguments))
    run_dir, stack, lifts = (given.pop(name) for name in ("run_dir", "stack", "lifts"))

    from unload.agent.training import train  # not before, because it takes long

    try:
        train(TrainConfig(**given), run_dir, stack=stack, lifts=lifts)
    except (ImportError, OSError, TypeError, ValueError, RuntimeError, ArithmeticError) as error:
        parser.exit(1, f"{error}\n")
    except KeyboardInterrupt as stopped:
        parser.exit(130, f"{stopped}\n")
    print(Path(run_dir) / "policy.safetensors")


def _parser(command: str, description: str) -> argparse.ArgumentParser:
    form = argparse.RawDescriptionHelpFormatter
    return argparse.ArgumentParser(command, description=description, formatter_class=form)


def _named(text: str) -> Callable:
    sys.path.append("")  # a module that stands here is found, too, and hides no other one
    try:
        module, _, name = text.partition(":")
        return getattr(import_module(module), name)
    except (AttributeError, ImportError, ValueError) as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {error}; expected module:function") from error


def _explained(kind: type) -> dict[str, str]:
    """What the docstring of a dataclass says of each of its attributes."""
    text = inspect.getdoc(kind) or ""  # from Python 3.13 on, docstrings have no indent
    attributes = text.partition("Attributes:\n")[2].partition("\n\n")[0]
    found: dict[str, str] = {}
    for entry in re.split(r"\n {4}(?=\w)", "\n" + attributes)[1:]:
        names, _, meaning = " ".join(entry.replace("``", "").split()).partition(": ")
        found |= dict.fromkeys(names.split(", "), meaning)
    return found


def command() -> None:
    """Run the command line as a program."""
    if hasattr(signal, "SIGPIPE"):  # not on Windows
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # "| head" ends it without an error
    main()


if __name__ == "__main__":
    command()
