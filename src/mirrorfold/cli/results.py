"""What several verbs do: read what they expect, write results and pictures, and say what was found."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mirrorfold as mf
from mirrorfold.cli.terminal import remark, show_files, show_json, show_mirrors
from mirrorfold.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from mirrorfold.common.records import Record

PICTURE, RECONSTRUCTION = "before_after.png", "reconstruction.nc"
BODY, SPACE = "body.png", "space.png"
REPORT = "report.html"


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def remove_directory(path: Path) -> None:
    """Remove a directory with all that is in it."""
    import shutil

    shutil.rmtree(path, ignore_errors=True)


def read(path: Path, *expected: str) -> Any:
    """A file that must hold a sweep, an image or a reconstruction, whichever of them is expected.

    Raises
    ------
    InputError
        If the file holds something else.
    """
    import xarray as xr

    found = mf.load(path)
    kinds = {xr.Dataset: "sweep", xr.DataArray: "image", xr.DataTree: "reconstruction"}
    held = kinds.get(type(found), "scene")
    if held not in expected:
        raise InputError(f"{path}: is of kind {held}, expected {' or '.join(expected)}; give another file")
    return found


def parse_grid(**axes: str | None) -> dict[str, Any]:
    """Pixel coordinates [m] of the axes that are given, by name.

    Raises
    ------
    InputError
        If one of them cannot be read.
    """
    return {name: parse_axis(text, name) for name, text in axes.items() if text is not None}


def parse_axis(text: str, name: str) -> Any:
    """Pixel coordinates from START:STOP:STEP, the stop included where the steps reach it, or from one number.

    Raises
    ------
    InputError
        If the text is not one number or three, or the steps do not lead from START to STOP.
    """
    import numpy as np

    try:
        if ":" not in text and np.isfinite(float(text)):
            return np.array([float(text)])
        start, stop, step = map(float, text.split(":"))
    except ValueError:
        raise InputError(f"--{name} is {text!r}, expected START:STOP:STEP in metres, for example -2:2:0.005") from None
    if not (np.isfinite([start, stop, step]).all() and step > 0 and stop > start):
        raise InputError(f"--{name} is {text!r}, expected finite numbers with STOP above START and a STEP above zero")
    return start + step * np.arange(int(np.floor((stop - start) / step + 1e-9)) + 1)


def write_results(reconstruction: Any, directory: Path, scene: Any = None) -> list[str]:
    """Write a reconstruction and its pictures to a directory; returns the files' names."""
    mf.save(reconstruction, directory / RECONSTRUCTION)
    mf.report(reconstruction, directory / REPORT, scene=scene)
    if "z" not in reconstruction.children["objects"].variables:
        mf.plot.before_after(reconstruction, scene).savefig(directory / PICTURE)
        return [RECONSTRUCTION, PICTURE, REPORT]
    from mirrorfold.plotting import volumes as plot_volume

    mf.plot.before_after(reconstruction, scene).savefig(directory / PICTURE)
    plot_volume.space(reconstruction, scene).savefig(directory / SPACE)
    names = [RECONSTRUCTION, PICTURE, SPACE, REPORT]
    if plot_volume.has_body(reconstruction):
        plot_volume.body(reconstruction).savefig(directory / BODY)
        names.append(BODY)
    return names


def check_export(path: Path | None) -> None:
    """Refuse a point cloud that could not be written, before the work begins."""
    if path is not None:
        from mirrorfold.io.clouds import check_cloud_path

        check_cloud_path(path)


def write_cloud(reconstruction: Any, path: Path | None) -> list[Path]:
    """Write the point cloud, if one is asked for; returns its path."""
    if path is None:
        return []
    from mirrorfold.io.clouds import export

    return [export(reconstruction, path)]


def write_json(result: Record, path: Path) -> None:
    """Write one JSON object to a file."""
    from mirrorfold.cli.terminal import to_json

    path.write_text(to_json(result) + "\n", encoding="utf-8")


def report_reconstruction(reconstruction: xr.DataTree, files: Sequence[Path], *, json: bool) -> None:
    """Print mirrors and counts, and where the files are."""
    found = mf.info(reconstruction)
    remark(found.remarks)
    if json:
        show_json(found.but(files=list(map(str, files))))
        return
    show_mirrors(found.mirrors)
    counts = ", ".join(f"{count} after {bounces}" for bounces, count in found.points_by_bounces.items())
    kinds = f"{found.points - found.points_on_mirrors} of objects and {found.points_on_mirrors} of walls"
    print(f"{found.points} points, {kinds}; by bounces: {counts or 'none'}")
    show_files(files)
