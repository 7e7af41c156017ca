"""Materials of surfaces: their permittivity and reflection coefficient, the coherent factor of rough ones, and the
depths at which walls scatter inside.
"""

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
from mirrorfold.scenes.arrays import STRICT, NonNegative, Number


class Material(Protocol):
    """Anything with a reflection coefficient. A new kind of material is a new class with this one method."""

    def reflection(
        self, frequency: ArrayLike, incidence_angle: ArrayLike, polarization: Polarization = "TE"
    ) -> NDArray[np.complex128]:
        """Amplitude reflection coefficient of a smooth half-space of the material.

        Parameters
        ----------
        frequency : (...) array [Hz]
        incidence_angle : (...) array [rad]
            From the normal.
        polarization : {"TE", "TM"}
            E ("TE") or H ("TM") parallel to the surface; the coefficient is that of this field, see
            `mirrorfold.common.slabs`.

        Returns
        -------
        (...) complex array, broadcast from frequency and angle.
        """
        ...


@dataclass(frozen=True)
class PerfectConductor:
    """A metal without losses: the tangential E vanishes on it, so that it reflects E with -1 and H with +1."""

    def reflection(
        self, frequency: ArrayLike, incidence_angle: ArrayLike, polarization: Polarization = "TE"
    ) -> NDArray[np.complex128]:
        """Reflection coefficient, the same at every frequency and angle: -1 for TE, +1 for TM."""
        value = 1.0 + 0.0j if polarization == "TM" else -1.0 + 0.0j
        return np.full(np.broadcast_shapes(np.shape(frequency), np.shape(incidence_angle)), value)


@dataclass(frozen=True)
class Dielectric:
    """A lossy half-space, ``eps_r = a f^b`` and ``sigma = c f^d`` with f in GHz (Recommendation ITU-R P.2040).

    Attributes
    ----------
    a, b : float
        Factor and exponent of the relative permittivity.
    c, d : float
        Factor [S/m] and exponent of the conductivity.
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
"""Materials by name: those of Recommendation ITU-R P.2040-4 whose fits reach 300 GHz, and a perfect conductor."""


def names() -> tuple[str, ...]:
    """The names that a scene file may give as `material`."""
    return tuple(sorted(_BY_NAME))


@checked(frozen=True, config=STRICT, kw_only=True)
class Substance:
    """A dielectric given by its permittivity and conductivity, the same at all frequencies, instead of a name.

    Attributes
    ----------
    permittivity : float
        Relative permittivity.
    conductivity : float [S/m]
    """

    permittivity: Annotated[Number, Field(ge=1, allow_inf_nan=False)]
    conductivity: NonNegative = 0.0

    def __str__(self) -> str:
        return f"permittivity {self.permittivity:g}, {self.conductivity:g} S/m"


FITTED = 1e9, 450e9
"""Lowest and highest frequency [Hz] for which the recommendation states the fit of any of its materials."""

ADVICE = (
    f"its fit holds from {FITTED[0] / 1e9:g} to {FITTED[1] / 1e9:g} GHz; state it, "
    "{permittivity = ..., conductivity = ...}"
)
"""Part of messages about frequencies outside this range."""


def permittivity(name: str | Substance, frequency: ArrayLike) -> NDArray[np.complex128]:
    """Complex relative permittivity of a material at frequencies [Hz].

    Raises
    ------
    InputError
        If it has none: a conductor, or a named material outside the frequencies `FITTED`.
    """
    made_of = material(name)
    if not isinstance(made_of, Dielectric):
        raise InputError(f"material {name!r} has no permittivity, as no wave enters it; choose a dielectric")
    if not is_fitted(name, frequency):
        raise InputError(f"material {name!r} has no permittivity at {_unfitted(frequency):g} GHz, {ADVICE}")
    return made_of.permittivity(frequency)


def is_fitted(name: str | Substance, frequency: ArrayLike) -> bool:
    """Whether the properties of a material are known at frequencies [Hz].

    Metals, and materials of stated permittivity, are known at all frequencies; named dielectrics within `FITTED`.
    """
    if not isinstance(name, str) or not isinstance(material(name), Dielectric):
        return True
    return bool(np.max(frequency) <= FITTED[1] and np.min(frequency) >= FITTED[0])


def _unfitted(frequency: ArrayLike) -> float:
    """The frequency [GHz] that is outside of `FITTED`: the highest one, or else the lowest."""
    return 1e-9 * float(np.max(frequency) if np.max(frequency) > FITTED[1] else np.min(frequency))


def warn_if_extrapolated(name: str | Substance, frequency: ArrayLike) -> None:
    """Warn of an opaque material whose fit does not reach these frequencies [Hz]."""
    if not is_fitted(name, frequency):
        warnings.warn(f"material {name!r} is extrapolated to {_unfitted(frequency):g} GHz, {ADVICE}", stacklevel=2)


def material(name: str | Substance) -> Material:
    """The material of a name, or of a stated permittivity.

    Raises
    ------
    InputError
        If there is no material of that name.
    """
    if isinstance(name, Substance):
        return Dielectric(name.permittivity, 0.0, name.conductivity, 0.0)
    try:
        return _BY_NAME[name]
    except KeyError:
        raise InputError(f"material {name!r} is not known; choose one of: {', '.join(names())}") from None


def check_passable(name: str | Substance, thickness: float | None, volume_depth: float) -> None:
    """Refuse a `thickness` [m] of a wall whose material lets nothing through, or that scatters inside.

    Raises
    ------
    ValueError
        The message states the remedy.
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
"""How the power that the inside of a wall scatters is distributed over the depth z, from 0 to the `volume_depth` d.
Exponential: as ``exp(-2 z / d)``, with the mean depth 0.34 d. Uniform: equal at all depths, mean depth 0.5 d. Layers,
as in a board between two sheets of paper: two thirds from the first tenth of d, one third from the last tenth, mean
depth 0.35 d."""

