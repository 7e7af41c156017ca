"""Safe use of the output streams, which may be closed, broken or on a full disk."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

STREAMS = 3
"""Number of the standard streams: input, output and errors have the first three file handles."""


def open_streams() -> None:
    """Open closed standard streams to the null device; otherwise the next opened file would get their handle."""
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
    """Flush a stream after the block; if the stream cannot be written to, silence it from then on."""
    try:
        yield
        stream.flush()
    except (OSError, ValueError):  # ValueError: the stream is closed
        silence(stream)


def silence(stream: TextIO) -> None:
    """Discard the text that a stream still holds, and all text that follows."""
    with suppress(OSError, ValueError):  # streams of tests and notebooks have no handle
        handle = os.open(os.devnull, os.O_WRONLY)
        os.dup2(handle, stream.fileno())
        os.close(handle)


def print_error(text: str) -> None:
    """Print a line on stderr, if it can be written to."""
    with flushed(sys.stderr):
        print(text, file=sys.stderr)
