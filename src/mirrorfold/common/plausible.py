"""Whether the numbers of a measurement make sense together: wrong units show in ratios of lengths to the wavelength.

No frequency and no length is wrong by itself: 300 Hz is right for a sonar, and 300 m for an array at short waves. But
whatever the waves, an array that can image is longer than a thousandth of a wavelength, and its antennas stand closer
than a hundred wavelengths.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array
from mirrorfold.common.units import FARTHEST, KINDS

SHORTEST_ARRAY = 1e-3
"""Shortest length of an array, or of the focus of a beam, in wavelengths: below it, directions cannot be told at
all."""

LONG_ENOUGH = 0.2
"""Least length of an array in wavelengths when the unit of the frequencies is right."""

USUAL_PITCH = 0.5
"""Usual distance of neighbouring antennas in wavelengths: of several possible units, the one that comes closest to it
is the probable one."""

COARSE_PITCH = 20.0
"""Distance of neighbouring antennas in wavelengths from which on the unit of positions is doubted: even sparse arrays
have less."""

FINE_PITCH = (0.05, 2.0)
"""Least and largest distance of neighbouring antennas in wavelengths when the unit is right."""

SLOWEST_LIGHT = 1e6
"""Waves faster than this [m/s] are electromagnetic: sound reaches 2e4 m/s in the hardest matter."""

LOWEST_RADIO_FREQUENCY = 1e6
"""No imaging radar works below this frequency [Hz]."""

SPEEDS_OF_SOUND = 300.0, 6500.0
"""Lowest and highest speed of sound [m/s]: in air, and in metal."""

LOWEST_ULTRASOUND = 2e4
"""Lowest frequency [Hz] that is taken for ultrasound by itself; for lower ones, users have to say that it is sound."""

HIGHEST = {True: 2e13, False: 2e10}
"""Highest usual frequency [Hz] of waves whose phase is measured: electromagnetic (True), and sound (False)."""

HIGHEST_OF_ALL = {True: 1e16, False: 1e12}
"""Frequency [Hz] above which no phase is ever measured: of electromagnetic waves (True), and of sound (False)."""

FINEST_APERTURE = 2.0
"""Largest aperture [m] of a scanner. If the steps between beams are so fine that they would need a wider one, the unit
of the angles is wrong."""

WIDEST_APERTURE = 500.0
"""Largest aperture of a scanner in wavelengths, used likewise."""


REACH_IN_AMBIGUOUS_RANGES = 10.0
REACH_IN_WAVELENGTHS = 1e5
"""Largest plausible distance of what a radar sees: this many ambiguous ranges, or this many wavelengths at the top of
the band, whichever is longer. Anything farther away was given in a wrong unit, or is out of reach of the radar."""


def reach(ambiguous_range: float, wavelength: float) -> float:
    """Largest plausible distance [m] of what a radar sees; the wavelength [m] is the shortest."""
    return max(REACH_IN_AMBIGUOUS_RANGES * ambiguous_range, REACH_IN_WAVELENGTHS * wavelength)


def shorter_unit(distance: float, limit: float) -> str:
    """End of a sentence about a distance above a limit [m]: the unit that was probably meant.

    Examples
    --------
    >>> shorter_unit(900.0, 100.0), shorter_unit(1e9, 100.0)
    (', perhaps 900 mm were meant', '')
    """
    meant = [unit for unit in ("cm", "mm") if distance * KINDS["length"][unit] < limit]
    return f", perhaps {distance:.4g} {meant[-1]} were meant" if meant else ""


def unplaced(values: NDArray) -> str | None:
    """What is wrong with coordinates [m], in words; None if nothing is.

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
    """Median distance of places (n, 3) from their nearest neighbours, in their unit; zero for a single place."""
    from scipy.spatial import cKDTree

    distinct = np.unique(np.asarray(places, dtype=float), axis=0)
    if len(distinct) < 2:
        return 0.0
    return float(np.median(cKDTree(distinct).query(distinct, k=2)[0][:, 1]))


def extent(*places: NDArray) -> float:
    """Diagonal of the box around all places, in the unit of the places."""
    return float(np.linalg.norm(np.ptp(np.concatenate(places), axis=0)))


