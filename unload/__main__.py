"""The order of picks for a packing list, as CSV."""

import argparse
import signal
import sys

from unload.agent.order import NAMES, picking_order
from unload.load.packing_list import EXAMPLE, read_load

DESCRIPTION = """\
Print in which order the boxes of a packing list are picked, as CSV: pick, id, item,
distance (m) and unloaded (False for a pick that fails). unload.read_load describes the
list, unload.picking_order the order.
"""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line.

    Args:
        arguments: of the command; those of the process if None.
    """
    parser = argparse.ArgumentParser(
        "python -m unload",
        description=DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("list", nargs="?", default=EXAMPLE, help="CSV file; an example if missing")
    known = f"{', '.join(NAMES)}, or a file of weights"
    parser.add_argument("--policy", default="recommended", help=known)
    parser.add_argument("--output", default=sys.stdout, help="file; the screen if missing")
    options = parser.parse_args(arguments)
    try:
        load = read_load(options.list)
        order = picking_order(load, options.policy)
        order.to_csv(options.output, index=False, float_format="%.6f")
    except (ImportError, OSError, ValueError) as error:  # ImportError: of PyBullet
        parser.exit(1, f"{error}\n")
    left = len(load) - order["unloaded"].sum()
    if left:
        parser.exit(1, f"{left} boxes are left, of which none that is visible can be lifted\n")


if __name__ == "__main__":
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # "| head" ends it without an error
    main()