SHEET, FRONT_SHARE = 0.1, 2.0 / 3.0
"""Profile "layers": thickness of each layer over the depth d, and share of the power that the front layer scatters."""


def scattering_depth(profile: VolumeProfile, depth: float, uniform: Array) -> Array:
    """Depths of random scatterers inside a wall, so that each scatterer represents the same power.

    Parameters
    ----------
    profile : {"exponential", "uniform", "layers"}
    depth : float [m]
        Depth down to which the wall scatters.
    uniform : (n,) array
        Random numbers, uniform between 0 and 1: share of the power that is scattered in front of the depth returned.

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
"""Correlation length times wavenumber above which Ament's formula is used: a surface then scatters so close to the
specular direction that the formula holds to 1e-3."""


def coherent_factor(
    rms_height: float,
    frequency: ArrayLike,
    incidence_angle: ArrayLike,
    *,
    correlation_length: float | None = None,
) -> NDArray[np.float64]:
    """The factor rho by which roughness reduces the specular amplitude.

    ``rho = exp(-(4 pi h / lambda)^2 cos(theta) G / 2)`` for Gaussian heights of rms `h` and the angle of incidence
    theta. If the heights vary slowly along the surface, ``G = cos(theta)`` (Ament, Proc. IRE 41, 1953; Beckmann and
    Spizzichino, 1963, section 5.3). Otherwise G is the mean cosine of the directions into which the spectrum of the
    heights scatters, ``G = E[Re sqrt(1 - (sin(theta) + x)^2)]``, with x normally distributed of standard deviation
    ``sqrt(2) / (k L)``. Fine structure scatters partly into evanescent waves, which carry no power (Rice, Comm. Pure
    Appl. Math. 4, 1951, to first order for E parallel to a conductor, continued by the exponential). At L = 0.2 lambda
    this halves the loss in dB.

    Parameters
    ----------
    rms_height : float [m]
    frequency : (...) array [Hz]
    incidence_angle : (...) array [rad]
        From the normal.
    correlation_length : float [m], optional
        L of the autocovariance ``h^2 exp(-d^2 / L^2)``; by default much longer than the wavelength.

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
    """G of `coherent_factor`: ``E[Re sqrt(1 - (sin(angle) + x)^2)]``, x of standard deviation ``sqrt(2) / (k L)``.

    `k_correlation` is ``k L``.
    """
    k_correlation, angle = np.broadcast_arrays(k_correlation, angle)
    mean = np.array(np.cos(angle))
    for value in np.unique(k_correlation):
        if value < LONG_CORRELATION:
            here = k_correlation == value
            mean[here] = np.interp(np.abs(angle[here]), *_scattered_cosines(float(value)))
    return mean


@lru_cache(1024)  # one entry of 4 kB for each frequency of a sweep
def _scattered_cosines(k_correlation: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angles of incidence from 0 to 90 degrees [rad], and the mean cosine G of the scattered waves at each of them."""
    # The midpoint rule over the scattering angle is spectrally accurate: the integrand is even about its ends.
    scattered = (np.arange(400) + 0.5) / 400 * np.pi - 0.5 * np.pi
    grid = np.linspace(0.0, 0.5 * np.pi, 257)
    offset = np.sin(scattered) - np.sin(grid)[:, None]
    density = k_correlation / (2.0 * np.sqrt(np.pi)) * np.exp(-((0.5 * k_correlation * offset) ** 2))
    return grid, density @ np.cos(scattered) ** 2 * np.pi / 400
