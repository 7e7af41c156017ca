"""Frames of a recording that are done, on disk, so that a run that was stopped goes on where it was."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from mirrorfold import __version__
from mirrorfold.common.leftovers import remove
from mirrorfold.errors import InputError
from mirrorfold.io.files import written_whole
from mirrorfold.io.netcdf import read, write

MARK = "frames.sha256"
"""File with the fingerprint of the inputs and settings that the frames were made from."""


class FrameFolder(MutableMapping[int, xr.DataTree]):
    """A folder with one Reconstruction for every frame that is done.

    Parameters
    ----------
    folder : path
        Made when the first frame is done. Frames that were made of other inputs, or with other settings, are removed.
    inputs : list of path
        Files that the frames are made from.
    settings : dict
        How they are made.
    """

    def __init__(self, folder: Path, inputs: Sequence[Path], settings: Mapping[str, Any]) -> None:
        self.folder = folder
        plain = {name: getattr(value, "tolist", lambda value=value: value)() for name, value in settings.items()}
        digest = hashlib.sha256(repr((__version__, sorted(plain.items()))).encode())
        for path in inputs:
            with path.open("rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
        self._fingerprint = digest.hexdigest()
        mark = folder / MARK
        if not folder.exists():
            return
        if not mark.is_file():
            raise InputError(f"{folder}: is in the way of unfinished frames; remove it, or give another output")
        if mark.read_text() != self._fingerprint:
            self.remove()

    def __getitem__(self, frame: int) -> xr.DataTree:
        path = self._path(frame)
        if not path.exists():
            raise KeyError(frame)
        found = read(path)
        assert isinstance(found, xr.DataTree)  # nothing else is written here
        return found

    def __setitem__(self, frame: int, reconstruction: xr.DataTree) -> None:
        self.folder.mkdir(exist_ok=True)
        if not (self.folder / MARK).exists():
            with written_whole(self.folder / MARK) as temporary:
                temporary.write_text(self._fingerprint)
        write(reconstruction, self._path(frame))

    def __delitem__(self, frame: int) -> None:
        self._path(frame).unlink()

    def __iter__(self) -> Iterator[int]:
        return (int(path.stem) for path in sorted(self.folder.glob("[0-9]*.nc")))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def remove(self) -> None:
        """Remove all frames, once the recording is written."""
        remove(self.folder)

    def _path(self, frame: int) -> Path:
        return self.folder / f"{frame:06d}.nc"
