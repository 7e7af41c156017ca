"""Results by frequency on disk, so that an interrupted sweep can be resumed."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mirrorfold import __version__
from mirrorfold.common.parts import Parts
from mirrorfold.common.slabs import POLARIZATIONS
from mirrorfold.errors import InputError
from mirrorfold.simulation.fullwave.boundaries import Boundaries
from mirrorfold.simulation.fullwave.solver import System

MARK = "sweep.sha256"
"""Name of the file with the fingerprint of the sweep that the results belong to."""

SUFFIX = ".npy"


class Checkpoint:
    """A folder with one file for every frequency that is done.

    Parameters
    ----------
    folder : Path
    fingerprint : str
        Fingerprint of the sweep; see `fingerprint`.
    resume : bool
        Use the results in the folder. Damaged files, and files of another sweep, cause a warning and are not used.

    Raises
    ------
    InputError
        If the folder has results, and `resume` is not set or they belong to another sweep.
    """

    def __init__(self, folder: Path, fingerprint: str, *, resume: bool) -> None:
        self._parts = Parts(folder, fingerprint, MARK, SUFFIX)
        found = self._parts.fingerprint_found
        if (found or self._parts.numbers()) and not resume:
            raise InputError(
                f"{folder}: holds the results of an unfinished sweep; resume it, or remove the folder to start anew"
            )
        if found not in (None, fingerprint):
            raise InputError(
                f"{folder}: holds the results of another scene or of other settings; give those to resume it, "
                "or remove the folder to start anew"
            )
        self._done = self._parts.verified()

    def read(self, index: int) -> NDArray[np.complex64] | None:
        """The result of one frequency, or None if there is none yet."""
        return np.load(self._parts.path(index)) if index in self._done else None

    def write(self, index: int, s: NDArray[np.complex64]) -> None:
        """Write the result of one frequency to the folder."""
        with self._parts.written(index) as temporary, temporary.open("wb") as file:
            np.save(file, s)


def remove_results(folder: Path) -> None:
    """Remove the results in a folder once the sweep is written, also those in its folders for the two polarizations."""
    for place in (*(folder / polarization for polarization in POLARIZATIONS), folder):
        Parts(place, "", MARK, SUFFIX).remove()


def fingerprint(system: System, frequency: NDArray[np.float64], *, direct: bool) -> str:
    """SHA-256 hash of everything that the results depend on."""
    digest = hashlib.sha256(f"{__version__} {'direct' if direct else 'scattered'}".encode())
    groups = [group for root in system.roots for group in root.walk()]
    arrays: list[NDArray] = [system.nodes.position, system.nodes.weight, system.tx, system.rx, frequency]
    if isinstance(system.equation, Boundaries):
        arrays += system.equation.digest
    arrays += [part for group in groups for part in (group.members, group.skeleton, group.rows, group.antennas)]
    for array in arrays:
        digest.update(f"{array.dtype} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
