"""Finished parts of a long work on disk, so that a run that was stopped can go on where it was.

Each file of a part ends with a SHA-256 digest of the work that it belongs to, of its number and of its content. A file
that is cut off, changed, or of another work does not match its digest, and the part is made again.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mirrorfold.errors import InputError

DIGEST_BYTES = hashlib.sha256().digest_size
"""Length of a digest [bytes]."""

BLOCK_BYTES = 1 << 20
"""Number of bytes that are read at a time."""

UNFINISHED = ".part"
"""Suffix of parts that are being written; a run that is killed leaves such files."""

LISTED = 3
"""A warning lists at most this many names of files."""


@dataclass(frozen=True)
class Parts:
    """A folder with one file for each finished part, and one file with the fingerprint of the work.

    Attributes
    ----------
    folder : Path
        The folder; it is made when the first part is written.
    fingerprint : str
        Digest of everything that the parts depend on.
    mark : str
        Name of the file with the fingerprint.
    suffix : str
        Suffix of the files of parts.
    """

    folder: Path
    fingerprint: str
    mark: str
    suffix: str

    @property
    def fingerprint_found(self) -> str | None:
        """The fingerprint that the folder holds; None if there is none, or it is incomplete."""
        mark = self.folder / self.mark
        try:
            text = mark.read_text(encoding="ascii") if mark.is_file() else ""
        except (OSError, UnicodeDecodeError):
            return None
        return text if len(text) == 2 * DIGEST_BYTES else None

    def numbers(self) -> list[int]:
        """Numbers of the parts that have a file, intact or not."""
        named = [path for path in self.folder.glob(f"[0-9]*{self.suffix}") if re.fullmatch(r"[0-9]{1,18}", path.stem)]
        return sorted(number for path in named if self.path(number := int(path.stem)) == path)

    def verified(self) -> set[int]:
        """Numbers of the parts that are intact and of this work; gives a warning of the others.

        Raises
        ------
        InputError
            If a folder is in the place of a part or of the fingerprint.
        """
        found = self.numbers()
        for path in (self.folder / self.mark, *map(self.path, found)):
            _check_no_folder(path)
        whole = {number for number in found if is_sealed(self.path(number), self._owner(number))}
        bad = [self.path(number).name for number in found if number not in whole]
        if bad:
            names = ", ".join(bad[:LISTED]) + (f" and {len(bad) - LISTED} more" if len(bad) > LISTED else "")
            warnings.warn(
                f"{self.folder}: {names} cannot be trusted, damaged or of another run; that work is done again",
                stacklevel=3,
            )
        return whole

    @contextmanager
    def written(self, number: int) -> Iterator[Path]:
        """A temporary path to write a part to; if the block succeeds, the file is sealed and moved to its place.

        Raises
        ------
        InputError
            If a folder is in the place of the part or of the fingerprint.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.path(number)
        for place in (self.folder / self.mark, path):
            _check_no_folder(place)
        temporary = path.with_name(f"{path.stem}.{secrets.token_hex(4)}{UNFINISHED}")
        try:
            if self.fingerprint_found != self.fingerprint:
                temporary.write_text(self.fingerprint, encoding="ascii")
                os.replace(temporary, self.folder / self.mark)
            yield temporary
            seal(temporary, self._owner(number))
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)

    def remove(self) -> None:
        """Remove all parts, and the folder if nothing else is in it."""
        unfinished = self.folder.glob(f"[0-9]*{UNFINISHED}")
        for path in (*map(self.path, self.numbers()), *unfinished, self.folder / self.mark):
            path.unlink(missing_ok=True)
        with suppress(OSError):
            self.folder.rmdir()

    def path(self, number: int) -> Path:
        """File of a part."""
        return self.folder / f"{number:05d}{self.suffix}"

    def _owner(self, number: int) -> str:
        return f"{self.fingerprint} {number}"


def _check_no_folder(path: Path) -> None:
    """Refuse a folder where a file belongs; anything else there, such as a pipe, is replaced."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder in the place of a file with results; move it away")


def seal(path: Path, owner: str) -> None:
    """Append the digest of `owner` and of the content of a file to the file, and flush it to the disk.

    NumPy and netCDF still read their files, as they ignore bytes after the end of the content.
    """
    with path.open("r+b") as file:
        digest = _digest(file, owner, os.fstat(file.fileno()).st_size)
        file.seek(0, os.SEEK_END)
        file.write(digest)
        file.flush()
        os.fsync(file.fileno())


def is_sealed(path: Path, owner: str) -> bool:
    """Whether a file is unchanged since it was sealed for this owner; False if it is no file or cannot be read."""
    if not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            content = os.fstat(file.fileno()).st_size - DIGEST_BYTES
            return content >= 0 and _digest(file, owner, content) == file.read(DIGEST_BYTES)
    except OSError:
        return False


def _digest(file: BinaryIO, owner: str, size: int) -> bytes:
    """SHA-256 of the owner and of the first `size` bytes of a file; the file is left at the position after them."""
    digest = hashlib.sha256(owner.encode() + b"\n")
    while size > 0 and (block := file.read(min(size, BLOCK_BYTES))):
        digest.update(block)
        size -= len(block)
    return digest.digest()
