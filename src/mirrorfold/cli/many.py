"""Reconstruction of many sweeps by one command: one after the other, each in its own folder, with one summary."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import mirrorfold as mf
from mirrorfold.cli import machine_trouble
from mirrorfold.cli.streams import print_error
from mirrorfold.cli.terminal import show_json, show_summary
from mirrorfold.common.records import Record, fact
from mirrorfold.errors import InputError, printable

if TYPE_CHECKING:
    import xarray as xr


class SweepResult(Record):
    """What became of one of many sweeps."""

    sweep: str = fact("its file")
    mirrors: int | None = fact("how many were found; null if it could not be reconstructed")
    points: int | None
    hidden: int | None = fact("points that were seen by way of mirrors")
    error: str | None = fact("why it could not be reconstructed; null if it was")
    files: list[str] = fact("what was written")


class Summary(Record):
    """Many sweeps; the exit code is 2 if one of them could not be reconstructed."""

    kind: Literal["summary"]
    results: list[SweepResult]


def reconstruct_many(
    sweeps: Sequence[Path], output: Path, work: Callable[[Path, Path], tuple[xr.DataTree, list[Path]]], *, json: bool
) -> None:
    """Reconstruct each sweep in a folder of its own, and print a summary.

    If a sweep fails, the others are reconstructed all the same.

    Parameters
    ----------
    sweeps : sequence of path
    output : path
        Directory for the folders.
    work : callable
        Called with the path of a sweep and its folder; returns the reconstruction and the files that were written.
    json : bool
        Whether to print the summary as one JSON object.

    Raises
    ------
    InputError
        At the end, if one of the sweeps could not be reconstructed.
    """
    output.mkdir(exist_ok=True)
    results = []
    for path, name in zip(sweeps, folder_names(sweeps), strict=True):
        try:
            reconstruction, files = work(path, output / name)
        except (InputError, OSError, MemoryError) as error:  # the other sweeps are reconstructed all the same
            said = str(error) if isinstance(error, InputError) else machine_trouble(error)
            if not json:  # with JSON, the summary holds the error
                print_error(f"mirrorfold: {printable(said)}")
            results.append(SweepResult(sweep=str(path), mirrors=None, points=None, hidden=None, error=said, files=[]))
            continue
        except KeyboardInterrupt as interruption:
            done = f"{sum(not result.error for result in results)} of {len(sweeps)} sweeps are done, in {output}"
            raise KeyboardInterrupt("; ".join([str(interruption) or "interrupted", done])) from None
        found = mf.info(reconstruction)
        hidden = sum(count for bounces, count in found.points_by_bounces.items() if bounces != "0")
        results.append(
            SweepResult(sweep=str(path), mirrors=len(found.mirrors), points=found.points, hidden=hidden, error=None,
                        files=list(map(str, files)))
        )  # fmt: skip
    if json:
        show_json(Summary(kind="summary", results=results))
    else:
        show_summary(results)
    bad = [result.sweep for result in results if result.error is not None]
    if bad:
        raise InputError(f"{len(bad)} of {len(sweeps)} sweeps could not be reconstructed: {', '.join(bad)}")


def folder_names(sweeps: Sequence[Path]) -> list[str]:
    """The name of the folder for each sweep: the name of its file without the suffix.

    If two of these are equal, all names begin with the folders in which the files lie.

    Raises
    ------
    InputError
        If a file is given twice.

    Examples
    --------
    >>> folder_names([Path("a.nc"), Path("b.nc")])
    ['a', 'b']
    >>> folder_names([Path("monday/a.nc"), Path("tuesday/a.nc")])
    ['monday-a', 'tuesday-a']
    """
    names = [path.stem for path in sweeps]
    if len(set(names)) < len(names):
        whole = [path.absolute() for path in sweeps]
        above = Path(os.path.commonpath([path.parent for path in whole]))
        names = ["-".join(path.relative_to(above).with_suffix("").parts) for path in whole]
    twice = sorted({str(path) for path, name in zip(sweeps, names, strict=True) if names.count(name) > 1})
    if twice:
        raise InputError(
            f"{', '.join(twice)}: would share a folder in the output; give each sweep once, by its own name"
        )
    return names
