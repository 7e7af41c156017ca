"""Signals that end the program: as Ctrl-C does, and not where it must not be interrupted."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held_signals() -> Iterator[None]:
    """Have signals wait that Python handles, such as Ctrl-C, until the context ends.

    Their handlers run in the main thread, between any two of its steps; in other threads there is nothing to hold.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    handlers = {one: signal.getsignal(one) for one in signal.valid_signals()}
    handlers = {one: handler for one, handler in handlers.items() if callable(handler)}
    for one in handlers:
        signal.signal(one, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for one, handler in handlers.items():
            signal.signal(one, handler)
        for number in dict.fromkeys(came):
            signal.raise_signal(number)


ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""What ends a process: `kill`, systems that shut down or have waited long enough, and terminals that are closed."""


@contextmanager
def ended_as_by_ctrl_c() -> Iterator[list[int]]:
    """Have these signals raise KeyboardInterrupt, so that they clean up as Ctrl-C does.

    Those that are ignored, as by ``nohup``, stay so.

    Yields
    ------
    list of int
        The signals that came, in their order.
    """
    came: list[int] = []

    def end(number: int, _: object) -> None:
        came.append(number)
        raise KeyboardInterrupt

    in_charge = threading.current_thread() is threading.main_thread()
    ours = [one for one in ENDING if in_charge and signal.getsignal(one) is signal.SIG_DFL]
    for one in ours:
        signal.signal(one, end)
    try:
        yield came
    finally:
        for one in ours:
            signal.signal(one, signal.SIG_DFL)


def leave_to_parent() -> None:
    """In a worker process: Ctrl-C and closed terminals, which all processes hear of, are the parent's to handle."""
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def start_tracker() -> None:
    """Start the process that Python tidies up with after workers, before there are any.

    It ignores Ctrl-C and SIGTERM, but would die of a closed terminal too early and have others complain of it. A signal
    that is blocked while a process starts stays blocked in it.

    Raises
    ------
    RuntimeError
        If this process is itself a worker that is still reading a script without `if __name__ == "__main__":`. It would
        fail a moment later, as it starts its first worker, and leave semaphores behind of which the tracker complains.
    """
    from multiprocessing import resource_tracker
    from multiprocessing.spawn import get_preparation_data

    get_preparation_data("")
    if not hasattr(signal, "pthread_sigmask"):
        return

    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        resource_tracker.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
