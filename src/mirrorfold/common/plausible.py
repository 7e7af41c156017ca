"""Whether the numbers of a measurement make sense together: units that were mistaken show in ratios of lengths.

No frequency and no length is wrong in itself: 300 Hz is right for a sonar, and 300 m for an array at short waves. But
an array that can image is neither a thousandth of a wavelength long nor a hundred wavelengths coarse, whatever the
waves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array
from mirrorfold.common.units import FARTHEST, KINDS

SHORTEST_ARRAY = 1e-3
"""Length in wavelengths below which an array, or the focus of a beam, tells no directions at all."""

LONG_ENOUGH = 0.2
"""Length in wavelengths that an array has at least once the unit of the frequencies is right."""

USUAL_PITCH = 0.5
"""Distance of neighbours in wavelengths; of several units, the one that comes nearest to it is meant."""

COARSE_PITCH = 20.0
"""Distance of neighbours in wavelengths from which on their unit is doubted: sparse arrays have less."""

FINE_PITCH = (0.05, 2.0)
"""Distances of neighbours in wavelengths that make sense once the unit is right."""

SLOWEST_LIGHT = 1e6
"""Waves faster than this [m/s] are electromagnetic: sound reaches 2e4 m/s in the hardest matter."""

LOWEST_RADIO_FREQUENCY = 1e6
"""No imaging radar works below this frequency [Hz]."""

SPEEDS_OF_SOUND = 300.0, 6500.0
"""From air to metal [m/s]."""

LOWEST_ULTRASOUND = 2e4
"""Of frequencies below this [Hz] one has to say that they are sound."""

HIGHEST = {True: 2e13, False: 2e10}
"""Highest frequencies [Hz] of electromagnetic waves that are measured with their phase, and of sound."""

HIGHEST_OF_ALL = {True: 1e16, False: 1e12}
"""The phase of no light, and of no sound, is measured above this frequency [Hz]."""

FINEST_APERTURE = 2.0
"""Aperture [m] that beams would need whose steps are so fine; no scanner's is as wide."""

WIDEST_APERTURE = 500.0
"""The same in wavelengths."""


def unplaced(values: NDArray) -> str | None:
    """What is wrong with coordinates [m]; None where nothing is.

    Examples
    --------
    >>> unplaced(np.array([0.5, np.nan])), unplaced(np.array([1e308])), unplaced(np.array([1j]))
    ('is not finite', 'is farther away than 1e+07 m', 'is no real number')
    """
    if values.dtype.kind not in "fiu":
        return "is no real number"
    if not np.isfinite(values).all():
        return "is not finite"
    return f"is farther away than {FARTHEST:g} m" if np.abs(values).max(initial=0) > FARTHEST else None


def pitch(places: NDArray) -> float:
    """Median distance of neighbours among places (n, 3), in their unit; zero for a single place."""
    from scipy.spatial import cKDTree

    distinct = np.unique(np.asarray(places, dtype=float), axis=0)
    if len(distinct) < 2:
        return 0.0
    return float(np.median(cKDTree(distinct).query(distinct, k=2)[0][:, 1]))


def extent(*places: NDArray) -> float:
    """Diagonal of the box around all places, in their unit."""
    return float(np.linalg.norm(np.ptp(np.concatenate(places), axis=0)))


def frequency_unit(highest: float, length: float, step: float, speed: float) -> str | None:
    """The unit that the frequencies are probably in, if they make no sense in hertz.

    Parameters
    ----------
    highest : float
        Highest frequency as it stands.
    length : float [m]
        Of the array, or the width of the beam; zero where it is not known.
    step : float [m]
        Distance of neighbouring antennas; zero for one.
    speed : float [m/s]
        Of the waves.

    Returns
    -------
    str or None
        Such as "GHz"; None where hertz make sense, or no unit does.

    Examples
    --------
    >>> frequency_unit(300.0, length=0.08, step=0.5e-3, speed=299792458.0)
    'GHz'
    >>> frequency_unit(5e6, length=0.04, step=0.6e-3, speed=6300.0), frequency_unit(100.0, 15.0, 7.0, 1500.0)
    (None, None)
    """
    light = speed > SLOWEST_LIGHT
    in_wavelengths = length * highest / speed
    if in_wavelengths >= SHORTEST_ARRAY or (length == 0.0 and not (light and highest < LOWEST_RADIO_FREQUENCY)):
        return None
    misfit = {}
    for unit, factor in KINDS["frequency"].items():
        fits = length == 0.0 or in_wavelengths * factor >= LONG_ENOUGH
        if factor > 1.0 and highest * factor <= HIGHEST[light] and fits:
            wanted = USUAL_PITCH / max((step or length) * highest / speed, 1e-300)
            misfit[unit] = abs(np.log(factor / wanted)) if length else -factor
    return min(misfit, key=misfit.__getitem__) if misfit else None


