"""Ctrl-C in a run that must not be left half done."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def deferred_interrupts() -> Iterator[list[int]]:
    """Note the first Ctrl-C instead of raising; the second one stops at once.

    Yields:
        The signals received so far. The caller polls them and stops at a safe point.

    Raises:
        KeyboardInterrupt: at the second Ctrl-C, or at the end if nobody has stopped since the
            first one.
    """
    received: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield received  # only the main thread receives signals
        return

    def receive(number: int, frame: object) -> None:
        received.append(number)
        if len(received) > 1:
            raise KeyboardInterrupt

    previous = signal.signal(signal.SIGINT, receive)
    try:
        yield received
    except SystemError as error:  # of compiled code in which the second one was raised
        if len(received) > 1:
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, previous)
    if received:
        raise KeyboardInterrupt
