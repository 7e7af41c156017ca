"""Echoes from beyond the ambiguous range, found by the curvature of their waves.

Equal steps of frequency cannot tell the range r of an echo from r + P, r + 2 P and so on, with P the ambiguous range: a
late echo stands in the image at r, where nothing is. But its waves have the curvature of waves from farther away. The
places of transmitter and receiver lengthen the path by way of a point, a flat face or a corner at the distance rho by
amounts that depend on rho. So each echo is compared with waves from r and with waves from r + P, r + 2 P, ...
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array
from mirrorfold.detection import ImageView
from mirrorfold.detection.views.image_view import LARGEST_SINE
from mirrorfold.tree.explaining.waves import SweepWaves, Waves

IN_PHASE = 15.0
"""Least coherence, over that of random phases, of an echo whose distance can be judged: the largest of some hundred
random coherences stays below."""

DIRECTION_STEP = 0.5
"""Step between the directions that are tried, in resolution cells of the array."""

MOST_PERIODS = 4
"""Largest number of ambiguous ranges by which echoes are taken to be late. Between two walls that face each other,
echoes that were late by three were as bright as objects; farther away, waves hardly differ in curvature."""

DEPTH_OF_FOCUS = 0.25
"""Waves from two distances can be told apart if their paths to the ends of the array differ by more than this many
wavelengths (Rayleigh's limit: Born and Wolf, Principles of Optics, 7th ed., 9.3)."""


def wrapping_ratio(waves: SweepWaves, view: ImageView, range_: Array, u: Array) -> Array:
    """How much better echoes at ranges [m] and u, (n,) each, fit waves from ambiguous ranges farther away, (n,).

    This is the ratio of two coherences, for r + P, r + 2 P, ... over that for r, see `focusing.echoes.coherence`. Each
    is the largest over points, faces and corners, and over the directions into which an echo spreads when it is focused
    at the wrong distance. The ratio is one where waves from farther away do not fit, or do not differ.
    """
    ratio, rest = np.full(range_.size, np.nan), np.arange(range_.size)
    for count in np.unique(waves.counts):
        if rest.size:
            ratio[rest] = _ratio(waves.by(count, view), IN_PHASE / count, range_[rest], u[rest])
            rest = rest[np.isnan(ratio[rest])]
    return np.where(np.isnan(ratio), 1.0, ratio)


def _ratio(waves: Waves, in_phase: float, range_: Array, u: Array) -> Array:
    """`wrapping_ratio` by the waves of some pairs, (n,); NaN where these cannot separate an echo from others.

    A coherence of `in_phase` or less may be one of random phases.
    """
    ratio = np.ones(range_.size)

    def look(n: int) -> None:
        """Set the ratio of one echo; it stays one where waves from farther away do not differ."""
        r = float(range_[n])
        distances = _later(r, waves)
        if not distances:
            return
        around = waves.around(r)
        spread = waves.reach * (1.0 / r - 1.0 / distances[-1]) + waves.cell
        count = int(np.ceil(2.0 * spread / (DIRECTION_STEP * waves.cell)))
        directions = np.clip(u[n] + np.linspace(-spread, spread, count + 1), -LARGEST_SINE, LARGEST_SINE)
        late = max(waves.fit(around, distance, directions).max() for distance in distances)
        if late > in_phase:
            ratio[n] = late / max(waves.fit(around, r, directions).max(), np.finfo(float).tiny)
        elif waves.fit(around, r, u[n : n + 1]).max() <= in_phase:
            ratio[n] = np.nan

    for_each(look, range(range_.size))
    return ratio


def _later(range_: float, waves: Waves) -> list[float]:
    """Those of the distances r + P, r + 2 P, ... [m] whose waves differ from those from r [m] and from nearer ones.

    None if those from r + P do not differ from those from r.
    """
    distances, nearer = list[float](), range_
    for periods in range(1, MOST_PERIODS + 1):
        distance = range_ + periods * waves.period
        if waves.reach**2 * (1.0 / nearer - 1.0 / distance) > DEPTH_OF_FOCUS * waves.wavelength:
            distances.append(distance)
            nearer = distance
        elif not distances:
            break
    return distances
