"""Parts of a long work on disk, so that a run that was stopped goes on where it was.

Each part ends with a SHA-256 digest of the work that it belongs to, its number and its content. What is cut off,
changed, or of another work does not verify, and is made again.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mirrorfold.errors import InputError

DIGEST_BYTES = hashlib.sha256().digest_size

BLOCK_BYTES = 1 << 20
"""Bytes that are read at a time."""

UNFINISHED = ".part"
"""Suffix of parts that are being written; a run that was killed leaves them."""

LISTED = 3
"""Names of files that a warning lists."""


@dataclass(frozen=True)
class Parts:
    """A folder with one file for each part that is done, and one with the fingerprint of the work.

    Attributes
    ----------
    folder : Path
        Made when the first part is written.
    fingerprint : str
        Digest of all that the parts depend on.
    mark : str
        Name of the file with the fingerprint.
    suffix : str
        Of the files of parts.
    """

    folder: Path
    fingerprint: str
    mark: str
    suffix: str

    @property
    def fingerprint_found(self) -> str | None:
        """The fingerprint that stands in the folder; None where there is none that is whole."""
        mark = self.folder / self.mark
        try:
            text = mark.read_text(encoding="ascii") if mark.is_file() else ""
        except (OSError, UnicodeDecodeError):
            return None
        return text if len(text) == 2 * DIGEST_BYTES else None

    def numbers(self) -> list[int]:
        """Numbers of the parts that are there, whole or not."""
        return sorted(int(path.stem) for path in self.folder.glob(f"[0-9]*{self.suffix}") if path.stem.isdigit())

    def verified(self) -> set[int]:
        """Numbers of the parts that are whole and of this work; warns of the others.

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
        """A temporary path to write a part to, sealed and put in its place when the block ends well.

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
        """Remove all parts, and the folder where nothing else lies in it."""
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
    """Refuse a folder where a file belongs; what else is there, such as a pipe, is replaced."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder in the place of a file with results; move it away")


def seal(path: Path, owner: str) -> None:
    """Append the digest of `owner` and of all that a file holds, and have the disk hold both.

    What stands after the end of their content troubles neither NumPy's nor netCDF's files.
    """
    with path.open("r+b") as file:
        digest = _digest(file, owner, os.fstat(file.fileno()).st_size)
        file.seek(0, os.SEEK_END)
        file.write(digest)
        file.flush()
        os.fsync(file.fileno())


def is_sealed(path: Path, owner: str) -> bool:
    """Whether a file is as it was when it was sealed for this owner; not where it cannot be read, or is a pipe."""
    if not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            content = os.fstat(file.fileno()).st_size - DIGEST_BYTES
            return content >= 0 and _digest(file, owner, content) == file.read(DIGEST_BYTES)
    except OSError:
        return False


def _digest(file: BinaryIO, owner: str, size: int) -> bytes:
    """SHA-256 of the owner and of the first bytes of a file, which is left behind them."""
    digest = hashlib.sha256(owner.encode() + b"\n")
    while size > 0 and (block := file.read(min(size, BLOCK_BYTES))):
        digest.update(block)
        size -= len(block)
    return digest.digest()
