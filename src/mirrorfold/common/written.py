"""What the running command has written, for its message where it is interrupted."""

from __future__ import annotations

from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

files_written: ContextVar[list[Path] | None] = ContextVar("files_written", default=None)
"""Files and folders that the running command has written, temporary ones included; None if nobody collects them."""


def note_written(path: Path) -> None:
    """Remember that the running command has written a file or a folder."""
    written = files_written.get()
    if written is not None:
        written.append(path)
