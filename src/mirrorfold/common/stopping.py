"""Work that somebody may stop: long loops ask between their rounds whether to go on."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar


class StoppedError(Exception):
    """The work was stopped by the one who asked for it."""


stop: ContextVar[Callable[[], bool] | None] = ContextVar("stop", default=None)
"""Says whether the work of this thread shall stop; None where nobody can stop it."""


def go_on() -> None:
    """Do nothing, unless the work shall stop.

    Raises
    ------
    StoppedError
    """
    asked = stop.get()
    if asked is not None and asked():
        raise StoppedError
