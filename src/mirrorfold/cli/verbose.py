"""The option ``--verbose`` of verbs with much work: print the forecast of their memory before the work begins."""

from __future__ import annotations

import functools
import inspect
import logging
from collections.abc import Callable
from typing import Annotated, Any

from cyclopts import Parameter

from mirrorfold.cli import note

VERBOSE = inspect.Parameter(
    "verbose",
    inspect.Parameter.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[
        bool, Parameter(help="Say on stderr what memory the work is forecast to take, before it begins.")
    ],
)
"""The option ``--verbose``."""


class _Notes(logging.Handler):
    """Prints log records as remarks on stderr."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print one record."""
        note(record.getMessage())


def with_verbose(function: Callable[..., Any]) -> Callable[..., Any]:
    """The verb with the option ``--verbose``, with which the log of the package is printed."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def verb(*args: Any, verbose: bool = False, **kwargs: Any) -> Any:
        log, handler = logging.getLogger("mirrorfold"), _Notes()
        level = log.level
        if verbose:
            log.addHandler(handler)
            log.setLevel(logging.INFO)
        try:
            return function(*args, **kwargs)
        finally:
            log.removeHandler(handler)
            log.setLevel(level)

    verb.__signature__ = signature.replace(parameters=[*signature.parameters.values(), VERBOSE])  # type: ignore[attr-defined]
    verb.__annotations__ = {**function.__annotations__, "verbose": VERBOSE.annotation}
    return verb
