"""Writes a sweep as a network analyser would: a folder of Touchstone files and a table of positions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.arguments import path_of
from mirrorfold.common.types import Progress
from mirrorfold.errors import InputError
from mirrorfold.io.files import directory_written_atomically
from mirrorfold.sweep import (
    MONOSTATIC_DIMENSIONS,
    PAIR_DIMENSIONS,
    RASTER_DIMENSIONS,
    check_sweep,
    is_monostatic,
    is_raster,
)

POSITIONS, DESCRIPTION = "positions.csv", "scan.toml"
"""Names of the table of positions, and of the description of a scan."""


def save_touchstone(sweep: xr.Dataset, folder: str | Path, *, progress: Progress | None = None) -> Path:
    """Write a sweep as a folder of Touchstone files and a table of positions, as a network analyser would measure it.

    A sweep of pairs becomes two-port files with S21 (S12 is the same; S11 and S22 are zero), any other sweep becomes
    one-port files with S11. The samples have nine digits, so that `import_data` reads the same numbers.

    Parameters
    ----------
    sweep : xarray.Dataset
        Without further dimensions such as `frame`.
    folder : path
        Folder to write to; it is made if it does not exist.
    progress : callable (done, total), optional

    Returns
    -------
    Path
        Path of the table ``positions.csv``, or of ``scan.toml`` beside it if more than places must be told; it is what
        `import_data` takes as `positions`.

    Raises
    ------
    InputError
        If the sweep is not valid or has further dimensions, or the folder cannot be written.
    """
    sweep = check_sweep(sweep)
    dims: tuple[str, ...] = RASTER_DIMENSIONS if is_raster(sweep) else PAIR_DIMENSIONS
    dims = MONOSTATIC_DIMENSIONS if is_monostatic(sweep) else dims
    if sweep["s"].dims != dims:
        raise InputError(
            f"sweep: has the dimensions {sweep['s'].dims}, expected {dims}; select one index of any further dimension"
        )
    folder = path_of("save_touchstone", folder, "the path of a folder")
    s = sweep["s"].values.reshape(sweep.sizes["frequency"], -1)
    heading, numbers, names, kept = _listing(sweep, dims)
    pairs = dims[1] == "tx"
    rows = np.zeros((sweep.sizes["frequency"], 9 if pairs else 3))
    rows[:, 0] = sweep["frequency"].values
    form = "%.17g %.9g %.9g" + (" %.9g %.9g %.9g %.9g %.9g %.9g" if pairs else "")
    head = "! written by mirrorfold\n" + ("! S11 and S22 are not known\n" if pairs else "") + "# Hz S RI R 50\n"
    with directory_written_atomically(folder, replaces=(POSITIONS, DESCRIPTION)) as directory:
        for done, (name, column) in enumerate(zip(names, kept, strict=True), 1):
            sample = s[:, column]
            if pairs:
                rows[:, 3] = rows[:, 5] = sample.real
                rows[:, 4] = rows[:, 6] = sample.imag
            else:
                rows[:, 1], rows[:, 2] = sample.real, sample.imag
            text = "\n".join([form % tuple(row) for row in rows.tolist()])
            (directory / name).write_text(f"{head}{text}\n", encoding="ascii")
            if progress is not None and (done % 64 == 0 or done == len(names)):
                progress(done, len(names))
        lines = [",".join([name, *map(repr, row)]) for name, row in zip(names, numbers.tolist(), strict=True)]
        (directory / POSITIONS).write_text("\n".join([",".join(("file", *heading)), *lines, ""]), encoding="ascii")
        description = _description(sweep)
        if description:
            (directory / DESCRIPTION).write_text(description, encoding="utf-8")
    return folder / (DESCRIPTION if description else POSITIONS)


def _listing(
    sweep: xr.Dataset, dims: tuple[str, ...]
) -> tuple[tuple[str, ...], NDArray[np.float64], list[str], list[int]]:
    """Headings and numbers of the table, names of the files, and the index of the channel that each holds."""
    first, second = (*(sweep.sizes[name] for name in dims[1:]), 1)[:2]
    i, k = (index.ravel() for index in np.indices((first, second)))
    width = len(str(max(first, second) - 1))
    if dims[1] == "tx":
        held = sweep["measured"].values if "measured" in sweep.variables else np.ones(i.size)
        measured = held.astype(bool).ravel()  # whole numbers would count as indices
        i, k = i[measured], k[measured]
        numbers = np.concatenate([sweep["tx_position"].values[i], sweep["rx_position"].values[k]], axis=1)
        names = [f"tx{a:0{width}}_rx{b:0{width}}.s2p" for a, b in zip(i, k, strict=True)]
        heading: tuple[str, ...] = ("tx_x", "tx_y", "tx_z", "rx_x", "rx_y", "rx_z")
    elif dims[1] == "position":
        numbers = sweep["antenna_position"].values
        names, heading = [f"position{a:0{width}}.s1p" for a in i], ("x", "y", "z")
    else:
        numbers = np.stack([sweep["azimuth"].values[i], sweep["elevation"].values[k]], axis=-1)
        names = [f"azimuth{a:0{width}}_elevation{b:0{width}}.s1p" for a, b in zip(i, k, strict=True)]
        heading = ("azimuth", "elevation")
    return heading, np.asarray(numbers, dtype=float), names, (i * second + k).tolist()


def _description(sweep: xr.Dataset) -> str:
    """A description in TOML of what a table of positions cannot hold; empty if there is nothing."""
    words, numbers = ("title", "instrument", "polarization"), ("wave_speed", "spot_radius", "focus_distance")
    known: dict[str, Any] = {name: str(sweep.attrs[name]) for name in words if sweep.attrs.get(name)}
    known |= {name: float(sweep.attrs[name]) for name in numbers if name in sweep.attrs}
    for name in ("scene_center", "origin"):
        place = sweep.attrs.get(name)
        if place is not None and (name != "origin" or np.any(np.asarray(place) != 0.0)):
            known[name] = np.asarray(place, dtype=float).tolist()
    return tomli_w.dumps(known | {"table": POSITIONS}) if known else ""
