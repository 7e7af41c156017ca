"""Reflection and transmission of plane waves at a dielectric half-space and at a slab: Fresnel and Airy formulas.

Time convention ``exp(+jwt)``, permittivity ``eps' - j eps''``. TE has E perpendicular to the plane of incidence, in a
floor plan along the vertical axis. TM has E in that plane; its coefficients are those of H, along the same axis, so
that at normal incidence TM is reflected with minus the coefficient of TE. With the angle of incidence t and ``q =
sqrt(eps - sin^2 t)``,

    TE: r = (cos t - q) / (cos t + q),        TM: r = (eps cos t - q) / (eps cos t + q).

In a slab of thickness d, the waves that run to and fro add up. With ``p = exp(-j k d q)`` for one way through it,

    R = r (1 - p^2) / (1 - r^2 p^2),          T = (1 - r^2) p / (1 - r^2 p^2)

(Born and Wolf, Principles of Optics, 7th ed., sections 1.5.2 and 1.6.4). R is taken at the front face. T is relative to
the wave that would go straight on without the slab, so that a slab of air has T = 1.

At rough faces with the rms height h, every reflection or passage multiplies the coherent wave by
``exp(-(D k h)^2 / 2)``. D is the change of the wavenumber square to the face, over k: ``2 cos t`` for reflection
outside, ``2 q`` for reflection inside, ``q - cos t`` for passage (Pinel, Bourlier and Saillard, Prog. Electromagn. Res.
B 19, 41, 2010).
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mirrorfold.common.types import Array

Polarization = Literal["TE", "TM"]
POLARIZATIONS: tuple[Polarization, ...] = get_args(Polarization)

Coefficient = NDArray[np.complex128]


def inside(permittivity: ArrayLike, angle: ArrayLike) -> Coefficient:
    """``q = sqrt(eps - sin^2 t)``: wavenumber in the slab square to its faces over that of free space, t in [rad]."""
    return np.sqrt(np.asarray(permittivity, dtype=complex) - np.sin(angle) ** 2)


def fresnel(permittivity: ArrayLike, angle: ArrayLike, polarization: Polarization = "TE") -> Coefficient:
    """Reflection coefficient r of a half-space.

    Parameters
    ----------
    permittivity : (...) complex array
        Relative permittivity, ``eps' - j eps''``.
    angle : (...) array [rad]
        Angle of incidence, from the normal.
    polarization : {"TE", "TM"}

    Returns
    -------
    (...) complex array, broadcast from both.
    """
    cosine, within = np.cos(angle), inside(permittivity, angle)
    outside = cosine if polarization == "TE" else np.asarray(permittivity, dtype=complex) * cosine
    return (outside - within) / (outside + within)


def slab(
    permittivity: ArrayLike,
    thickness: ArrayLike,
    wavenumber: ArrayLike,
    angle: ArrayLike,
    polarization: Polarization = "TE",
    *,
    rms_height: ArrayLike = 0.0,
) -> tuple[Coefficient, Coefficient]:
    """Reflection R at the front face of a slab, and transmission T relative to no slab.

    Parameters
    ----------
    permittivity : (...) complex array
    thickness : (...) array [m]
    wavenumber : (...) array [rad/m]
        In free space.
    angle : (...) array [rad]
    polarization : {"TE", "TM"}
    rms_height : (...) array [m]
        Roughness of both faces; smooth by default.

    Returns
    -------
    R, T : (...) complex arrays, broadcast from all.
    """
    r, q, cosine = fresnel(permittivity, angle, polarization), inside(permittivity, angle), np.cos(angle)
    k, turn = np.asarray(wavenumber), np.asarray(wavenumber) * thickness
    way, straight = _wave(-turn * q), _wave(turn * cosine)
    if not np.any(rms_height):
        return _coefficients(r, way, straight)
    height = (k * rms_height) ** 2
    front, within = np.exp(-2.0 * height * cosine**2), np.exp(-2.0 * height * q.real**2)
    return _coefficients(r, way, straight, front, within, np.exp(-height * (q.real - cosine) ** 2))


def _wave(phase: ArrayLike) -> Coefficient:
    """``exp(j phase)`` by real functions, twice as fast as the complex one; a damped wave has a complex phase."""
    phase = np.asarray(phase)
    found = np.empty(phase.shape, dtype=complex)
    found.real, found.imag = np.cos(phase.real), np.sin(phase.real)
    return found * np.exp(-phase.imag) if np.iscomplexobj(phase) else found


def _coefficients(
    r: Coefficient,
    way: Coefficient,
    straight: Coefficient,
    front: Array | float = 1.0,
    within: Array | float = 1.0,
    entry: Array | float = 1.0,
) -> tuple[Coefficient, Coefficient]:
    """R and T of a slab from the reflection coefficient r of its front face.

    `way` is the propagation once through the slab, and `straight` undoes that along the same way without the slab.
    `front`, `within` and `entry` are the losses of coherence at rough faces: of a reflection outside, of a reflection
    inside, and of a passage.
    """
    once = r * within * way
    passed = (1.0 - r**2) * entry * way * (1.0 / (1.0 - once**2))
    return r * front - passed * once, passed * straight
