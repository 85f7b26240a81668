"""The command ``unload`` as a program, see ``unload.orders.command``."""

import signal
import sys


def command() -> None:
    """Run the command line as a program."""
    if hasattr(signal, "SIGPIPE"):  # not on Windows
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # "| head" ends it without an error
    try:
        from unload.orders.command import main  # not before: Ctrl-C may come meanwhile

        main()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    command()
