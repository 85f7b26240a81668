"""The command line: the order of picks for a packing list, and training."""

import argparse
import re
import signal
import sys
from collections.abc import Callable
from dataclasses import fields
from importlib import import_module
from pathlib import Path

DESCRIPTION = """\
Print in which order the boxes of a packing list are picked, as CSV: pick, id, item,
distance (m) and unloaded (False for a pick that fails). unload.read_load describes the
list, unload.picking_order the order.

"python -m unload train" trains an agent; "python -m unload train --help" says how.
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
    from unload.agent.order import NAMES, picking_order
    from unload.load.packing_list import EXAMPLE, read_load

    parser = _parser("python -m unload", DESCRIPTION)
    parser.add_argument("list", nargs="?", default=EXAMPLE, help="CSV file; an example if missing")
    known = f"{', '.join(NAMES)}, or a file of weights"
    parser.add_argument("--policy", default="recommended", help=known)
    parser.add_argument("--output", default=sys.stdout, help="file; the screen if missing")
    options = parser.parse_args(arguments)
    try:
        load = read_load(options.list)
        order = picking_order(load, options.policy)
        order["id"] = order["id"].map(_as_text)
        order.to_csv(options.output, index=False, float_format="%.6f")
    except (ImportError, OSError, ValueError) as error:  # ImportError: of PyBullet
        parser.exit(1, f"{error}\n")
    left = len(load) - order["unloaded"].sum()
    if left:
        parser.exit(1, f"{left} boxes are left, of which none that is visible can be lifted\n")


def _as_text(cell):
    """An id that a spreadsheet would take for a formula, with an apostrophe before it."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell


def train_by(arguments: list[str]) -> None:
    """Train with the fields of ``TrainConfig`` as options."""
    from unload.agent.config import TrainConfig

    parser = _parser("python -m unload train", TRAIN_DESCRIPTION)
    parser.add_argument("--run-dir", required=True, help="folder of the run")
    parser.add_argument("--stack", type=_named, help="module:function that makes the loads")
    parser.add_argument("--lifts", help="file of lifts that PyBullet has computed")
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
    try:
        module, _, name = text.partition(":")
        return getattr(import_module(module), name)
    except (AttributeError, ImportError, ValueError) as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {error}; expected module:function") from error


def _explained(kind: type) -> dict[str, str]:
    """What the docstring of a dataclass says of each of its attributes."""
    attributes = kind.__doc__.partition("Attributes:\n")[2].partition("\n\n")[0]
    found: dict[str, str] = {}
    for entry in re.split(r"\n {8}(?=\w)", "\n" + attributes)[1:]:
        names, _, text = " ".join(entry.replace("``", "").split()).partition(": ")
        found |= dict.fromkeys(names.split(", "), text)
    return found


if __name__ == "__main__":
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # "| head" ends it without an error
    main()
