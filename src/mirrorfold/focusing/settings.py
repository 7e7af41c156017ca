"""The settings of focusing, declared once: keywords of `focus` and `FocusPlan`, options of the verb `focus`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mirrorfold.common.normalization import IMAGE_NORMALIZATIONS, VOLUME_NORMALIZATIONS
from mirrorfold.common.settings import Settings, setting
from mirrorfold.common.units import SLOWEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    Apodization = str | ArrayLike | tuple[str | ArrayLike | None, str | ArrayLike | None]

FINEST_TOLERANCE = 2e-6
"""Least tolerance that may be asked for: the relative error of sums, phases and tables in single precision, measured
against the float64 sum."""

TOLERANCE_TO_FOLD = 1e-3
"""Tolerance (relative L2 error) for an image that will be folded: its errors lie 60 dB below the image, far below the
threshold of its echoes."""


@dataclass(frozen=True, eq=False)
class FocusSettings(Settings):
    """Where the pixels are, how exact the image must be, and how frequencies, antennas and ranges are weighted."""

    x: ArrayLike | None = setting(
        None,
        "Cross-range of the pixels. Default: everything the array can see (`default_grid`). A single element sees "
        "ranges only: give one x, and y. A raster scan is gridded on x, y and z, or stays (range, azimuth, elevation).",
        unit="m",
        kind="1D array",
        option=False,
    )
    y: ArrayLike | None = setting(None, "Range of the pixels, likewise.", unit="m", kind="1D array", option=False)
    z: ArrayLike | None = setting(
        None,
        "Height of the pixels: with a 1D array the image is a volume, with a number a plane. Default: that of the "
        "attribute `scene_center`; without it 0, or the height of an array that stands farther from there than it is "
        "long.",
        unit="m",
        kind="1D array or number",
        option=False,
    )
    tolerance: float = setting(
        1e-4,
        "Largest relative L2 error of the image. The volume of a raster scan is exact to rounding.",
        lowest=FINEST_TOLERANCE,
        below=1.0,
    )
    taper: str | ArrayLike = setting(
        "hann",
        'Window over frequency: "hann", "triangular" (Cui and Trichopoulos 2024), "uniform" or "taylor"; in Python '
        "also one weight for each frequency.",
        kind="str or (frequencies,) array",
    )
    apodization: Apodization | None = setting(
        None,
        "Weights over the elements, complex if need be: one for all, or a pair for transmitters and receivers. "
        "Default: uniform.",
        kind="str, (elements,) array, or a pair of them",
        option=False,
    )
    wave_speed: float | None = setting(
        None,
        "Speed of the waves. Default: the attr `wave_speed` of the sweep; without it, of light in vacuum.",
        unit="m/s",
        lowest=SLOWEST,
    )
    normalization: str = setting(
        "none",
        'What undoes the spreading of the waves: "r" and "r2" multiply by the range from the radar or its square, '
        '"beam" by the area of the focused beam. An array has "none", "r" and "r2", a raster scan "none", "r2" and '
        '"beam".',
        choices=tuple(dict.fromkeys((*IMAGE_NORMALIZATIONS, *VOLUME_NORMALIZATIONS))),
    )
    memory_limit: float | None = setting(
        None,
        "Memory that the process may hold in all: an image is made in strips where it must, to the same tolerance, and "
        "the voxels of a raster scan in tiles, to the same bits. What does not fit either is refused. Default: what is "
        "free.",
        unit="B",
        above=0.0,
    )
