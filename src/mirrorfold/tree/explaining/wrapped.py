"""Echoes from beyond the ambiguous range, found by the curvature of their waves.

Equal steps of frequency cannot tell the range r of an echo from r + P, with P the ambiguous range: a late echo stands
in the image at r, where nothing is. But its waves have the curvature of waves from r + P. The places of transmitter and
receiver lengthen the path by way of a point, a flat face or a corner at the distance rho by amounts that depend on rho.
So each echo is compared with waves from r and with waves from r + P.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array, Index
from mirrorfold.detection import ImageView
from mirrorfold.detection.views.image_view import LARGEST_SINE
from mirrorfold.focusing.echoes.coherence import CORNER, FACE, OVERSAMPLING, POINT, coherence, profiles, windows
from mirrorfold.sweep.pairs import Pairs, pairs_of

PAIRS = 1000, 8000
"""Number of pairs of antennas that are used, chosen at random: the more pairs, the weaker other echoes at the same
range become. The second number is for echoes that the first cannot separate from these, as between walls that face each
other."""

MOST_SAMPLES = 2**23
"""Largest number of samples in the range profiles of these pairs; bounds the memory."""

IN_PHASE = 15.0
"""Least coherence, over that of random phases, of an echo whose distance can be judged: the largest of some hundred
random coherences stays below."""

DIRECTION_STEP = 0.5
"""Step between the directions that are tried, in resolution cells of the array."""


def wrapping_ratio(sweep: xr.Dataset, view: ImageView, range_: Array, u: Array) -> Array:
    """How much better echoes at ranges [m] and u, (n,) each, fit waves from one ambiguous range farther away, (n,).

    This is the ratio of two coherences, for r + P over r, see `focusing.echoes.coherence`. Each is the largest over
    points, faces and corners, and over the directions into which an echo spreads when it is focused at the wrong
    distance. The ratio is one where waves from r + P do not fit.

    Parameters
    ----------
    sweep : xarray.Dataset
        A sweep of pairs, s(frequency, tx, rx).
    view : ImageView
    range_, u : (n,) arrays
    """
    pairs = pairs_of(sweep)
    some = np.random.default_rng(0).permutation(pairs.tx_of.size)
    ratio, rest = np.full(range_.size, np.nan), np.arange(range_.size)
    for count in np.unique(_counts(*pairs.s.shape)):
        if rest.size:
            ratio[rest] = _ratio(pairs, some[:count], view, range_[rest], u[rest])
            rest = rest[np.isnan(ratio[rest])]
    return np.where(np.isnan(ratio), 1.0, ratio)


def profile_bytes(sweep: xr.Dataset) -> float:
    """Memory [bytes] of the range profiles of pairs, and of the samples that they are computed from."""
    frequencies, *antennas = sweep["s"].shape[-3:]
    return 8.0 * (OVERSAMPLING + 1) * frequencies * max(_counts(frequencies, int(np.prod(antennas))))


def _counts(frequencies: int, pairs: int) -> list[int]:
    """Number of pairs that are used first, and of those that are used where the first are too few."""
    return [min(count, pairs, max(1, MOST_SAMPLES // (OVERSAMPLING * frequencies))) for count in PAIRS]


def _ratio(pairs: Pairs, chosen: Index, view: ImageView, range_: Array, u: Array) -> Array:
    """`wrapping_ratio` from some `chosen` pairs, (n,); NaN where they cannot separate an echo from others."""
    tx_of, rx_of = pairs.tx_of[chosen], pairs.rx_of[chosen]
    profile, step = profiles(pairs.s[:, chosen], pairs.wavenumber)
    period = 0.5 * profile.shape[1] * step
    centre = float(pairs.wavenumber.mean())
    along, ahead = (np.append(axis, 0.0) for axis in (view.along, view.broadside))
    places = np.concatenate([pairs.tx, pairs.rx])
    reach = float(np.linalg.norm(places, axis=1).max())
    cell = np.pi / max(centre * float(np.ptp(places @ along)), 1.0)
    half = int(np.ceil(2.0 * reach / step)) + 2
    in_phase = IN_PHASE / chosen.size
    ratio = np.ones(range_.size)

    def look(n: int) -> None:
        r = float(range_[n])
        gate = np.array([round(2.0 * r / step)])
        around = windows(profile, gate, half, centre - float(pairs.wavenumber[0]), step)
        spread = reach * (1.0 / r - 1.0 / (r + period)) + cell
        count = int(np.ceil(2.0 * spread / (DIRECTION_STEP * cell)))
        directions = np.clip(u[n] + np.linspace(-spread, spread, count + 1), -LARGEST_SINE, LARGEST_SINE)

        def fit(distance: float, directions: Array) -> float:
            """The largest coherence with waves from that `distance` [m], over shapes and directions."""
            found = np.zeros(1)
            for shape in (POINT, FACE, CORNER):
                coherence(
                    *(around, step, 1.0, shape, pairs.tx, pairs.rx, tx_of, rx_of, centre, directions),
                    *(1.0 / distance, along, ahead, found),
                )
            return float(found[0])

        late = fit(r + period, directions)
        if late > in_phase:
            ratio[n] = late / max(fit(r, directions), np.finfo(float).tiny)
        elif fit(r, u[n : n + 1]) <= in_phase:
            ratio[n] = np.nan

    for_each(look, range(range_.size))
    return ratio
