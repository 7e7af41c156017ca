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
"""Approximate number of evenly spaced samples from which the noise is estimated: their median then errs by 0.13 %."""

CUT, CUT_SHARE = 1.5, 0.01
"""Some programs set all faint samples to zero. This is assumed where some samples are zero and, of the others, more
than the share `CUT_SHARE` have at most `CUT` times the smallest amplitude: of N samples of noise about one has."""

FALSE_ALARMS = 1e-3
"""Expected number of noise samples in a whole image or volume that are taken for echoes."""

SIDE_LOBE_MARGIN_DB = 6.0
"""Margin [dB] by which an echo must exceed the side-lobe level of brighter echoes: two side lobes in phase add up."""

REFERENCE_WEIGHT = 0.5
"""Exponent: each direction has the weight ``amplitude ** REFERENCE_WEIGHT`` in the weighted median of `reference_echo`.
With 0, many directions that hold only weak multiple scattering would lower the reference; with 1, a few specular
glints, 35 dB brighter than the rest, would raise it."""

GLINT, DIFFUSE = 10.0, 20.0
"""For its weight, the amplitude of a direction is limited to `GLINT` times the median (20 dB, over which diffuse echoes
spread). Without the limit, glints alone would set the reference where the beam is wide, because there they fill many of
the few directions. But the reference is at least ``1 / DIFFUSE`` of the value without that limit: glints are up to
26 dB brighter than diffuse echoes, and weaker echoes are side lobes of a few bright objects."""


@dataclass(frozen=True, eq=False)
class Echoes:
    """The echoes of a view.

    Attributes
    ----------
    position : (n, d) array [m]
        Where the image or volume shows the echo, before any folding.
    range : (n,) array [m]
        Distance from the radar.
    direction : (n,) array of int
        Number of the nearest line of sight.
    amplitude : (n,) array
        Normalised as in the view.
    length : (n,) array
        Length of ridge [m] that each echo of an image stands for; one for each echo of a volume.
    strong : (n,) bool array
        Whether the amplitude reaches the `limit`; the other echoes are faint.
    visible : (n,) bool array
        Whether no object in front hides the echo.
    noise : (n,) array
        Amplitude that noise and side lobes do not exceed at the echo's position.
    limit : (n,) array
        Least amplitude of a strong echo there: the threshold, lowered where a mirror dims what it shows.
    threshold : float
        Least amplitude of a strong echo in line of sight.
    reference : float
        Amplitude of the robust reference echo, see `reference_echo`.
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
        """Echoes as they are found: all of them visible, and strong from the threshold on."""
        strong, limit = amplitude >= threshold, np.full(range_.size, threshold)
        visible = np.ones(range_.size, dtype=bool)
        return cls(position, range_, direction, amplitude, length, strong, visible, noise, limit, threshold, reference)

    @classmethod
    def pixels(
        cls, position: Array, range_: Array, direction: Index, area: Array, brightest: float, threshold: float
    ) -> Echoes:
        """Echoes of the published algorithm, one for each pixel: all strong, of amplitude one, weighted by area."""
        one = np.ones(range_.size)
        found = cls.found(position, range_, direction, one, area, 0.0 * one, threshold, brightest)
        return replace(found, strong=one > 0.0)

    def range_up_to(self, share: float) -> float:
        """Range [m] within which the given share of the strong echoes lies; zero where there are no strong echoes."""
        strong = self.range[self.strong]
        return float(np.quantile(strong, share)) if strong.size else 0.0

    def __len__(self) -> int:
        return self.range.size

    def take(self, which: Mask | Index) -> Echoes:
        """The echoes that a mask or an array of indices selects."""
        return replace(self, **{name: getattr(self, name)[which] for name in _OF_EACH})

    def joined(self, *others: Echoes) -> Echoes:
        """These echoes, followed by others of the same view."""
        every = self, *others
        both: dict[str, Any] = {name: np.concatenate([getattr(one, name) for one in every]) for name in _OF_EACH}
        return replace(self, **both)


_OF_EACH = "position", "range", "direction", "amplitude", "length", "strong", "visible", "noise", "limit"


def noise_level(values: NDArray[Any]) -> float:
    """Standard deviation of the real part of the noise in an image or a volume, from the median amplitude.

    Most samples hold only noise, so that their median is that of the noise. Zeros mark places without a measurement and
    are left out. The result is zero where all faint samples were set to zero before, see `CUT`.
    """
    few = values.ravel()[:: max(1, values.size // NOISE_SAMPLES) | 1]  # an odd stride visits all rows alike
    whole = few.dtype.kind in "iu"
    sample = np.abs(few.astype(float) if whole else few)
    held = sample[sample > 0.0]
    if not held.size:
        return 0.0
    least = float(held.min())
    cut = held.size < sample.size and np.count_nonzero(held <= CUT * least) > 1 + CUT_SHARE * held.size
    # In an image of whole numbers, rounding alone makes many faint samples zero or one.
    return 0.0 if cut and not (whole and least == 1.0) else float(np.median(held)) / RAYLEIGH_MEDIAN


def noise_limit(sigma: float, samples: int) -> float:
    """Amplitude that `FALSE_ALARMS` of N samples of noise are expected to exceed, so that practically none does.

    The amplitude is Rayleigh distributed, ``P(A > k sigma) = exp(-k^2 / 2)``, with sigma the standard deviation of the
    real part. With p = `FALSE_ALARMS`, ``N exp(-k^2 / 2) = p`` gives ``k = sqrt(2 ln(N / p))``: about 6.2 for p = 1e-3
    and N = 300 000.
    """
    return float(np.sqrt(2.0 * np.log(max(samples, 1) / FALSE_ALARMS)) * sigma)


def reference_echo(brightest: Array) -> float:
    """The robust reference amplitude: weighted median of the brightest echo in each direction, (n,).

    Zeros mark directions without echoes. The reference is zero where no direction has any. The weights are explained at
    `REFERENCE_WEIGHT` and `GLINT`.
    """
    ordered = np.sort(brightest[brightest > 0.0])
    if not ordered.size:
        return 0.0
    found = []
    for most in (GLINT * np.median(ordered), ordered[-1]):
        weight = np.cumsum(np.minimum(ordered, most) ** REFERENCE_WEIGHT)
        found.append(float(ordered[np.searchsorted(weight, 0.5 * weight[-1])]))
    return max(found[0], found[1] / DIFFUSE)


def strongest_of(group: Index, amplitude: Array) -> Index:
    """Index of the strongest echo of each group, in rising order of the group numbers, (groups,)."""
    order = np.lexsort([-amplitude, group])
    return order[np.unique(group[order], return_index=True)[1]]


def brightest_of(beam: Index, amplitude: Array) -> Array:
    """Largest amplitude in each beam, from beam 0 to the last one with an echo, (beams,); zero without an echo."""
    brightest = np.zeros(int(beam.max(initial=-1)) + 1)
    np.maximum.at(brightest, beam, amplitude)
    return brightest
