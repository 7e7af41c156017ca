"""A file that does not fail while a library writes to it, but reports a failure afterwards."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any


class SteadyFile(io.FileIO):
    """A new file for a library that does not survive a full disk, such as the HDF5 library.

    After the first failure, everything that is written is dropped. When its context is left, the file raises this
    failure, in place of whatever the library has raised meanwhile. Signals must be held, because their handlers may
    raise within the library, too.

    Parameters
    ----------
    path : path
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self._failure: Exception | None = None

    def write(self, content: Any) -> int:
        """Write all of the content, or after a failure drop it."""
        view = memoryview(content).cast("B")
        size = len(view)
        try:
            while self._failure is None and len(view):
                view = view[super().write(view) :]
        except Exception as error:
            self._failure = error
        return size

    def truncate(self, size: int | None = None) -> int:
        """Change the length of the file; a failure is kept for later."""
        try:
            return super().truncate(size)
        except Exception as error:
            self._failure = self._failure or error
            return self.tell() if size is None else size

    def readinto(self, buffer: Any) -> int:
        """Read from the file into a buffer, with zeros beyond its end, where content was dropped."""
        view = memoryview(buffer).cast("B")
        found = super().readinto(view) or 0
        view[found:] = bytes(len(view) - found)
        return len(view)

    def __exit__(self, *_: object) -> None:
        """Close the file.

        Raises
        ------
        OSError or MemoryError
            The first failure.
        """
        self.close()
        if self._failure is not None:
            raise self._failure
