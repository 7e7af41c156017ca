"""The streams for output, which may be closed, broken or full."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

STREAMS = 3
"""Input, output and errors have the first three handles."""


def open_streams() -> None:
    """Have every stream lead somewhere: a file that is opened next would take the handle of one that is closed."""
    if None not in (sys.stdin, sys.stdout, sys.stderr):
        return
    while True:
        handle = os.open(os.devnull, os.O_RDWR)
        if handle >= STREAMS:
            os.close(handle)
            break
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8", closefd=False)


@contextmanager
def flushed(stream: TextIO) -> Iterator[None]:
    """Print in the block to a stream, which is silent from now on if it cannot be written to."""
    try:
        yield
        stream.flush()
    except (OSError, ValueError):  # the latter if it is closed
        silence(stream)


def silence(stream: TextIO) -> None:
    """Lead what a stream still holds, and all that follows, to nowhere."""
    with suppress(OSError, ValueError):  # of a stream of a test or a notebook, which has no handle
        handle = os.open(os.devnull, os.O_WRONLY)
        os.dup2(handle, stream.fileno())
        os.close(handle)


def print_error(text: str) -> None:
    """Print a line on stderr, as far as there is somebody to read it."""
    with flushed(sys.stderr):
        print(text, file=sys.stderr)
