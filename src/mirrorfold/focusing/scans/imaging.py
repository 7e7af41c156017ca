"""Images of raster scans within the available memory, and forecasts of time and memory.

The scanner's lens focuses each beam, so that a scan can be imaged azimuth by azimuth. Only the result exists as a
whole: the complex volume, or only its amplitude where it is to be folded, or voxels. For voxels, as many azimuths are
imaged at a time as fit into the memory.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from scipy.fft import next_fast_len

from mirrorfold.common.facts import VOLUME, VOXELS
from mirrorfold.common.forecasts import GIGABYTE, expect, tell
from mirrorfold.common.memory import check_room, room_below
from mirrorfold.common.threads import cpu_count
from mirrorfold.common.types import Progress
from mirrorfold.errors import InputError
from mirrorfold.focusing.choosing.facts import Choice
from mirrorfold.focusing.choosing.strips import ROOM_SHARE
from mirrorfold.focusing.predicting.cost import Cost
from mirrorfold.focusing.predicting.machine import machine
from mirrorfold.focusing.scans.gridding import VOXEL_BYTES, Voxels
from mirrorfold.focusing.scans.range_profiles import PADDING, Profiles
from mirrorfold.focusing.settings import FocusSettings
from mirrorfold.sweep import ambiguous_range
from mirrorfold.sweep.polarization import picked, polarizations

SCAN_PASSES = 6
"""Number of times that the volume of a raster scan goes through memory, each time costing one interpolation tap."""

COLUMN_ARRAYS = 4.0
"""Arrays of padded complex profiles of one azimuth that a thread holds at once: before and after the transform, a
buffer that the transform may need, and the profiles turned in phase."""

FEWEST_COLUMNS = 2
"""Least number of azimuths at a time: voxels are interpolated between two."""


def focus_scan(sweep: xr.Dataset, settings: FocusSettings, progress: Progress | None) -> xr.DataArray:
    """The volume of a raster scan or, if x, y and z are given, its amplitude on this grid; see `focus`.

    Raises
    ------
    InputError
        If an argument cannot be used, or the memory does not hold the result.
    """
    x, y, z = _axes(settings)
    profiles = Profiles.of(sweep, settings)
    limit = settings.memory_limit
    if x is None or y is None or z is None:
        _check_volume(profiles, limit, amplitude=False)
        return profiles.volume(progress=progress)
    coords = {name: values for name, (_, values, _) in profiles.coords.items()}
    room = room_below(limit)
    voxels = Voxels.of(coords, profiles.attrs, x=x, y=y, z=z)
    (total, rows, ranges), tiles = profiles.shape, _tiles(profiles, room - voxels.values.nbytes)
    parts = {"samples": float(profiles.samples.nbytes), "voxels": float(voxels.values.nbytes)}
    parts |= {"amplitude": 4.0 * len(tiles[0]) * rows * ranges, "profiles at work": _work_bytes(rows, profiles.size)}
    tell(parts, f"{_what(total, rows)} in {len(tiles)} tile{'s' if len(tiles) > 1 else ''}")
    for tile in tiles:
        voxels.fill(profiles.beams(tile, amplitude=True), tile)
        if progress is not None:
            progress(tile.stop, total)
    return voxels.labelled()


def focus_scans(sweep: xr.Dataset, settings: FocusSettings, progress: Progress | None) -> xr.DataArray:
    """As `focus_scan`; of a scan with frames or several polarizations all of them, along leading dimensions.

    Raises
    ------
    InputError
        As `focus_scan`.
    """
    if "frame" in sweep["s"].dims:
        count = sweep.sizes["frame"]
        each = []
        for n in range(count):
            each.append(focus_scans(sweep.isel(frame=n), settings, progress if count == 1 else None))
            left = float(each[n].nbytes) * (2 * count - n - 1)  # of those to come, and of all together
            check_room(left, f"sweep: the images of {count} frames", REMEDY, settings.memory_limit)
            if progress is not None:
                progress(n + 1, count)
        of_frames = {name: values for name, values in sweep.coords.items() if values.dims == ("frame",)}
        return _stacked(each, "frame", of_frames)
    names = polarizations(sweep)
    if not names:
        return focus_scan(sweep, settings, progress)
    each = [focus_scan(picked(sweep, name), settings, progress) for name in names]
    return _stacked(each, "polarization", {"polarization": ("polarization", np.array(names))})


def _stacked(each: list[xr.DataArray], dim: str, coords: dict[Any, Any]) -> xr.DataArray:
    """Images along a new first dimension; in memory, the axes of each keep their order."""
    dims = each[0].dims
    values = np.stack([np.moveaxis(one.values, dims.index("range"), -1) if "range" in dims else one for one in each])
    if "range" in dims:
        values = np.moveaxis(values, -1, dims.index("range") + 1)
    coords = {**{name: one for name, one in each[0].coords.items() if one.dims}, **coords}
    return xr.DataArray(values, dims=(dim, *dims), coords=coords, attrs=each[0].attrs, name="image")


def amplitude_of_scan(sweep: xr.Dataset, settings: FocusSettings, progress: Progress | None) -> xr.DataArray:
    """The amplitude of a scan's volume, in half the memory of the volume: folding needs no more.

    Raises
    ------
    InputError
        As `focus_scan`.
    """
    _axes(settings)
    profiles = Profiles.of(sweep, settings)
    _check_volume(profiles, settings.memory_limit, amplitude=True)
    return profiles.volume(amplitude=True, progress=progress)


def is_gridded(settings: FocusSettings) -> bool:
    """Whether voxels on a Cartesian grid are asked for."""
    return any(axis is not None for axis in (settings.x, settings.y, settings.z))


def choose_scan(sweep: xr.Dataset, settings: FocusSettings) -> Choice:
    """Shape, predicted time and memory of the image that `focus` makes of a scan; see `choose_algorithm`."""
    x, y, z = _axes(settings)
    speed, shape = machine(), sweep["s"].shape
    frames, (columns, rows) = int(np.prod(shape[:-3])), shape[-2:]
    size = int(next_fast_len(PADDING * shape[-3]))
    seconds = frames * columns * rows * size * (speed.fourier * np.log2(size) + SCAN_PASSES * speed.stretch)
    samples, work = 8.0 * sweep["s"].size, _work_bytes(rows, size)
    remarks = []
    if x is None or y is None or z is None:
        whole = {"range": (0.0, ambiguous_range(sweep), size)}
        for name in ("azimuth", "elevation"):
            angle = sweep[name].values
            whole[name] = (float(angle[0]), float(angle[-1]), angle.size)
        held = 8.0 * frames * columns * rows * size
        check_room(held + work, _what(columns, rows), REMEDY, settings.memory_limit)
    else:
        axes = {"z": z, "y": y, "x": x}
        whole = {n: (float(np.min(axis)), float(np.max(axis)), int(np.size(axis))) for n, axis in axes.items()}
        voxels = VOXEL_BYTES * np.prod([count for *_, count in whole.values()], dtype=float)
        check_room(voxels, f"{voxels / VOXEL_BYTES:.3g} voxels", "ask for fewer", settings.memory_limit)
        each = 4.0 * rows * size
        at_once = _columns_at_once(columns, rows, each, room_below(settings.memory_limit) - voxels - work)
        held = voxels + at_once * each
        if at_once < columns:
            count = len(_cut(columns, at_once))
            remarks.append(f"The memory does not hold the whole volume: the voxels are made in {count} tiles.")
    return Choice(
        kind="choice",
        algorithm="range profiles",
        focusing_s=Cost(0.0, seconds).seconds(),
        memory_gb=(samples + held + work) / GIGABYTE,
        dimensions={name: int(count) for name, (_, _, count) in whole.items()},
        extent={name: [float(first), float(last)] for name, (first, last, _) in whole.items()},
        pixels=int(np.prod([count for *_, count in whole.values()])),
        tolerance=0.0,
        options=[],
        remarks=remarks,
    )


def expected_scan(sweep: xr.Dataset, settings: FocusSettings) -> xr.DataArray:
    """The labels of what is folded of a scan, its amplitude or voxels; one zero in memory stands for all values."""
    names = polarizations(sweep)
    profiles = Profiles.of(picked(sweep, names[0]) if names else sweep, settings)
    if not is_gridded(settings):
        coords, dims = profiles.coords, VOLUME
    else:
        given = zip("zyx", (settings.z, settings.y, settings.x), strict=True)
        coords, dims = (
            {name: (name, np.atleast_1d(np.asarray(axis, dtype=float))) for name, axis in given},
            VOXELS,
        )
    shape = [coords[name][1].size for name in dims]
    values = np.broadcast_to(np.float32(0.0), shape)
    return xr.DataArray(values, dims=dims, coords=coords, attrs=profiles.attrs, name="image")


REMEDY = "scan fewer beams or frequencies, close other programs, or raise the limit"


def _what(columns: int, rows: int) -> str:
    """What takes the memory, as text for messages."""
    return f"sweep: the range profiles of {columns} x {rows} beams"


def _axes(settings: FocusSettings) -> tuple[Any, Any, Any]:
    """The axes x, y and z; all are given, or none.

    Raises
    ------
    InputError
        If only some of them are given, or an apodization, which scans do not have.
    """
    if settings.apodization is not None:
        raise InputError("apodization: a raster scan has no elements to weigh; leave it out")
    axes = settings.x, settings.y, settings.z
    if is_gridded(settings) and any(axis is None for axis in axes):
        raise InputError("x, y and z: a raster scan is gridded on all three or on none; give the missing ones")
    return axes


def _work_bytes(rows: int, size: int) -> float:
    """Memory [bytes] of the azimuths that are at work, one for each core."""
    return COLUMN_ARRAYS * 8.0 * rows * size * cpu_count()


def _check_volume(profiles: Profiles, limit: float | None, *, amplitude: bool) -> None:
    """Refuse a volume that does not fit into the memory, before it is begun."""
    columns, rows, ranges = profiles.shape
    held = (4.0 if amplitude else 8.0) * columns * rows * ranges
    samples = float(profiles.samples.nbytes)
    parts = {"samples": samples, "volume": held, "profiles at work": _work_bytes(rows, profiles.size)}
    expect(parts, _what(columns, rows), REMEDY, held=samples, limit=limit)


def _tiles(profiles: Profiles, room: float) -> list[range]:
    """Tiles of azimuths that are imaged at a time, within `room` [bytes]; neighbouring tiles share an azimuth."""
    columns, rows, ranges = profiles.shape
    return _cut(columns, _columns_at_once(columns, rows, 4.0 * rows * ranges, room - _work_bytes(rows, profiles.size)))


def _cut(columns: int, at_once: int) -> list[range]:
    """Tiles of at most `at_once` azimuths; neighbouring tiles share an azimuth."""
    return [range(first, min(first + at_once, columns)) for first in range(0, columns - 1, at_once - 1)]


def _columns_at_once(columns: int, rows: int, each: float, room: float) -> int:
    """Number of azimuths of `each` bytes that fit into `room` [bytes].

    Raises
    ------
    InputError
        If these are too few to interpolate between.
    """
    fit = int(max(ROOM_SHARE * room, 0.0) // each)
    if fit < FEWEST_COLUMNS:
        lacking = (FEWEST_COLUMNS * each / ROOM_SHARE - room) / GIGABYTE
        raise InputError(
            f"{_what(columns, rows)} need about {lacking:.3g} GB more than the process may have, though they are made "
            f"in tiles; {REMEDY}"
        )
    return min(fit, columns)
