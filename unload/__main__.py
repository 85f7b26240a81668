"""The command ``unload`` as a program, see ``unload.orders.command``."""

import signal

from unload.orders.command import main


def command() -> None:
    """Run the command line as a program."""
    if hasattr(signal, "SIGPIPE"):  # not on Windows
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # "| head" ends it without an error
    main()


if __name__ == "__main__":
    command()
