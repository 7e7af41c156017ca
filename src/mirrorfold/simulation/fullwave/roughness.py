"""Random profiles of rough surfaces: Gaussian heights with the Gaussian autocovariance ``h^2 exp(-d^2 / L^2)``."""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes.surfaces import Roughness

CELLS = 8
"""Least number of knots per correlation length: the spectrum ``exp(-(q L / 2)^2)`` at their band limit is then below
1e-60, and the error of a cubic spline through the knots below 1e-4 of the rms height."""

SHORTEST = 50.0
"""Least length of a rough surface in correlation lengths: it then has 40 independent heights, and the rms height of a
single profile deviates from the given one by 11 % (standard deviation)."""


def rough_heights(
    length: float,
    roughness: Roughness,
    *,
    generator: np.random.Generator,
    periodic: bool = False,
    label: str = "surface",
) -> tuple[Array, Array]:
    """A random profile, by filtering white noise in the spectral domain (Thorsos, J. Acoust. Soc. Am. 83, 1988).

    Parameters
    ----------
    length : float [m]
    roughness : Roughness
    generator : numpy.random.Generator
    periodic : bool
        True for a closed surface: the last height equals the first one.
    label : str
        Name of the surface in messages.

    Returns
    -------
    distance : (n,) array [m]
        From 0 to `length`.
    height : (n,) array [m]
        Heights of a stationary process: their rms over many profiles is `rms_height`; that of a single one deviates.

    Raises
    ------
    InputError
        If the surface is too short for the statistics.
    """
    correlation = roughness.correlation_length
    if length < SHORTEST * correlation:
        raise InputError(
            f"{label}: a piece of it is {length:g} m long, only {length / correlation:.1f} correlation lengths of "
            f"{correlation:g} m; roughness needs at least {SHORTEST:.0f} for its statistics, make the piece longer, "
            "choose a shorter correlation length or leave out roughness"
        )
    cells = int(np.ceil(CELLS * length / correlation))
    step = length / cells
    # Filtering by FFT is periodic: six correlation lengths of padding make the two ends of an open profile independent.
    count = cells if periodic else cells + int(np.ceil(6.0 * correlation / step))
    q = 2.0 * np.pi * np.fft.rfftfreq(count, step)
    # Each spectral line of white noise of variance one has the power `count`; the covariance is the transform of that.
    density = np.sqrt(np.pi) * correlation * np.exp(-((0.5 * q * correlation) ** 2)) / step
    noise = np.fft.rfft(generator.standard_normal(count))
    height = roughness.rms_height * np.fft.irfft(noise * np.sqrt(density), count)
    height = np.append(height[:cells], height[0] if periodic else height[cells])
    return np.linspace(0.0, length, cells + 1), height
