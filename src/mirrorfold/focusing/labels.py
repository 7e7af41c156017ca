"""Coordinates and attributes of an image: where its pixels are, how it was made, and by which radar."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.statistics import mean_step
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.focusing.grid import extent
from mirrorfold.focusing.problem import Problem
from mirrorfold.focusing.settings import FocusSettings
from mirrorfold.sweep import antenna_positions, frequency_step, is_monostatic, is_raster, radar_position, wave_speed


class Labels:
    """Dimensions, coordinates and attributes of the images of a sweep, made once for all of them.

    Parameters
    ----------
    sweep : xarray.Dataset
        A sweep, or its geometry alone.
    problem : Problem
    settings : FocusSettings
    leading : tuple, optional
        Dimensions of the sweep before those of a single image, such as `frame`.
    """

    def __init__(
        self, sweep: xr.Dataset, problem: Problem, settings: FocusSettings, leading: tuple[Hashable, ...] = ()
    ) -> None:
        coords: dict[str, Any] = {
            "y": ("y", problem.y, {"units": "m", "long_name": "range"}),
            "x": ("x", problem.x, {"units": "m", "long_name": "cross-range"}),
            "z": ("z", problem.z, {"units": "m", "long_name": "height"}),
        }
        coords |= {
            str(name): value for name, value in sweep.coords.items() if value.dims and set(value.dims) <= set(leading)
        }
        self.volume = settings.z is not None and np.ndim(settings.z) == 1
        if not self.volume:
            coords["z"] = xr.Variable((), problem.z[0], {"units": "m", "long_name": "height"})
        self.coords = coords
        self.dims = (*leading, "z", "y", "x") if self.volume else (*leading, "y", "x")
        named = "uniform" if settings.apodization is None else settings.apodization
        self.attrs = _measurement(sweep, problem) | {
            "tolerance": float(settings.tolerance),
            "normalization": settings.normalization,
            "taper": settings.taper if isinstance(settings.taper, str) else np.abs(problem.taper),
            "apodization": named if isinstance(named, str) else "given",
        }

    def image(self, values: NDArray[np.complex64], attrs: dict[str, Any]) -> xr.DataArray:
        """The values (..., z, y, x) as a labelled image; `attrs` are added to the attributes."""
        if not self.volume:
            values = values[..., 0, :, :]
        return xr.DataArray(values, dims=self.dims, coords=self.coords, attrs=self.attrs | attrs, name="image")


def array_direction(problem: Problem) -> Array:
    """Unit vector (3,) along the antennas, its largest component positive.

    Of a planar array the horizontal direction in which it is widest; of an upright line +x.
    """
    offset = np.concatenate([problem.tx - problem.tx.mean(axis=0), problem.rx - problem.rx.mean(axis=0)])
    plane, along = _plane(offset)
    if plane:
        along = np.append(np.linalg.svd(offset[:, :2], full_matrices=False)[2][0], 0.0)
    if np.abs(offset @ [*along[:2], 0.0]).max() <= UPRIGHT_SHARE * np.abs(offset).max():
        return np.array([1.0, 0.0, 0.0])
    return np.asarray(along * (1.0 if along[np.argmax(np.abs(along))] > 0.0 else -1.0))


def _aperture(places: Array, along: Array) -> float:
    """Length [m] of the line of antennas (n, 3) [m]; of antennas that fill a plane, their extent along `along`."""
    plane, _ = _plane(places - places.mean(axis=0))
    return float(np.ptp(places @ along) if plane else np.linalg.norm(np.ptp(places, axis=0)))


def _plane(offset: Array) -> tuple[bool, Array]:
    """Whether places (n, 3) [m], less their mean, fill a plane, and the unit vector along which they extend most."""
    _, size, axes = np.linalg.svd(offset, full_matrices=False)
    return len(size) > 1 and bool(size[1] > PLANAR_SHARE * size[0]), axes[0]


PLANAR_SHARE = 0.1
"""Antennas fill a plane, not a line, if their rms extent along the second principal axis is more than this share of
that along the first."""

UPRIGHT_SHARE = 1e-9
"""An array stands upright if its extent in the floor plan is at most this share of its length: mere rounding."""


def _measurement(sweep: xr.Dataset, problem: Problem) -> dict[str, Any]:
    """Attributes that describe the measurement: position, direction and aperture of the radar, and its band."""
    frequency = sweep["frequency"].values
    limits, along = extent(frequency, problem.tx, problem.rx, wave_speed(sweep)), array_direction(problem)
    attrs: dict[str, Any] = {
        "mirrorfold_kind": "image",
        "radar_position": problem.radar_position,
        "array_direction": along,
        "ambiguous_range": limits.ambiguous_range,
        "range_resolution": limits.range_resolution,
        "frequency_start": float(frequency[0]),
        "frequency_stop": float(frequency[-1]),
        "frequency_step": mean_step(frequency),
        "frequency_points": int(frequency.size),
        "tx_aperture": _aperture(problem.tx, along),
        "rx_aperture": _aperture(problem.rx, along),
        "wave_speed": wave_speed(sweep),
    }
    if is_monostatic(sweep):
        attrs["monostatic"] = True
    elif filled := _filled_by_pairs(problem.tx @ along, problem.rx @ along, wave_speed(sweep) / float(frequency[-1])):
        attrs["filled_aperture"] = filled
    for name in ("title", "instrument"):
        if name in sweep.attrs:
            attrs[name] = sweep.attrs[name]
    return attrs


FULL_PITCH = 0.55
"""Largest distance of antennas without gaps, in the shortest wavelength: a half, and somewhat more for a wide band."""


def _filled_by_pairs(tx: Array, rx: Array, wavelength: float) -> float:
    """Length [m] of the array that pairs of antennas at places `tx` and `rx` (n,) [m] fill, if one side has gaps.

    A virtual array: the transmitters stand one step of the receivers farther apart than these are long, or the reverse.
    Zero where both sides are without gaps, and where pairs leave gaps or overlap.
    """
    tx, rx = np.unique(tx), np.unique(rx)
    if min(tx.size, rx.size) < 2:
        return 0.0
    (fine, short), (coarse, long) = sorted((float(np.diff(side).max()), float(np.ptp(side))) for side in (tx, rx))
    full = FULL_PITCH * wavelength
    fits = fine <= full < coarse and abs(coarse - short - fine) <= 0.5 * fine
    return short + long if fits else 0.0


def check_origin(image: xr.DataArray, sweep: xr.Dataset) -> None:
    """Refuse a valid sweep of another radar than the image's attributes tell of; missing attributes are not compared.

    Raises
    ------
    InputError
        If the frequencies differ, or if the place or the apertures of the arrays differ by more than a wavelength.
    """
    frequency = sweep["frequency"].values
    step, wavelength = frequency_step(sweep), wave_speed(sweep) / float(frequency[-1])
    expected: dict[str, tuple[Any, float, str]] = {
        "frequency_points": (frequency.size, 0.0, "frequencies"),
        "frequency_start": (frequency[0], 0.5 * step, "Hz at first"),
        "frequency_stop": (frequency[-1], 0.5 * step, "Hz at last"),
        "radar_position": (radar_position(sweep), wavelength, "m as the radar's place"),
    }
    across: dict[str, Array] = {}
    if not is_raster(sweep):
        tx, rx = antenna_positions(sweep)
        along = np.asarray(image.attrs.get("array_direction", (1.0, 0.0, 0.0)), dtype=float)
        expected["tx_aperture"] = _aperture(tx, along), wavelength, "m of transmitters"
        expected["rx_aperture"] = _aperture(rx, along), wavelength, "m of receivers"
        # The aperture of a planar array is its diagonal in older files.
        across = {"tx_aperture": np.ptp(tx, axis=0), "rx_aperture": np.ptp(rx, axis=0)}
    for name, (value, tolerance, what) in expected.items():
        held = np.asarray(image.attrs.get(name, value))
        same_kind = held.dtype.kind in "fiu" and held.shape == np.shape(value)
        most = np.linalg.norm(across[name]) if name in across else value
        if not same_kind or (held < value - tolerance).any() or (held > most + tolerance).any():
            raise InputError(
                f"sweep: is of another radar than the image, {_as_text(value)} {what} in place of {_as_text(held)}; "
                "give the sweep that the image was focused from, or none"
            )


def _as_text(value: Any) -> str:
    """A number, or several, as text for a message."""
    return ", ".join(f"{one:.7g}" if isinstance(one, float) else str(one) for one in np.ravel(value).tolist())
