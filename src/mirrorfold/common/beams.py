"""The beam of a raster scanner: where it points and how wide it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mirrorfold.common.types import Array

HALF_POWER = float(np.sqrt(2.0 * np.log(2.0)))
"""Width of a Gaussian beam between half powers, in units of its radius w, at which the one-way amplitude has fallen to
1/e. It is also the width between half amplitudes of the two-way beam, whose amplitude is ``exp(-2 (x/w)^2)``."""


def beam_direction(azimuth: ArrayLike, elevation: ArrayLike) -> Array:
    """Unit vectors ``(sin az cos el, cos az cos el, sin el)``, shape (..., 3).

    Parameters
    ----------
    azimuth, elevation : (...) arrays [degree]
        Broadcast against each other.

    Examples
    --------
    >>> beam_direction(90.0, 0.0).round(6).tolist()
    [1.0, 0.0, 0.0]
    """
    az, el = np.broadcast_arrays(np.radians(azimuth), np.radians(elevation))
    return np.stack([np.sin(az) * np.cos(el), np.cos(az) * np.cos(el), np.sin(el)], axis=-1)


def beam_angles(direction: ArrayLike) -> tuple[Array, Array]:
    """Azimuth and elevation [degree] of vectors (..., 3) of any length: the inverse of `beam_direction`."""
    direction = np.asarray(direction, dtype=float)
    azimuth = np.degrees(np.arctan2(direction[..., 0], direction[..., 1]))
    elevation = np.degrees(np.arctan2(direction[..., 2], np.hypot(direction[..., 0], direction[..., 1])))
    return azimuth, elevation


def beam_radius(range_: ArrayLike, *, spot_radius: float, focus_distance: float, wavelength: float) -> Array:
    """Radius [m] at which the amplitude of a focused Gaussian beam has fallen to 1/e.

    ``w(r) = w0 sqrt(1 + ((r - f) / zR)^2)`` with the Rayleigh length ``zR = pi w0^2 / lambda`` (Kogelnik and Li, Appl.
    Opt. 5, 1966, eq. 20).

    Parameters
    ----------
    range_ : (...) array [m]
        Distance from the radar.
    spot_radius : float [m]
        w0, radius of the beam in the focus.
    focus_distance : float [m]
        f, distance of the focus from the radar.
    wavelength : float [m]
    """
    rayleigh = np.pi * spot_radius**2 / wavelength
    return spot_radius * np.hypot(1.0, (np.asarray(range_, dtype=float) - focus_distance) / rayleigh)


def spread_beam(
    before: ArrayLike, rest: ArrayLike, power: ArrayLike, *, spot_radius: float, focus_distance: float,
    wavelength: float,
) -> tuple[Array, Array]:  # fmt: skip
    """Width of a focused Gaussian beam behind a curved mirror, along one principal direction of the mirror.

    At the mirror, the power p of the mirror is added to the beam's ``1/q = 1 / (r1 - f + j zR)``. After the rest s of
    the way, ``w^2 = -lambda / (pi Im(1/q))`` (Kogelnik and Li, Appl. Opt. 5, 1966, eqs. 17 and 43). When the radar
    turns the beam by a small angle, the axis of the beam moves there by ``r1 + s + r1 s p`` times the angle.

    Parameters
    ----------
    before, rest : (...) arrays [m]
        Length of the way to the mirror, r1, and from the mirror on, s.
    power : (...) array [1/m]
        p, by which the mirror raises the curvature of the waves: positive for a convex mirror, zero for a flat one.
    spot_radius, focus_distance, wavelength : float [m]
        As of `beam_radius`.

    Returns
    -------
    width : (...) array [m]
        Radius of the beam at the end of the way.
    lever : (...) array [m]
        Distance by which the axis of the beam moves there for each radian.
    """
    before, rest, power = (np.asarray(value, dtype=float) for value in (before, rest, power))
    rayleigh = np.pi * spot_radius**2 / wavelength
    inverse = 1.0 / (before - focus_distance + 1j * rayleigh) + power
    inverse = inverse / (1.0 + rest * inverse)
    return np.sqrt(-wavelength / (np.pi * inverse.imag)), before + rest + before * rest * power
