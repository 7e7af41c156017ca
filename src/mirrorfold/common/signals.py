"""Signals that end the program: all of them act like Ctrl-C, and none interrupts work that must be completed."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held_signals() -> Iterator[None]:
    """Hold back signals that Python handles, such as Ctrl-C, until the context ends.

    Python runs the handlers in the main thread, between any two of its steps; other threads are never interrupted.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    handlers = {one: signal.getsignal(one) for one in signal.valid_signals()}
    handlers = {one: handler for one, handler in handlers.items() if callable(handler)}
    for one in handlers:
        signal.signal(one, lambda number, _: received.append(number))
    try:
        yield
    finally:
        for one, handler in handlers.items():
            signal.signal(one, handler)
        for number in dict.fromkeys(received):
            signal.raise_signal(number)


ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Signals that end a process: from `kill`, from a system that shuts down or a time limit, and from a closed
terminal."""


@contextmanager
def ended_as_by_ctrl_c() -> Iterator[list[int]]:
    """Make the signals in `ENDING` raise KeyboardInterrupt, so that the program cleans up as after Ctrl-C.

    Signals that are ignored, as under ``nohup``, stay ignored.

    Yields
    ------
    list of int
        The signals received, in their order.
    """
    received: list[int] = []

    def end(number: int, _: object) -> None:
        received.append(number)
        raise KeyboardInterrupt

    in_main_thread = threading.current_thread() is threading.main_thread()
    replaced = [one for one in ENDING if in_main_thread and signal.getsignal(one) is signal.SIG_DFL]
    for one in replaced:
        signal.signal(one, end)
    try:
        yield received
    finally:
        for one in replaced:
            signal.signal(one, signal.SIG_DFL)


def leave_to_parent() -> None:
    """In a worker process: ignore Ctrl-C and closed terminals, which all processes receive; the parent handles them."""
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def start_tracker() -> None:
    """Start Python's resource tracker, the process that cleans up after workers, before there are workers.

    The tracker ignores Ctrl-C and SIGTERM, but a closed terminal (SIGHUP) would end it too early, and other processes
    would complain. A signal that is blocked while a process starts stays blocked in it, so SIGHUP is blocked here.

    Raises
    ------
    RuntimeError
        If this process is itself a worker that is still reading a script without `if __name__ == "__main__":`. It would
        fail a moment later, when it starts its first worker, and leave semaphores behind that the tracker complains of.
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
