"""What surfaces are made of: how much of a wave they send back, specularly and diffusely."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field
from pydantic.dataclasses import dataclass as checked
from scipy.constants import epsilon_0, speed_of_light

from mirrorfold.common.slabs import Polarization, fresnel
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes.arrays import STRICT, NonNegative


class Material(Protocol):
    """Anything with a reflection coefficient. A new material is a new class with this one method."""

    def reflection(
        self, frequency: ArrayLike, incidence_angle: ArrayLike, polarization: Polarization = "TE"
    ) -> NDArray[np.complex128]:
        """Amplitude reflection coefficient of the smooth half-space.

        Parameters
        ----------
        frequency : (...) array [Hz]
        incidence_angle : (...) array [rad]
            From the normal.
        polarization : {"TE", "TM"}
            Of E, parallel to the surface, or of H, see `mirrorfold.common.slabs`.

        Returns
        -------
        (...) complex array, broadcast from both.
        """
        ...


@dataclass(frozen=True)
class PerfectConductor:
    """A metal without losses: the tangential electric field vanishes on it, so it reflects E with -1, H with +1."""

    def reflection(
        self, frequency: ArrayLike, incidence_angle: ArrayLike, polarization: Polarization = "TE"
    ) -> NDArray[np.complex128]:
        """The same at every frequency and angle."""
        value = 1.0 + 0.0j if polarization == "TM" else -1.0 + 0.0j
        return np.full(np.broadcast_shapes(np.shape(frequency), np.shape(incidence_angle)), value)


@dataclass(frozen=True)
class Dielectric:
    """A lossy half-space, ``eps_r = a f^b`` and ``sigma = c f^d`` with f in GHz (Recommendation ITU-R P.2040).

    Attributes
    ----------
    a, b : float
        Of the relative permittivity.
    c, d : float
        Of the conductivity [S/m].
    """

    a: float
    b: float
    c: float
    d: float

    def permittivity(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Complex relative permittivity ``eps_r - j sigma / (2 pi f eps_0)`` for ``exp(+jwt)``; frequency in Hz."""
        frequency = np.asarray(frequency, dtype=float)
        conductivity = self.c * (frequency / 1e9) ** self.d
        permittivity = self.a * (frequency / 1e9) ** self.b
        return np.asarray(permittivity - 1j * conductivity / (2.0 * np.pi * frequency * epsilon_0))

    def reflection(
        self, frequency: ArrayLike, incidence_angle: ArrayLike, polarization: Polarization = "TE"
    ) -> NDArray[np.complex128]:
        """Fresnel's coefficient, see `mirrorfold.common.slabs.fresnel`."""
        return fresnel(self.permittivity(frequency), np.asarray(incidence_angle, dtype=float), polarization)


_BY_NAME: dict[str, Material] = {
    "pec": PerfectConductor(),
    "concrete": Dielectric(5.17, 0.0, 0.0145, 1.09),
    "plasterboard": Dielectric(2.56, 0.0, 0.0001, 1.7799),
    "glass": Dielectric(5.79, 0.0, 0.0004, 1.658),
    "wood": Dielectric(1.82, 0.0, 0.004, 1.0761),
    "marble": Dielectric(7.94, 0.0, 0.0001, 1.733),
}
"""Recommendation ITU-R P.2040-4, the fits that reach 300 GHz."""


def names() -> tuple[str, ...]:
    """The names that a scene file may give as `material`."""
    return tuple(sorted(_BY_NAME))


@checked(frozen=True, config=STRICT, kw_only=True)
class Substance:
    """A dielectric without a name.

    Attributes
    ----------
    permittivity : float
        Relative.
    conductivity : float [S/m]
    """

    permittivity: Annotated[float, Field(ge=1, allow_inf_nan=False)]
    conductivity: NonNegative = 0.0

    def __str__(self) -> str:
        return f"permittivity {self.permittivity:g}, {self.conductivity:g} S/m"


FITTED = 1e9, 450e9
"""Frequencies [Hz] between which the recommendation's fits are stated, of one material or another."""

ADVICE = (
    f"its fit holds from {FITTED[0] / 1e9:g} to {FITTED[1] / 1e9:g}; state it, "
    "{permittivity = ..., conductivity = ...}"
)
"""Beyond these frequencies."""


def permittivity(name: str | Substance, frequency: ArrayLike) -> NDArray[np.complex128]:
    """Complex relative permittivity of a material at frequencies [Hz].

    Raises
    ------
    InputError
        If it has none: a conductor, or a named material far from the frequencies that it was measured at.
    """
    made_of = material(name)
    if not isinstance(made_of, Dielectric):
        raise InputError(f"material {name!r} has no permittivity, as no wave enters it; choose a dielectric")
    if not is_fitted(name, frequency):
        raise InputError(f"material {name!r} has no permittivity at {np.max(frequency) / 1e9:g} GHz, {ADVICE}")
    return made_of.permittivity(frequency)


def is_fitted(name: str | Substance, frequency: ArrayLike) -> bool:
    """Whether it is known what a material is at frequencies [Hz]: metals and what is stated are so everywhere."""
    if not isinstance(name, str) or not isinstance(material(name), Dielectric):
        return True
    return bool(np.max(frequency) <= FITTED[1] and np.min(frequency) >= FITTED[0])


def warn_if_extrapolated(name: str | Substance, frequency: ArrayLike) -> None:
    """Tell of an opaque material that was not measured anywhere near these frequencies [Hz]."""
    if not is_fitted(name, frequency):
        warnings.warn(f"material {name!r} is extrapolated to {np.max(frequency) / 1e9:g} GHz, {ADVICE}", stacklevel=2)


