"""What an image shows, and whether its grid holds the scene."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

from mirrorfold.common.decibels import power_decibel
from mirrorfold.common.facts import resolving_aperture
from mirrorfold.common.records import LEFT_OUT, Number, fact
from mirrorfold.describing.contents import Sized
from mirrorfold.describing.resolution import cross_range_resolution
from mirrorfold.io.own.checks import image_axes


class ImageFacts(Sized):
    """An image."""

    kind: Literal["image"]
    type: str = fact("of the pixels")
    extent: dict[str, list[float]] = fact("first and last coordinate of each dimension")
    pixel: dict[str, Number] = fact("size of a pixel along each dimension")
    cross_range_resolution_m: dict[str, float] | None = fact(
        "of an array, by range [m]: the nearest and the farthest pixel and the middle", default=LEFT_OUT
    )
    strongest_at: dict[str, float]
    median_below_peak_db: Number = fact("[dB]")
    remarks: list[str] = fact("sentences on what looks wrong")
    files: list[str] = fact("what was written", default=LEFT_OUT)


def describe_image(image: xr.DataArray) -> ImageFacts:
    """Facts about a valid image: grid, resolution, strongest pixel, and remarks on what looks wrong."""
    amplitude = np.abs(image.values)
    peak = np.unravel_index(int(amplitude.argmax()), amplitude.shape)
    axes = image_axes(image)
    at = {str(name): int(i) for name, i in zip(image.dims, peak, strict=True)}
    remarks = []
    if not amplitude.any():
        remarks.append("Every pixel is zero; there is nothing to see.")
    elif any(image.sizes[name] > 1 and at[name] in (0, image.sizes[name] - 1) for name in axes):
        remarks.append("The strongest pixel lies on the border; the grid probably cuts off part of the scene.")
    below_peak = float(np.median(amplitude) / amplitude.max()) ** 2 if amplitude.any() else 0.0
    return ImageFacts(
        kind="image",
        title=str(image.attrs.get("title", "")),
        dimensions={str(name): int(size) for name, size in image.sizes.items()},
        type=str(image.dtype),
        extent={name: [float(image[name].min()), float(image[name].max())] for name in axes},
        pixel={name: float(np.diff(image[name]).mean()) if image[name].size > 1 else None for name in axes},
        cross_range_resolution_m=_resolved(image),
        strongest_at={name: float(image[name].values[i]) if name in axes else i for name, i in at.items()},
        median_below_peak_db=power_decibel(below_peak),
        remarks=remarks,
    )


def _resolved(image: xr.DataArray) -> Any:
    """Cross-range resolution at the nearest, middle and farthest range of an image, by range [m].

    `LEFT_OUT` where the attributes do not tell aperture, band and position of the radar.
    """
    needed = ("tx_aperture", "rx_aperture", "frequency_start", "frequency_stop", "radar_position")
    if not set(needed) <= set(image.attrs) or not {"x", "y"} <= set(image.coords):
        return LEFT_OUT
    attrs = image.attrs
    aperture = resolving_aperture(attrs)
    if aperture == 0.0:
        return LEFT_OUT
    middle = 0.5 * (float(attrs["frequency_start"]) + float(attrs["frequency_stop"]))
    wavelength = float(attrs.get("wave_speed", speed_of_light)) / middle
    offset = [image[name].values - attrs["radar_position"][n] for n, name in enumerate("xy")]
    near, far = (float(np.hypot(*(end(np.abs(axis)) for axis in offset))) for end in (np.min, np.max))
    return cross_range_resolution(wavelength, aperture, [near, 0.5 * (near + far), far])