def senseless(highest: float, length: float, speed: float) -> str | None:
    """Why no array so long can have measured waves of such frequencies, in words; None where one can.

    Parameters
    ----------
    highest : float [Hz]
    length : float [m]
        Of the array, or the width of the beam; zero where it is not known.
    speed : float [m/s]

    Examples
    --------
    >>> senseless(126e9, length=2.4e-8, speed=299792458.0)
    'an array of 2.4e-08 m is 1e-05 wavelengths long at 1.26e+11 Hz'
    >>> senseless(126e9, length=0.024, speed=299792458.0)
    """
    limit = HIGHEST_OF_ALL[speed > SLOWEST_LIGHT]
    if highest > limit:
        return f"frequencies reach {highest:.3g} Hz, and no phase is measured above {limit:g} Hz"
    in_wavelengths = length * highest / speed
    if 0.0 < in_wavelengths < SHORTEST_ARRAY:
        return f"an array of {length:.3g} m is {in_wavelengths:.1g} wavelengths long at {highest:.3g} Hz"
    return None


def may_be_sound(highest: float, length: float, step: float) -> bool:
    """Whether an array makes sense for ultrasound, in air or in the hardest matter: nobody may have said the speed.

    Examples
    --------
    >>> may_be_sound(9e6, length=0.019, step=0.3e-3), may_be_sound(300.0, length=0.08, step=0.5e-3)
    (True, False)
    """
    slowest, fastest = SPEEDS_OF_SOUND
    fits = length * highest / slowest >= LONG_ENOUGH and step * highest / fastest <= FINE_PITCH[1]
    return highest >= LOWEST_ULTRASOUND and fits


def length_unit(step: float, wavelength: float) -> str | None:
    """The unit that positions are probably in, whose neighbours stand `step` apart, if metres make no sense.

    Examples
    --------
    >>> length_unit(0.5, wavelength=1e-3), length_unit(0.05, wavelength=1e-3), length_unit(0.5e-3, wavelength=1e-3)
    ('mm', 'cm', None)
    """
    if step < COARSE_PITCH * wavelength:
        return None
    units = {unit: KINDS["length"][unit] * step / wavelength for unit in ("mm", "cm", "um", "inch")}
    fitting = {unit: abs(np.log(ratio / USUAL_PITCH)) for unit, ratio in units.items() if _fine(ratio)}
    return min(fitting, key=fitting.__getitem__) if fitting else None


def _fine(ratio: float) -> bool:
    return FINE_PITCH[0] <= ratio <= FINE_PITCH[1]


def radians_for_degrees(azimuth: Array, elevation: Array, wavelength: float) -> bool:
    """Whether directions of beams [degree] are probably in radians.

    The whole scan then seems to cover less than pi / 2 degrees, in steps that only a very wide aperture could tell
    apart, ``wavelength / step``.

    Examples
    --------
    >>> row = np.linspace(-0.5, 0.5, 41)
    >>> radians_for_degrees(row, row, 1e-3), radians_for_degrees(np.degrees(row), np.degrees(row), 1e-3)
    (True, False)
    """
    steps = [np.diff(row).mean() for row in (azimuth, elevation) if row.size > 1]
    reach = max(float(np.abs(row).max()) for row in (azimuth, elevation))
    if not steps or reach > 0.5 * np.pi:
        return False
    aperture = wavelength / np.radians(max(steps))
    return bool(aperture > FINEST_APERTURE or aperture > WIDEST_APERTURE * wavelength)


def any_of(values: NDArray) -> bool:
    """Whether any of the values is not zero; the first along the first axis, which mostly tell, are looked at first."""
    return bool(values[:1].any() or values.any())


def one_part(s: NDArray[np.complexfloating]) -> str | None:
    """What complex samples (frequency first) are, of which one part is zero throughout; None for true ones.

    Samples that do not change with frequency may well be real: what is at range zero is.

    Examples
    --------
    >>> one_part(np.array([1 + 0j, 2, 3])), one_part(np.array([1 + 0j, -2, 3])), one_part(np.array([1j, 2, 3]))
    ('magnitudes', 'real parts', None)
    """
    if s.shape[0] < 2:
        return None
    for name, part, other in (("real parts", s.real, s.imag), ("imaginary parts", s.imag, s.real)):
        if not any_of(other) and (part != part[:1]).any():
            return "magnitudes" if not (part < 0).any() else name
    return None