def material(name: str | Substance) -> Material:
    """The material of that name, or of that permittivity.

    Raises
    ------
    InputError
        If there is none.
    """
    if isinstance(name, Substance):
        return Dielectric(name.permittivity, 0.0, name.conductivity, 0.0)
    try:
        return _BY_NAME[name]
    except KeyError:
        raise InputError(f"material {name!r} is not known; choose one of: {', '.join(names())}") from None


def check_passable(name: str | Substance, thickness: float | None, volume_depth: float) -> None:
    """Refuse a `thickness` [m] of a wall that lets nothing through, or is not homogeneous.

    Raises
    ------
    ValueError
        With what to do.
    """
    if thickness is None:
        return
    if not isinstance(material(name), Dielectric):
        raise ValueError(
            f"thickness is given, but material {name!r} has no permittivity and lets nothing through; "
            "choose a dielectric such as 'glass', or leave out the thickness"
        )
    if volume_depth:
        raise ValueError("thickness and volume_depth are both given; a wall that waves pass through is homogeneous")


VolumeProfile = Literal["exponential", "uniform", "layers"]
"""How the scattering inside a wall is spread over its depth d. Exponential: the power falls as ``exp(-2 z / d)`` and
ends at d, with the mean depth 0.34 d. Uniform: the same at all depths, mean 0.5 d. Layers, as in a board between two
papers: two thirds of the power from the first tenth of d and one third from the last, mean 0.35 d."""

SHEET, FRONT_SHARE = 0.1, 2.0 / 3.0
"""Thickness of each of the two layers, as a share of the depth, and share of the power that the front one scatters."""


def scattering_depth(profile: VolumeProfile, depth: float, uniform: Array) -> Array:
    """Depths of random scatterers inside a wall, each of which stands for the same power.

    Parameters
    ----------
    profile : {"exponential", "uniform", "layers"}
    depth : float [m]
        Down to which the wall scatters.
    uniform : (n,) array
        Random numbers between 0 and 1: the share of the power that scatters from above the depth returned.

    Returns
    -------
    (n,) array [m]
    """
    if profile == "exponential":
        return np.asarray(-0.5 * depth * np.log1p(-uniform * (1.0 - np.exp(-2.0))))
    if profile == "layers":
        edges = [0.0, SHEET, 1.0 - SHEET, 1.0]
        return depth * np.interp(uniform, [0.0, FRONT_SHARE, np.nextafter(FRONT_SHARE, 1.0), 1.0], edges)
    return depth * uniform


LONG_CORRELATION = 100.0
"""Correlation length times wavenumber from which a surface scatters so close to the specular direction that Ament's
formula holds to 1e-3."""


def coherent_factor(
    rms_height: float,
    frequency: ArrayLike,
    incidence_angle: ArrayLike,
    *,
    correlation_length: float | None = None,
) -> NDArray[np.float64]:
    """What roughness leaves of the specular amplitude.

    ``exp(-(4 pi h / lambda)^2 cos(theta) G / 2)`` for Gaussian heights of rms `h`. Where the heights vary slowly,
    ``G = cos(theta)`` (Ament, Proc. IRE 41, 1953; Beckmann and Spizzichino, 1963, section 5.3). Otherwise G is the
    mean normal component of the directions into which the spectrum of the heights scatters, ``G = E[Re sqrt(1 -
    (sin(theta) + x)^2)]`` with x normal of standard deviation ``sqrt(2) / (k L)``: fine structure scatters partly into
    evanescent waves, which carry no power (Rice, Comm. Pure Appl. Math. 4, 1951, to first order for E parallel to a
    conductor, continued by the exponential). At L = 0.2 lambda this halves the loss in dB.

    Parameters
    ----------
    rms_height : float [m]
    frequency : (...) array [Hz]
    incidence_angle : (...) array [rad]
        From the normal.
    correlation_length : float [m], optional
        The L of the autocovariance ``h^2 exp(-d^2 / L^2)``; by default long against the wavelength.

    Returns
    -------
    (...) array, between 0 and 1.
    """
    wavenumber = 2.0 * np.pi * np.asarray(frequency, dtype=float) / speed_of_light
    angle = np.asarray(incidence_angle, dtype=float)
    scattered_cosine = np.cos(angle)
    if correlation_length is not None:
        scattered_cosine = _mean_scattered_cosine(wavenumber * correlation_length, angle)
    return np.asarray(np.exp(-0.5 * (2.0 * wavenumber * rms_height) ** 2 * np.cos(angle) * scattered_cosine))


def _mean_scattered_cosine(k_correlation: ArrayLike, angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """``E[Re sqrt(1 - (sin(angle) + x)^2)]`` for x normal of standard deviation ``sqrt(2) / k_correlation``."""
    k_correlation, angle = np.broadcast_arrays(k_correlation, angle)
    mean = np.array(np.cos(angle))
    for value in np.unique(k_correlation):
        if value < LONG_CORRELATION:
            here = k_correlation == value
            mean[here] = np.interp(np.abs(angle[here]), *_scattered_cosines(float(value)))
    return mean


@lru_cache(64)
def _scattered_cosines(k_correlation: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angles of incidence from 0 to 90 degrees [rad], and the mean cosine of the scattered waves at each."""
    # The midpoint rule over the scattering angle is spectrally accurate: the integrand is even about its ends.
    scattered = (np.arange(400) + 0.5) / 400 * np.pi - 0.5 * np.pi
    grid = np.linspace(0.0, 0.5 * np.pi, 257)
    offset = np.sin(scattered) - np.sin(grid)[:, None]
    density = k_correlation / (2.0 * np.sqrt(np.pi)) * np.exp(-((0.5 * k_correlation * offset) ** 2))
    return grid, density @ np.cos(scattered) ** 2 * np.pi / 400
