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

from unload import task
from unload.task import VERSION

DESCRIPTION = """\
Print in which order the boxes of a packing list are picked: pick, id, item, distance (m),
unloaded (False for a pick that fails), behind (True if another box stands in front of it),
and the list's other columns.

A line of the list is a box. Its columns, in any order; capitals make no difference:
  x_min, y_min, z_min      corner nearest to the origin (pos_x, ...), or x, y, z, the centre
  size_x, size_y, size_z   edges along the axes (length or depth, width, height)
  id                       or label, name, SSCC, HU; optional
  weight, rotation         optional: 1 kg each if missing, and quarter turns
German, French and Spanish names are understood, too; what was is printed on stderr. Lengths
are in m unless --units or a name says otherwise, as length_mm and "x (cm)" do. The axes are
x (depth, 0 at the rear wall), y (width, 0 at the left wall, seen from the entrance) and
z (height, 0 at the floor). unload.read_load and unload.picking_order say more.

  unload list.csv --units cm --container 13.6 2.48 2.7 --force auto --by stop

"unload train" trains an agent; "unload train --help" says how.
"""
TRAIN_DESCRIPTION = """\
Train an agent, or go on with a run that was stopped, and print where its policy is. The
options are the fields of unload.TrainConfig, whose defaults are the paper's; * marks
those that are the package's own choice.
"""

FORMULA = ("=", "+", "-", "@", "\t", "\r")  # what a formula in a spreadsheet begins with


def command() -> None:
    """Run the command line as a program."""
    if hasattr(signal, "SIGPIPE"):  # not on Windows
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # "| head" ends it without an error
    main()


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
    from unload.support.files import POLICIES

    parser = _parser("unload", DESCRIPTION)
    known = "reachable (the default: nothing lies on the next box or stands in front of it), "
    known += f"highest, nearest, random, {', '.join(POLICIES)}, or a file of weights"
    text = "CSV, JSON or Excel file; an example if missing"
    parser.add_argument("list", nargs="?", help=text)
    parser.add_argument("--policy", default="reachable", help=known)
    text = "a column of stops: what can be reached, 1 before 2, ... (--by=-stop: the last first)"
    parser.add_argument("--by", metavar="COLUMN", help=text)
    text = "strongest pull in N (20, which lifts 1.4 kg); or auto, as much as each box needs"
    parser.add_argument("--force", type=_force, default=task.PICK_FORCE, help=text)
    parser.add_argument("--output", default=sys.stdout, help="file; the screen if missing")
    parser.add_argument("--format", choices=("csv", "json"), default="csv", help="of the output")
    text = "PNG file for a picture of the load, its first fifty picks numbered"
    parser.add_argument("--picture", metavar="FILE", help=text)
    parser.add_argument("--units", help="of lengths: m, cm, mm or in")
    size: dict = {"type": float, "nargs": 3, "metavar": ("LENGTH", "WIDTH", "HEIGHT")}
    parser.add_argument("--container", help="its inner size in m; the paper's is 7 2.5 2.5", **size)
    parser.add_argument("--x-from", default="rear", help="where x is 0: rear (the default) or door")
    text = "in m: how far each box may be from where it belongs (%(default)s)"
    parser.add_argument("--tolerance", type=float, default=0.005, help=text)
    text = "a column to keep whatever it says, such as weight; may be repeated"
    parser.add_argument("--ignore", action="append", default=[], metavar="COLUMN", help=text)
    text = "what a column means, such as x=x_min if x is a corner; may be repeated"
    parser.add_argument("--column", action="append", default=[], metavar="NAME=MEANING", help=text)
    version = f"unload {VERSION}, lifts by {engine_of()}"
    parser.add_argument("--version", action="version", version=version)
    options = vars(parser.parse_args(arguments))

    from unload.load.packing_list import EXAMPLE, read_load

    path, output, form, drawn = (options.pop(n) for n in ("list", "output", "format", "picture"))
    asked = {name: options.pop(name) for name in ("policy", "by", "force")}
    columns = dict(each.partition("=")[::2] for each in options.pop("column"))
    try:
        load = read_load(EXAMPLE if path is None else path, columns=columns, **options)
        from unload.agent.order import picking_order, stops_of  # when there is a list to order

        order = picking_order(load, **asked)
        if drawn is not None:  # first, because it may lack a library
            _draw(load, order, drawn)
        _write(order, output, form)
    except (ImportError, OSError, TypeError, ValueError) as error:  # ImportError: of an extra
        parser.exit(1, f"{error}\n")
    failed, behind = (~order["unloaded"]).sum(), order["behind"].mean()
    print(f"{len(order)} picks, {failed} failed, {behind:.0%} behind other boxes", file=sys.stderr)
    if asked["by"] is not None:
        for stop, boxes, others in stops_of(load, order, asked["by"]).itertuples(index=False):
            summary = f"{boxes} boxes, {others} of later ones come out first"
            print(f"{asked['by'].lstrip('-')} {stop}: {summary}", file=sys.stderr)
    left = len(load) - order["unloaded"].sum()
    if left:
        parser.exit(1, f"{left} boxes are left, of which none that is visible and free is lifted\n")


def _draw(load, order, path: str) -> None:
    from unload.support.checks import needed_for

    with needed_for("--picture"):
        from unload.load.picture import numbered
    Path(path).write_bytes(numbered(load, order["item"].to_numpy()))


def _write(order, output, form: str) -> None:
    """Write an order, distances to the micrometre."""
    if form == "json":
        order.to_json(output, orient="records", indent=1, double_precision=6, force_ascii=False)
        return
    order = order.assign(distance=order["distance"].map("{:.6f}".format))
    order = order.apply(lambda column: column.map(_as_text)).rename(columns=_as_text)
    order.to_csv(output, index=False, lineterminator="\n")


def _force(text: str) -> float | str:
    try:
        return text if text == "auto" else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"is {text!r}; expected a number >= 0, or auto") from None


def _as_text(cell):
    """A text that a spreadsheet would take for a formula, with an apostrophe before it."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell


def train_by(arguments: list[str]) -> None:
    """Train with the fields of ``TrainConfig`` as options."""
    parser = _parser("unload train", TRAIN_DESCRIPTION)
    try:
        from unload import TrainConfig
    except ImportError as error:
        parser.exit(1, f"{error}\n")
    parser.add_argument("--run-dir", required=True, help="folder of the run")
    parser.add_argument("--stack", type=_named, help="module:function that makes the loads")
    parser.add_argument("--lifts", help="file of lifts that have been computed")
    text = "resume a run of functions of one's own, which are the same as when it was begun"
    parser.add_argument("--same-code", action="store_true", help=text)
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
    run_dir = given.pop("run_dir")
    others = {name: given.pop(name) for name in ("stack", "lifts", "same_code")}

    from unload import train  # not before, because it takes a second more

    try:
        train(TrainConfig(**given), run_dir, **others)
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
    entries = re.findall(r"^ {4}([a-z_, ]+): (.*(?:\n {8}.*)*)", text, re.MULTILINE)
    return {
        name: " ".join(meaning.replace("``", "").split())
        for names, meaning in entries
        for name in names.split(", ")
    }


if __name__ == "__main__":
    command()
