"""The waves of echoes, compared with those from points, flat faces and right-angled corners at given distances.

The places of transmitter and receiver lengthen the path by way of each of these by amounts that depend on the distance;
see `mirrorfold.focusing.echoes.coherence`.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.types import Array, Index
from mirrorfold.common.windows import hann
from mirrorfold.detection import ImageView
from mirrorfold.focusing.echoes.coherence import CORNER, FACE, OVERSAMPLING, POINT, coherence, profiles, windows
from mirrorfold.focusing.echoes.range_windows import RangeWindows
from mirrorfold.sweep import antenna_positions, wavenumber
from mirrorfold.sweep.pairs import Pairs, pairs_of
from mirrorfold.tree.explaining.apertures import Aperture, beside_main_lobe, grating_lobe, wandering_lobes

PAIRS = 1000, 8000
"""Number of pairs of antennas that are used, chosen at random: the more pairs, the weaker other echoes at the same
range become. The second number is for echoes that the first cannot separate from these, as between walls that face each
other."""

MOST_SAMPLES = 2**23
"""Largest number of samples in the range profiles of these pairs; bounds the memory."""


class Waves:
    """The waves of a sweep, by the `chosen` (n,) of its pairs of antennas.

    They have the `wavelength` [m], and the ambiguous range `period` [m]. An antenna is at most `reach` [m] from the
    middle of the array, and `cell` is the width of the array's resolution cell, as the sine of an angle.
    """

    def __init__(self, pairs: Pairs, chosen: Index, view: ImageView) -> None:
        self._pairs = pairs.tx, pairs.rx, pairs.tx_of[chosen], pairs.rx_of[chosen]
        self._profile, self._step = profiles(pairs.s[:, chosen], pairs.wavenumber)
        self._centre = float(pairs.wavenumber.mean())
        self._carrier = self._centre - float(pairs.wavenumber[0])
        self._axes = tuple(np.append(axis, 0.0) for axis in (view.along, view.broadside))
        places = np.concatenate([pairs.tx, pairs.rx])
        self.wavelength = 2.0 * np.pi / self._centre
        self.period = 0.5 * self._profile.shape[1] * self._step
        self.reach = float(np.linalg.norm(places, axis=1).max())
        self.cell = np.pi / max(self._centre * float(np.ptp(places @ self._axes[0])), 1.0)
        self._half = int(np.ceil(2.0 * self.reach / self._step)) + 2

    def around(self, range_: float) -> NDArray[np.float32]:
        """The part of the range profiles around echoes at a range [m], see `coherence.windows`."""
        gate = np.array([round(2.0 * range_ / self._step)])
        return windows(self._profile, gate, self._half, self._carrier, self._step)

    def fit(self, around: NDArray[np.float32], distance: float, directions: Array) -> Array:
        """Coherence of what is `around` a range with waves from a point, a face and a corner at a `distance` [m], (3,).

        Each is the largest over the `directions` (n,), sines of angles off broadside.
        """
        found = np.zeros((3, 1))
        for shape in (POINT, FACE, CORNER):
            coherence(
                *(around, self._step, 1.0, shape, *self._pairs, self._centre, directions, 1.0 / distance),
                *(*self._axes, found[shape]),
            )
        return found[:, 0]


class SweepWaves:
    """The apertures, range profiles and waves of a `sweep` of pairs, s(frequency, tx, rx); each is made once."""

    def __init__(self, sweep: xr.Dataset) -> None:
        self.sweep, self._made = sweep, dict[int, Waves]()
        self._lobes, self._wandering = np.empty(0), np.empty(0)

    @cached_property
    def apertures(self) -> list[Aperture]:
        """The transmitters and the receivers."""
        shortest = 2.0 * np.pi / float(wavenumber(self.sweep)[-1])
        return [Aperture.of(position, shortest) for position in antenna_positions(self.sweep)]

    @cached_property
    def grating_lobe(self) -> float:
        """Height of the receivers' largest grating lobe: a ghost where it shows an echo has this `direction_ratio`."""
        return grating_lobe(self.apertures[1], float(wavenumber(self.sweep).mean()))

    @cached_property
    def range_windows(self) -> RangeWindows:
        """The samples under a Hann taper, ready to be gated to the ranges of echoes."""
        k = wavenumber(self.sweep)
        return RangeWindows(k, self.sweep["s"].values, hann(k.size))

    @cached_property
    def pairs(self) -> Pairs:
        """All pairs of the sweep."""
        return pairs_of(self.sweep)

    @property
    def counts(self) -> list[int]:
        """Number of pairs that are used first, and of those that are used where the first are too few."""
        return numbers_of_pairs(*self.pairs.s.shape)

    def by(self, count: int, view: ImageView) -> Waves:
        """The waves by so many pairs, for a view of the image of this sweep."""
        if count not in self._made:
            chosen = np.random.default_rng(0).permutation(self.pairs.tx_of.size)[:count]
            self._made[count] = Waves(self.pairs, chosen, view)
        return self._made[count]

    def lobes(self, view: ImageView) -> Array:
        """Amplitude of an echo's lobes at distances in u from zero to the width of the view, see `beside_main_lobe`."""
        if not self._lobes.size:
            self._lobes = beside_main_lobe(self.apertures, wavenumber(self.sweep), view.u - view.u[0])
        return self._lobes

    def wandering_lobes(self, view: ImageView, samples: int, columns: Index) -> Array:
        """As `lobes` at distances in u of `columns` (n,), in the image of the whole band: (samples, n).

        The first axis is the distance in range, from zero on.
        """
        if not self._wandering.size:
            weights = view.window if view.window.size else hann(self.sweep["frequency"].size)
            beyond = np.linspace(0.0, (samples - 1) * view.dr, samples)
            sine = view.u[columns] - view.u[0]
            self._wandering = wandering_lobes(self.apertures, wavenumber(self.sweep), sine, weights, beyond)
        return self._wandering


def profile_bytes(sweep: xr.Dataset) -> float:
    """Memory [bytes] of the range profiles of pairs that are kept."""
    frequencies, *antennas = sweep["s"].shape[-3:]
    return 8.0 * OVERSAMPLING * frequencies * sum(set(numbers_of_pairs(frequencies, int(np.prod(antennas)))))


def numbers_of_pairs(frequencies: int, pairs: int) -> list[int]:
    """Number of pairs that are used first, and of those that are used where the first are too few."""
    return [min(count, pairs, max(1, MOST_SAMPLES // (OVERSAMPLING * frequencies))) for count in PAIRS]