def frequency_unit(highest: float, length: float, step: float, speed: float) -> str | None:
    """The unit in which the frequencies probably are, if they make no sense in hertz.

    Parameters
    ----------
    highest : float
        Highest frequency, as the file gives it.
    length : float [m]
        Length of the array, or width of the beam; zero if it is not known.
    step : float [m]
        Distance of neighbouring antennas; zero for a single antenna.
    speed : float [m/s]
        Speed of the waves.

    Returns
    -------
    str or None
        The unit, such as "GHz"; None if hertz make sense, or no unit does.

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


def implausible_array(highest: float, length: float, speed: float) -> str | None:
    """Why an array of this length cannot have measured waves of these frequencies, in words; None if it can.

    Parameters
    ----------
    highest : float [Hz]
    length : float [m]
        Length of the array, or width of the beam; zero if it is not known.
    speed : float [m/s]

    Examples
    --------
    >>> implausible_array(126e9, length=2.4e-8, speed=299792458.0)
    'an array of 2.4e-08 m is 1e-05 wavelengths long at 1.26e+11 Hz'
    >>> implausible_array(126e9, length=0.024, speed=299792458.0)
    """
    limit = HIGHEST_OF_ALL[speed > SLOWEST_LIGHT]
    if highest > limit:
        return f"frequencies reach {highest:.3g} Hz, and no phase is measured above {limit:g} Hz"
    in_wavelengths = length * highest / speed
    if 0.0 < in_wavelengths < SHORTEST_ARRAY:
        return f"an array of {length:.3g} m is {in_wavelengths:.1g} wavelengths long at {highest:.3g} Hz"
    return None


def may_be_sound(highest: float, length: float, step: float) -> bool:
    """Whether an array makes sense for ultrasound, in air or in metal: the user may not have said the speed.

    Examples
    --------
    >>> may_be_sound(9e6, length=0.019, step=0.3e-3), may_be_sound(300.0, length=0.08, step=0.5e-3)
    (True, False)
    """
    slowest, fastest = SPEEDS_OF_SOUND
    fits = length * highest / slowest >= LONG_ENOUGH and step * highest / fastest <= FINE_PITCH[1]
    return highest >= LOWEST_ULTRASOUND and fits


def length_unit(step: float, wavelength: float) -> str | None:
    """The unit in which positions probably are, if neighbours `step` apart make no sense in metres.

    Examples
    --------
    >>> length_unit(0.5, wavelength=1e-3), length_unit(0.05, wavelength=1e-3), length_unit(0.5e-3, wavelength=1e-3)
    ('mm', 'cm', None)
    >>> length_unit(8.0, wavelength=1e-3)  # the few transmitters of a MIMO radar
    'mm'
    """
    if step < COARSE_PITCH * wavelength:
        return None
    units = {unit: KINDS["length"][unit] * step / wavelength for unit in ("mm", "cm", "um", "inch")}
    fitting = {
        unit: abs(np.log(ratio / USUAL_PITCH)) for unit, ratio in units.items() if FINE_PITCH[0] <= ratio < COARSE_PITCH
    }
    return min(fitting, key=fitting.__getitem__) if fitting else None


def radians_for_degrees(azimuth: Array, elevation: Array, wavelength: float) -> str | None:
    """A sentence where directions of beams that should be in degrees are probably in radians; None elsewhere.

    The whole scan then seems to reach at most pi / 2 degrees aside, in steps that only a very wide aperture,
    ``wavelength / step``, could resolve. A `wavelength` of zero is one that is not known.

    Examples
    --------
    >>> row = np.linspace(-0.5, 0.5, 41)
    >>> radians_for_degrees(np.degrees(row), np.degrees(row), 1e-3), radians_for_degrees(row, row, 1e-3)[:45]
    (None, 'The beams reach no farther than 0.5 degrees a')
    """
    steps = [np.diff(row).mean() for row in (azimuth, elevation) if row.size > 1]
    reach = max(float(np.abs(row).max()) for row in (azimuth, elevation))
    if not steps or reach > 0.5 * np.pi:
        return None
    in_wavelengths = 1.0 / np.radians(max(steps))
    if in_wavelengths * wavelength <= FINEST_APERTURE and in_wavelengths <= WIDEST_APERTURE:
        return None
    return (
        f"The beams reach no farther than {reach:.3g} degrees aside, in steps that no such scanner can tell apart: "
        "their directions are probably in radians."
    )


def as_real_numbers(values: NDArray) -> NDArray:
    """All real numbers in an array, (n,): real and imaginary parts of complex values, which NumPy handles slowly."""
    flat = values.ravel("K")
    return flat.view(flat.real.dtype)


def not_finite(values: NDArray) -> int:
    """Number of values that are NaN or infinite.

    Examples
    --------
    >>> not_finite(np.array([[1.0, complex(np.nan, np.inf)], [2j, complex(0.0, np.inf)]]).T)
    2
    """
    return 0 if np.isfinite(as_real_numbers(values)).all() else int(np.count_nonzero(~np.isfinite(values)))


def any_nonzero(values: NDArray) -> bool:
    """Whether any value is not zero; the first row is looked at first, since it mostly settles the question."""
    return bool(values[:1].any() or values.any())


def constant_part(s: NDArray[np.complexfloating]) -> str | None:
    """What samples (frequency first) are if their real or imaginary part is zero throughout; None for complex samples.

    Samples that do not change with frequency are not judged: those of an object at range zero are real.

    Examples
    --------
    >>> [constant_part(np.array([first, 2, 3])) for first in (1 + 0j, -1 + 0j, 1j)]
    ['magnitudes', 'real parts', None]
    """
    if s.shape[0] < 2:
        return None
    for name, part, other in (("real parts", s.real, s.imag), ("imaginary parts", s.imag, s.real)):
        if not any_nonzero(other) and (part != part[:1]).any():
            return "magnitudes" if not (part < 0).any() else name
    return None
