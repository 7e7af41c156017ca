"""What coordinates and attributes of an image or of a reconstruction tell about the pixels, the radar and its waves."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

from mirrorfold.common.arguments import in_message
from mirrorfold.common.plausible import radians_for_degrees, unplaced
from mirrorfold.common.types import Array
from mirrorfold.common.units import SLOWEST, other_unit
from mirrorfold.errors import InputError

VOLUME, VOXELS = ("range", "azimuth", "elevation"), ("z", "y", "x")
"""Dimensions of the volume of a raster scan, and of voxels."""

MEASURED = {
    "wave_speed": SLOWEST,
    **dict.fromkeys(("frequency_start", "frequency_stop"), 1e-3),
    **dict.fromkeys(("range_resolution", "ambiguous_range", "spot_radius", "focus_distance"), 1e-9),
    **dict.fromkeys(("tx_aperture", "rx_aperture", "frequency_points"), 0.0),
}
"""Attributes that are numbers, and a lower bound of each for any radar or sonar [m/s, Hz, m, 1]."""

MAY_BE_INFINITE = ("range_resolution", "ambiguous_range")
"""Attributes that may be infinite, as of a sweep with a single frequency."""

VECTOR_ATTRIBUTES = ("radar_position", "array_direction")
"""Attributes that are a place or a direction."""

APERTURES = "tx_aperture", "rx_aperture"
"""Attributes that hold the lengths of both arrays [m]."""

BAND = "frequency_start", "frequency_stop", "frequency_points"
"""Attributes that hold the frequencies with which an image was focused [Hz, Hz, 1]."""


def tells_band(attrs: Mapping[Any, Any]) -> bool:
    """Whether the attributes of an image tell its frequencies; an image of another program may tell only some."""
    return all(attrs.get(name) is not None for name in BAND)


def check_facts(attrs: Mapping[Any, Any], source: str, prefix: str = "") -> None:
    """Refuse impossible facts about the measurement in the attributes of an image or of a reconstruction.

    Parameters
    ----------
    attrs : dict
    source : str
        Name of the file in the message.
    prefix : str
        Prefix of the names: in a reconstruction, attributes of its image are called ``image_...``.

    Raises
    ------
    InputError
        If an attribute has an impossible value.
    """
    for name, least in MEASURED.items():
        value = attrs.get(f"{prefix}{name}")
        if value is None:
            continue
        values = np.asarray(value)
        number = values.ndim == 0 and values.dtype.kind in "fiu"
        if not number or not values >= least or (np.isinf(values) and name not in MAY_BE_INFINITE):
            what = f"attr {prefix}{name} is {in_message(value)}, expected a number of at least {least:g}"
            raise InputError(f"{source}: {what}; write it in SI units, or leave it out")
    for name in VECTOR_ATTRIBUTES:
        value = attrs.get(f"{prefix}{name}")
        if value is None:
            continue
        values = np.asarray(value)
        if values.shape not in ((2,), (3,)) or values.dtype.kind not in "fiu" or unplaced(values) is not None:
            raise InputError(f"{source}: attr {prefix}{name} is {in_message(value)}, expected two or three numbers")
        if name == "array_direction" and not np.linalg.norm(values[:2]) > 0.0:
            raise InputError(f"{source}: attr {prefix}{name} is {in_message(value)}, expected a direction in the plane")
    start, stop = (attrs.get(f"{prefix}frequency_{end}") for end in ("start", "stop"))
    several = (attrs.get(f"{prefix}frequency_points") or 0) > 1
    if start is not None and stop is not None and (start > stop or (several and start == stop)):
        raise InputError(
            f"{source}: attr {prefix}frequency_stop is {in_message(stop)}, expected more than {in_message(start)}"
        )


def check_unit(axis: xr.DataArray, source: str) -> None:
    """Refuse a coordinate of an image in another unit than metres or, for azimuth and elevation, degrees.

    Raises
    ------
    InputError
        If the coordinate is in another unit.
    """
    unit = "degree" if axis.name in ("azimuth", "elevation") else "m"
    other = other_unit(axis.attrs.get("units"), unit)
    if other is not None:
        said = f"is in {other}, as its attribute units says, expected {unit}; convert it, or correct the attribute"
        raise InputError(f"{source}: {axis.name} {said}")


def doubt_angles(volume: xr.DataArray, source: str) -> None:
    """Give a warning where azimuth and elevation of a volume, in degrees, are probably in radians."""
    highest = volume.attrs.get("frequency_stop")
    wavelength = volume.attrs.get("wave_speed", speed_of_light) / highest if highest else 0.0
    azimuth, elevation = (volume[name].values.astype(float) for name in ("azimuth", "elevation"))
    in_radians = radians_for_degrees(azimuth, elevation, wavelength)
    if in_radians is not None:
        warnings.warn(f"{source}: {in_radians} Remedy: convert them to degrees", stacklevel=2)


def radar_place(attrs: Mapping[Any, Any]) -> Array:
    """Position (3,) [m] of the radar in the attributes of an image; the origin, or the floor, where they do not say."""
    given = np.asarray(attrs.get("radar_position", ()), dtype=float)
    return np.append(given, np.zeros(3 - given.size))


def recorded_radar(attrs: Mapping[Any, Any]) -> Array:
    """Position (3,) [m] of the radar in the attributes of a reconstruction; zero where they do not say."""
    return np.array([float(attrs.get(f"radar_{axis}", 0.0)) for axis in "xyz"])


def resolving_aperture(attrs: Mapping[Any, Any], prefix: str = "") -> float:
    """Length [m] of the aperture that resolves directions, in attributes with a prefix as for `check_facts`.

    It is the longer one; of one antenna that both sends and receives, twice its way. Zero where they do not say.
    """
    tx, rx, monostatic = (float(attrs.get(f"{prefix}{name}", 0.0)) for name in (*APERTURES, "monostatic"))
    return (2.0 if monostatic else 1.0) * max(tx, rx)
