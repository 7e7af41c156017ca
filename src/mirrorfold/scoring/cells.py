"""The size of the resolution cell at each point of a reconstruction: the unit in which any radars can be compared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

from mirrorfold.common.beams import HALF_POWER, beam_radius
from mirrorfold.common.facts import recorded_radar, resolving_aperture
from mirrorfold.common.types import Array


def point_cells(objects: xr.Dataset, attrs: Mapping[Any, Any], *, grown: bool = True) -> Array | None:
    """Diagonal of the resolution cell at each point of a reconstruction, (points,) [m], from its `attrs`; None if they
    do not say how it was measured.

    Along the line of sight, the cell is ``c / (2 B)`` long. Across, at the range r, it is ``r lambda / D`` wide for an
    array of length D, and as wide as the beam between half powers for a scan. Folding keeps the length of the way, so r
    is the distance of the point from the radar before folding. Behind curved mirrors, the cell is wider across by the
    factor in the column `growth`, which is applied only if `grown`.
    """
    axes = [axis for axis in "xyz" if f"{axis}_initial" in objects.variables]

    def known(name: str) -> float | None:
        value = attrs.get(f"image_{name}")
        return None if value is None else float(value)

    depth, low, high = map(known, ("range_resolution", "frequency_start", "frequency_stop"))
    if not axes or depth is None or low is None or high is None:
        return None
    radar = recorded_radar(attrs)
    way = np.linalg.norm([objects[f"{axis}_initial"].values - radar["xyz".index(axis)] for axis in axes], axis=0)
    wavelength = float(attrs.get("image_wave_speed", speed_of_light)) / (0.5 * (low + high))
    aperture = resolving_aperture(attrs, "image_")
    spot, focus = known("spot_radius"), known("focus_distance")
    if aperture > 0.0:
        across = way * wavelength / aperture
    elif spot is not None and focus is not None:
        across = HALF_POWER * beam_radius(way, spot_radius=spot, focus_distance=focus, wavelength=wavelength)
    else:
        return None
    if grown and "growth" in objects.variables:
        across = across * objects["growth"].values
    return np.hypot(depth, across)
