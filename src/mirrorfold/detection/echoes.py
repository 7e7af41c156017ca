"""Echoes: the places of an image or a volume where an object or a wall sent the waves back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array, Index, Mask

RAYLEIGH_MEDIAN = 1.177
"""Median of a Rayleigh amplitude over the standard deviation of its real part, ``sqrt(2 ln 2)``."""

NOISE_SAMPLES = 400_000
"""The noise is estimated from so many samples, evenly chosen: their median then errs by 0.2 %."""

CUT, CUT_SHARE = 1.5, 0.01
"""All that is faint was set to zero before, where some samples are zero and more than the share `CUT_SHARE` of the
others lies within the factor `CUT` of the faintest: of N samples of noise about one does."""

FALSE_ALARMS = 1e-3
"""Expected number of noise samples in a whole image or volume that are taken for echoes."""

SIDE_LOBE_MARGIN_DB = 6.0
"""An echo must exceed what may be a side lobe of a brighter one by this much: two side lobes in phase add up."""

REFERENCE_WEIGHT = 0.5
"""A direction weighs in the reference with its amplitude to this power. With 0, many directions that hold only weak
multiple scattering would lower it; with 1, a few specular glints, 35 dB brighter than the rest, would raise it."""

GLINT, DIFFUSE = 10.0, 20.0
"""No direction weighs with more than `GLINT` times the median amplitude: diffuse echoes spread over 20 dB, and where a
beam is wide, glints fill so many of the few directions that they alone would set the reference. But the reference is at
least the one without that limit over `DIFFUSE`: glints are up to 26 dB brighter than diffuse echoes, and weaker ones
are side lobes of a few bright objects."""


@dataclass(frozen=True, eq=False)
class Echoes:
    """The echoes of a view.

    Attributes
    ----------
    position : (n, d) array [m]
        In the image or volume, before any folding.
    range : (n,) array [m]
    direction : (n,) array of int
        The line of sight that is nearest.
    amplitude : (n,) array
        Normalised as in the view.
    length : (n,) array
        Length of ridge [m] that each echo of an image stands for; one for each echo of a volume.
    strong : (n,) bool array
        Above its `limit`; the others are faint.
    visible : (n,) bool array
        No object stands in front of it.
    noise : (n,) array
        Amplitude that noise and side lobes stay below at its place.
    limit : (n,) array
        Amplitude that the echo had to exceed to be strong: the threshold, lowered where a mirror dims what it shows.
    threshold : float
        Amplitude that echoes in line of sight must exceed to be strong.
    reference : float
        Amplitude of the robust reference echo.
    """

    position: Array
    range: Array
    direction: Index
    amplitude: Array
    length: Array
    strong: Mask
    visible: Mask
    noise: Array
    limit: Array
    threshold: float
    reference: float

    @classmethod
    def found(cls, position: Array, range_: Array, direction: Index, amplitude: Array, length: Array, noise: Array,
              threshold: float, reference: float) -> Echoes:  # fmt: skip
        """Echoes as they are found: all visible, strong above the threshold."""
        strong, visible, limit = amplitude >= threshold, range_ > -np.inf, np.full(range_.size, threshold)
        return cls(position, range_, direction, amplitude, length, strong, visible, noise, limit, threshold, reference)

    @classmethod
    def pixels(
        cls, position: Array, range_: Array, direction: Index, area: Array, brightest: float, threshold: float
    ) -> Echoes:
        """Echoes of the published algorithm, all strong and of amplitude one: it counts pixels, by their area."""
        one = np.ones(range_.size)
        found = cls.found(position, range_, direction, one, area, 0.0 * one, threshold, brightest)
        return replace(found, strong=one > 0.0)

    def range_up_to(self, share: float) -> float:
        """Range [m] up to which that share of the strong echoes lies; in an empty scene zero."""
        strong = self.range[self.strong]
        return float(np.quantile(strong, share)) if strong.size else 0.0

    def __len__(self) -> int:
        return self.range.size

    def take(self, which: Mask | Index) -> Echoes:
        """Some of the echoes, by mask or index."""
        return replace(self, **{name: getattr(self, name)[which] for name in _OF_EACH})

    def joined(self, *others: Echoes) -> Echoes:
        """These echoes, and after them those of other nodes of the same tree."""
        every: dict[str, Any] = {
            name: np.concatenate([getattr(one, name) for one in (self, *others)]) for name in _OF_EACH
        }
        return replace(self, **every)


_OF_EACH = "position", "range", "direction", "amplitude", "length", "strong", "visible", "noise", "limit"


def noise_level(values: NDArray[Any]) -> float:
    """Standard deviation of the real part of the noise that most of an image or a volume holds.

    Zeros do not count, for they are where nothing was measured. The level is zero where all below some amplitude was
    set to zero, as other programs do.
    """
    few = values.ravel()[:: max(1, values.size // NOISE_SAMPLES) | 1]  # an odd stride visits all rows alike
    whole = few.dtype.kind in "iu"
    sample = np.abs(few.astype(float) if whole else few)
    held = sample[sample > 0.0]
    if not held.size:
        return 0.0
    least = float(held.min())
    cut = held.size < sample.size and np.count_nonzero(held <= CUT * least) > 1 + CUT_SHARE * held.size
    return 0.0 if cut and not (whole and least == 1.0) else float(np.median(held)) / RAYLEIGH_MEDIAN


def noise_limit(sigma: float, samples: int) -> float:
    """Amplitude that noise of that standard deviation, of its real part, stays below in so many samples.

    A Rayleigh amplitude exceeds ``k sigma`` with probability ``exp(-k^2/2)``, so that of N samples none may be expected
    to beyond ``k = sqrt(2 ln(N / p))``: about 6.2 for `FALSE_ALARMS` p = 1e-3 and 300 000 samples.
    """
    return float(np.sqrt(2.0 * np.log(max(samples, 1) / FALSE_ALARMS)) * sigma)


def reference_echo(brightest: Array) -> float:
    """The robust reference: weighted median of the brightest echo in each direction, (n,); zero where there is none."""
    ordered = np.sort(brightest[brightest > 0.0])
    if not ordered.size:
        return 0.0
    found = []
    for most in (GLINT * np.median(ordered), ordered[-1]):
        weight = np.cumsum(np.minimum(ordered, most) ** REFERENCE_WEIGHT)
        found.append(float(ordered[np.searchsorted(weight, 0.5 * weight[-1])]))
    return max(found[0], found[1] / DIFFUSE)


def strongest_of(group: Index, amplitude: Array) -> Index:
    """The number of the strongest echo in each group, in the order of the groups' numbers, (groups,)."""
    order = np.lexsort([-amplitude, group])
    return order[np.unique(group[order], return_index=True)[1]]


def brightest_of(beam: Index, amplitude: Array) -> Array:
    """The largest amplitude in each beam up to the last with an echo, (beams,)."""
    brightest = np.zeros(int(beam.max(initial=-1)) + 1)
    np.maximum.at(brightest, beam, amplitude)
    return brightest
