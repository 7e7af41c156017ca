"""Results by frequency on disk, so that a sweep that was killed goes on where it was."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.leftovers import remove
from mirrorfold.errors import InputError
from mirrorfold.simulation.fullwave.solver import System

MARK = "sweep.sha256"
"""File with the fingerprint of the sweep that the results belong to."""


@dataclass(frozen=True)
class Checkpoint:
    """A folder with one file for every frequency that is done."""

    folder: Path

    @classmethod
    def open(cls, folder: Path, fingerprint: str, *, resume: bool) -> Checkpoint:
        """Start a folder of results, or go on with one.

        Raises
        ------
        InputError
            If there are results and they are not to be resumed, or belong to another sweep.
        """
        mark = folder / MARK
        if mark.exists():
            if not resume:
                raise InputError(
                    f"{folder}: holds the results of an unfinished sweep; resume it, or remove the folder to start anew"
                )
            if mark.read_text() != fingerprint:
                raise InputError(
                    f"{folder}: holds the results of another scene or of other settings; give those to resume it, "
                    "or remove the folder to start anew"
                )
        else:
            folder.mkdir(parents=True, exist_ok=True)
            _write_whole(mark, fingerprint.encode())
        return cls(folder)

    def read(self, index: int) -> NDArray[np.complex64] | None:
        """The result of one frequency, or None where it is not done."""
        path = self._path(index)
        return np.load(path) if path.exists() else None

    def write(self, index: int, s: NDArray[np.complex64]) -> None:
        """Keep the result of one frequency."""
        temporary = self._path(index).with_suffix(".part")
        with temporary.open("wb") as file:
            np.save(file, s)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, self._path(index))

    def remove(self) -> None:
        """Remove all results, once the sweep is written."""
        remove(self.folder)

    def remove_if_empty(self) -> None:
        """Remove the folder if no frequency is done."""
        if not any(self.folder.glob("*.npy")):
            self.remove()

    def _path(self, index: int) -> Path:
        return self.folder / f"{index:05d}.npy"


def _write_whole(path: Path, content: bytes) -> None:
    """Write a file that is there whole or not at all."""
    temporary = path.with_suffix(".part")
    temporary.write_bytes(content)
    os.replace(temporary, path)


def fingerprint(system: System, frequency: NDArray[np.float64], *, direct: bool) -> str:
    """A hash of all that the results depend on."""
    digest = hashlib.sha256(b"direct" if direct else b"scattered")
    groups = [group for root in system.roots for group in root.walk()]
    arrays: list[NDArray] = [system.nodes.position, system.nodes.weight, system.tx, system.rx, frequency]
    arrays += [part for group in groups for part in (group.members, group.skeleton, group.rows, group.antennas)]
    for array in arrays:
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
