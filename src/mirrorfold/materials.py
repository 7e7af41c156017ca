"""What surfaces are made of: how much of a wave they send back, specularly and diffusely."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.constants import speed_of_light

from mirrorfold.errors import InputError


class Material(Protocol):
    """Anything with a reflection coefficient. A new material is a new class with this one method."""

    def reflection(self, frequency: ArrayLike, incidence_angle: ArrayLike) -> NDArray[np.complex128]:
        """Amplitude reflection coefficient of the smooth half-space, E parallel to the surface (TE).

        Parameters
        ----------
        frequency : (...) array [Hz]
        incidence_angle : (...) array [rad]
            From the normal.

        Returns
        -------
        (...) complex array, broadcast from both.
        """
        ...


@dataclass(frozen=True)
class PerfectConductor:
    """A metal without losses: the tangential electric field vanishes on it, so it reflects with -1."""

    def reflection(self, frequency: ArrayLike, incidence_angle: ArrayLike) -> NDArray[np.complex128]:
        """-1 at every frequency and angle."""
        return np.full(np.broadcast_shapes(np.shape(frequency), np.shape(incidence_angle)), -1.0 + 0.0j)


_BY_NAME: dict[str, Material] = {"pec": PerfectConductor()}


def names() -> tuple[str, ...]:
    """The names that a scene file may give as `material`."""
    return tuple(sorted(_BY_NAME))


def material(name: str) -> Material:
    """The material of that name.

    Raises
    ------
    InputError
        If there is none.
    """
    try:
        return _BY_NAME[name]
    except KeyError:
        raise InputError(f"material {name!r} is not known; choose one of: {', '.join(names())}") from None


def coherent_factor(rms_height: float, frequency: ArrayLike, incidence_angle: ArrayLike) -> NDArray[np.float64]:
    """What roughness leaves of the specular amplitude.

    ``exp(-(4 pi h cos(theta) / lambda)^2 / 2)`` for Gaussian heights of rms `h`
    (Ament, Proc. IRE 41, 1953; Beckmann and Spizzichino, 1963, section 5.3).

    Parameters
    ----------
    rms_height : float [m]
    frequency : (...) array [Hz]
    incidence_angle : (...) array [rad]
        From the normal.

    Returns
    -------
    (...) array, between 0 and 1.
    """
    wavenumber = 2.0 * np.pi * np.asarray(frequency, dtype=float) / speed_of_light
    phase_spread = 2.0 * wavenumber * rms_height * np.cos(np.asarray(incidence_angle, dtype=float))
    return np.exp(-0.5 * phase_spread**2)
