"""Work that its caller may stop: long loops ask between their rounds whether to go on."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar


class StoppedError(Exception):
    """The work was stopped by the caller that had asked for it."""


stop: ContextVar[Callable[[], bool] | None] = ContextVar("stop", default=None)
"""Function that says whether the work of this thread shall stop; None if nobody can stop it."""


def go_on() -> None:
    """Do nothing, unless the work shall stop.

    Raises
    ------
    StoppedError
        If `stop` says so.
    """
    asked = stop.get()
    if asked is not None and asked():
        raise StoppedError
