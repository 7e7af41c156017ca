"""Path lengths over reflectors at known places, from every transmitter to every receiver."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mirrorfold.common.arguments import number
from mirrorfold.common.geometry import place, reflect, unit
from mirrorfold.common.plausible import reach, shorter_unit
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.sweep import ambiguous_range, radar_position, wave_speed

SPECULAR_ITERATIONS = 12
"""Fixed-point steps to the point of a sphere at which the wave is mirrored. Each multiplies the error by radius over
distance, and the path length is stationary at this point."""


def sphere_paths(tx: Array, rx: Array, centre: ArrayLike, radius: float = 0.0) -> Array:
    """Path lengths [m] over a sphere, or over a point if its radius is zero.

    Parameters
    ----------
    tx, rx : (tx, 3) and (rx, 3) arrays [m]
    centre : (2,) or (3,) [m]
    radius : float [m]

    Returns
    -------
    (tx, rx) array [m]

    Raises
    ------
    InputError
        If the radius is negative, or the sphere holds an antenna.
    """
    middle = place(centre, "at")
    radius = number("radius", radius, "m", lowest=0.0)
    nearest = min(float(np.linalg.norm(antennas - middle, axis=1).min()) for antennas in (tx, rx))
    if nearest <= radius:
        raise InputError(
            f"the reflector at {', '.join(f'{c:g}' for c in middle)} m holds an antenna, which stands {nearest:g} m "
            "from its middle; correct its place or its radius"
        )
    point = np.broadcast_to(middle, (len(tx), len(rx), 3))
    for _ in range(SPECULAR_ITERATIONS if radius > 0 else 0):
        bisector = _unit(tx[:, None] - point) + _unit(rx[None] - point)
        point = middle + radius * _unit(bisector)
    return np.asarray(np.linalg.norm(tx[:, None] - point, axis=-1) + np.linalg.norm(rx[None] - point, axis=-1))


def plate_paths(tx: Array, rx: Array, point: ArrayLike, normal: ArrayLike) -> Array:
    """Path lengths (tx, rx) [m] over a flat plate, given by a point and the normal, from the transmitters' images."""
    through, direction = place(point, "at"), place(normal, "normal")
    if not np.linalg.norm(direction) > 0:
        raise InputError("normal is zero, expected a direction, for example (0, -1)")
    image = reflect(tx, through, unit(direction))
    return np.asarray(np.linalg.norm(image[:, None] - rx[None], axis=-1))


def check_reach(at: ArrayLike, sweep: xr.Dataset) -> None:
    """Refuse a reflector so far from the radar that its place was given in a wrong unit.

    Raises
    ------
    InputError
    """
    limit = reach(ambiguous_range(sweep), wave_speed(sweep) / float(sweep["frequency"].max()))
    middle = place(at, "at")
    centres = [radar_position(sweep), np.asarray(sweep.attrs.get("scene_center", radar_position(sweep)))]
    away = min(float(np.linalg.norm(middle - centre)) for centre in centres)
    if away > limit:
        raise InputError(
            f"the reflector at {', '.join(f'{c:g}' for c in middle)} m stands {away:.4g} m from the radar, expected at "
            f"most {limit:.3g} m{shorter_unit(away, limit)}; correct its place"
        )


def positions(sweep: xr.Dataset) -> tuple[Array, Array]:
    """Positions of the transmitters and of the receivers of a sweep, (tx, 3) and (rx, 3) [m]."""
    return sweep["tx_position"].values.astype(float), sweep["rx_position"].values.astype(float)


def _unit(vector: Array) -> Array:
    """Unit vectors along vectors (..., 3)."""
    return np.asarray(vector / np.linalg.norm(vector, axis=-1, keepdims=True))
