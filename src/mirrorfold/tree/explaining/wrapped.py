"""Echoes from beyond the ambiguous range, told by the curvature of their waves.

Equal steps of frequency cannot tell the range r of an echo from r + P, P the ambiguous range: a late echo stands in the
image before the radar, where nothing is. Its waves give it away: what the places of transmitter and receiver add to the
path by way of a point, a flat face or a corner at the distance rho, must fit to where it stands.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array, Index
from mirrorfold.detection.views.image_view import LARGEST_SINE, ImageView
from mirrorfold.focusing.echoes.coherence import CORNER, FACE, OVERSAMPLING, POINT, coherence, profiles, windows
from mirrorfold.sweep.pairs import Pairs, pairs_of

PAIRS = 1000, 8000
"""Pairs of antennas that are used, a random choice: the more, the weaker is what stands elsewhere at the same range.
The second number is for echoes that the first cannot tell from it, as between walls that face each other."""

MOST_SAMPLES = 2**23
"""Most samples of their range profiles; bounds the memory."""

IN_PHASE = 15.0
"""Coherence, over that of random phases, from which on an echo can be told to come from farther away: the largest of
some hundred random ones stays below."""

DIRECTION_STEP = 0.5
"""Step of the directions that are tried, in resolution cells of the array."""


def wrapping_ratio(sweep: xr.Dataset, view: ImageView, range_: Array, u: Array) -> Array:
    """How much better echoes at ranges [m] and u, (n,) each, fit to waves from one ambiguous range farther, (n,).

    The ratio of two coherences, see `focusing.echoes.coherence`, each the largest over the directions into which an
    echo spreads that is focused at the wrong distance, and over points, faces and corners. One where no waves fit.

    Parameters
    ----------
    sweep : xarray.Dataset
        Of pairs, s(frequency, tx, rx).
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
    """Memory [bytes] of the range profiles of pairs, and of what they are made from."""
    frequencies, *antennas = sweep["s"].shape[-3:]
    return 8.0 * (OVERSAMPLING + 1) * frequencies * max(_counts(frequencies, int(np.prod(antennas))))


def _counts(frequencies: int, pairs: int) -> list[int]:
    """How many pairs are looked at, and how many where these are too few."""
    return [min(count, pairs, max(1, MOST_SAMPLES // (OVERSAMPLING * frequencies))) for count in PAIRS]


def _ratio(pairs: Pairs, chosen: Index, view: ImageView, range_: Array, u: Array) -> Array:
    """`wrapping_ratio` by some `chosen` pairs, (n,); NaN where they cannot tell an echo from what stands elsewhere."""
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
            """The largest coherence with waves from that distance."""
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
