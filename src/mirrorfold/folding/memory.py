"""How much memory steps 2 to 6 take: the sum of the arrays that are as large as the image, the view or the volume."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mirrorfold.common.facts import VOLUME, VOXELS
from mirrorfold.common.forecasts import Parts, fullest
from mirrorfold.detection.search.fit import PROFILE_SAMPLES
from mirrorfold.detection.views.image_to_view import outline_of
from mirrorfold.detection.views.view import check_axes
from mirrorfold.detection.volume_echoes import MOST_ECHOES
from mirrorfold.tree.explaining.directions import bytes_at_once
from mirrorfold.tree.explaining.waves import profile_bytes

COMPLEX, DOUBLE, SINGLE, OWNER = 8.0, 8.0, 4.0, 2.0
"""Bytes of a complex number in single precision, of real numbers in double and in single precision, and of a mirror's
number."""

RIDGE_ARRAYS = 3.0
"""Arrays as large as the view that are held at once while noise, side lobes and ridges are found in it."""

DRAWING_ARRAYS = 3.5
"""Arrays as large as the view that are held while the pictures are drawn: its power as splines, and its amplitude twice
in single precision, to interpolate between."""

PROFILE_ARRAYS = 3.0
"""Tables of depths, and of power across a mirror, that are held at once while the mirror is fitted."""

ECHO_BYTES = 24.0
"""Bytes held for each echo that a beam may have: elevation, range and amplitude."""


def fold_parts(image: xr.DataArray, sweep: xr.Dataset | None = None) -> Parts:
    """The arrays of `mirrorfold.fold` at the stage that holds most at once, by name [bytes].

    Of the image only the shape and the type matter, and whether the values are finite; by the `sweep`, echoes are
    tested.

    Raises
    ------
    InputError
        If the image cannot be used.
    """
    held: Parts = {"image": float(image.size * image.dtype.itemsize)}
    if "frame" in image.dims:
        image = image.isel(frame=0)
    if sweep is not None:
        held["samples"] = 8.0 * sweep["s"].size
    if image.dims == VOLUME:
        return _of_volume(held, image)
    if image.dims == VOXELS:  # the floor plan alone is folded
        flat: Parts = {"amplitude of the voxels": SINGLE * image.size}
        return fullest(held | flat, _of_image(held | {"floor plan": SINGLE * image[0].size}, image[0].real, sweep))
    return _of_image(held, image, sweep)


def _of_image(held: Parts, image: xr.DataArray, sweep: xr.Dataset | None) -> Parts:
    """The arrays at the fullest stage of folding an image (y, x)."""
    outline, pixels = outline_of(image), float(image.size)
    samples = float(outline.range.size * outline.u.size)
    view = {"view": DOUBLE * samples}
    if np.iscomplexobj(image.dtype.type()):
        seen = {"image without its carrier": COMPLEX * pixels, "splines": DOUBLE * pixels}
    else:
        seen = {"amplitude": image.dtype.itemsize * pixels}
    stages = [held | view | seen, held | view | {"noise, side lobes and ridges": RIDGE_ARRAYS * DOUBLE * samples}]
    if sweep is not None and "rx" in sweep.dims:  # a single moving antenna measures no directions
        profiles, work = bytes_at_once(sweep)
        held = held | {"range profiles": profiles, "range profiles of pairs": profile_bytes(sweep)}
        stages.append(held | view | {"directions of echoes": work})
    drawn = {"power and table": DRAWING_ARRAYS * DOUBLE * samples, "owners": OWNER * samples}
    return fullest(*stages, held | view | drawn | {"pictures": (2.0 * SINGLE + COMPLEX) * pixels})


def _of_volume(held: Parts, volume: xr.DataArray) -> Parts:
    """The arrays at the fullest stage of folding a volume (range, azimuth, elevation)."""
    check_axes(volume, VOLUME)
    beams = float(volume.sizes["azimuth"] * volume.sizes["elevation"])
    view = {"amplitude": SINGLE * volume.size}
    if volume.dtype == np.float32:  # the amplitude of a scan that was focused to be folded is itself the view
        view = {}
    search = {"echoes": ECHO_BYTES * MOST_ECHOES * beams}
    fits = {"profiles across a wall": PROFILE_ARRAYS * DOUBLE * PROFILE_SAMPLES * beams}
    return fullest(held | view | search | fits, held | view | search | {"owners": OWNER * volume.size})
