"""The finished frames of a recording on disk, so that a run that was stopped can go on where it was."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from mirrorfold import __version__
from mirrorfold.common.parts import Parts
from mirrorfold.errors import InputError
from mirrorfold.io.own.netcdf import read, write

MARK = "frames.sha256"
"""File with the fingerprint of the inputs and settings that the frames were made from."""


class FrameFolder(MutableMapping[int, xr.DataTree]):
    """A folder with one Reconstruction for every finished frame.

    Parameters
    ----------
    folder : path
        Made when the first frame is finished. Frames that were made from other inputs, or with other settings, are
        removed with a warning; damaged frames give a warning and are made again.
    inputs : list of path
        Files from which the frames are made.
    settings : dict
        Settings with which the frames are made.

    Raises
    ------
    InputError
        If the folder holds something else.
    """

    def __init__(self, folder: Path, inputs: Sequence[Path], settings: Mapping[str, Any]) -> None:
        self.folder = folder
        plain = {name: getattr(value, "tolist", lambda value=value: value)() for name, value in settings.items()}
        digest = hashlib.sha256(repr((__version__, sorted(plain.items()))).encode())
        for path in inputs:
            with path.open("rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
        self._parts = Parts(folder, digest.hexdigest(), MARK, ".nc")
        if folder.exists() and not (folder / MARK).is_file():
            raise InputError(f"{folder}: is in the way of unfinished frames; remove it, or give another output")
        if self._parts.fingerprint_found not in (None, self._parts.fingerprint):
            warnings.warn(f"{folder}: its frames are of other inputs or settings; all are made anew", stacklevel=2)
            self.remove()
        self._done = self._parts.verified()

    def __getitem__(self, frame: int) -> xr.DataTree:
        if frame not in self._done:
            raise KeyError(frame)
        found = read(self._parts.path(frame))
        assert isinstance(found, xr.DataTree)  # nothing else is written here
        return found

    def __setitem__(self, frame: int, reconstruction: xr.DataTree) -> None:
        with self._parts.written(frame) as temporary:
            write(reconstruction, temporary)
        self._done.add(frame)

    def __delitem__(self, frame: int) -> None:
        self._done.remove(frame)
        self._parts.path(frame).unlink()

    def __contains__(self, frame: object) -> bool:
        return frame in self._done

    def __iter__(self) -> Iterator[int]:
        return iter(sorted(self._done))

    def __len__(self) -> int:
        return len(self._done)

    def remove(self) -> None:
        """Remove all frames, as after the whole recording is written."""
        self._parts.remove()
