"""Step 2, first half: which parts of the image are echoes.

Everything is judged in the radar's view (`image_view`): the noise floor, a threshold relative to a robust reference,
the side lobes of brighter echoes, and the ridges that remain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, maximum_filter1d

from mirrorfold.detection.image_view import PolarImage

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

RAYLEIGH_MEDIAN = 1.177
"""Median of a Rayleigh amplitude over the standard deviation of its real part, ``sqrt(2 ln 2)``."""

FALSE_ALARMS = 1e-3
"""Expected number of noise samples in a whole image that are taken for echoes."""

THRESHOLD_DB = -18.0
"""Threshold relative to the reference echo. Diffuse surfaces spread over about 15 dB; multiple scattering starts
some 15-20 dB below them."""

REFERENCE_WEIGHT = 0.5
"""Power of amplitude that a direction weighs with in the reference. With 0, many directions that hold only weak
multiple scattering would lower it; with 1, a few specular glints, 35 dB brighter than the rest, would raise it."""

FAINT_DB = -8.0
"""Echoes down to this far below the threshold are kept as faint: not evidence of anything by themselves, but a wall
that is known goes on where its echoes fade."""

RIDGE_DB = -12.0
"""A ridge pixel is at most this far below the brightest one within a resolution cell: speckle fades by as much
between neighbouring cells, and the beam falls as fast from one cell to the next."""

SIDE_LOBE_MARGIN_DB = 6.0
"""An echo must exceed what may be a side lobe of a brighter one by this much: two in phase double."""


@dataclass(frozen=True, eq=False)
class Echoes:
    """The points of an image that are echoes.

    Attributes
    ----------
    position : (n, 2) array [m]
        In the image, before any folding.
    range, u : (n,) arrays
        The same in the radar's view.
    amplitude : (n,) array
        Normalised as in the PolarImage.
    length : (n,) array [m]
        Length of ridge that each point stands for.
    strong : (n,) bool array
        Above the threshold; the others are faint.
    threshold : float
        Amplitude below which no echo is evidence, apart from noise and side lobes.
    reference : float
        Amplitude of the robust reference echo.
    """

    position: Array
    range: Array
    u: Array
    amplitude: Array
    length: Array
    strong: Mask
    threshold: float
    reference: float

    def take(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Echoes:
        """Some of the echoes, by mask or index."""
        return replace(
            self,
            position=self.position[which],
            range=self.range[which],
            u=self.u[which],
            amplitude=self.amplitude[which],
            length=self.length[which],
            strong=self.strong[which],
        )


def noise_floor(polar: PolarImage) -> Array:
    """Amplitude that noise stays below, (nr,).

    A Rayleigh amplitude exceeds ``k sigma`` with probability ``exp(-k^2/2)``, so that of N samples none may be
    expected to beyond ``k = sqrt(2 ln(N / p))``: about 6.2 for `FALSE_ALARMS` p = 1e-3 and 300 000 samples.
    Noise has the same strength in the whole image before the range normalisation, and most of an image is empty: its
    median tells the noise. Where there is no noise this is the level of far side lobes, and harmless.
    """
    spreading = polar.range**polar.power
    seen = polar.amplitude > 0.0
    raw = (polar.amplitude / spreading[:, None])[seen]
    sigma = float(np.median(raw)) / RAYLEIGH_MEDIAN if raw.size else 0.0
    return np.sqrt(2.0 * np.log(max(raw.size, 1) / FALSE_ALARMS)) * sigma * spreading


def side_lobes(polar: PolarImage) -> Array:
    """Amplitude that side lobes of brighter echoes at the same range may reach, (nr, nu).

    Between the lobes of a uniform array the envelope is ``1 / (pi D u / lambda)`` each way, so an echo of amplitude A
    may show as ``A / ((pi D_tx du)(pi D_rx du))`` a distance du away. Computed as the largest such claim, over
    distances that double in steps of a resolution cell.
    """
    claim = np.zeros_like(polar.amplitude)
    half = max(1, round(1.5 * polar.u_cell / polar.du))
    peak = polar.amplitude
    while half < polar.u.size:
        distance = half * polar.du
        envelope = 1.0 / (
            max(1.0, np.pi * polar.aperture_tx * distance) * max(1.0, np.pi * polar.aperture_rx * distance)
        )
        nxt = max(half + 1, int(1.3 * half))
        # The brightest echo between `half` and `nxt` steps to either side.
        window = nxt - half + 1
        brightest = maximum_filter1d(peak, window, axis=1, mode="constant")
        offset = half + window // 2
        claim[:, offset:] = np.maximum(claim[:, offset:], envelope * brightest[:, :-offset])
        claim[:, :-offset] = np.maximum(claim[:, :-offset], envelope * brightest[:, offset:])
        half = nxt
    return claim


def reference_echo(brightest: Array) -> float:
    """The robust reference: weighted median over directions of the brightest echo in each.

    Parameters
    ----------
    brightest : (n,) array
        Amplitude of the brightest echo in each direction; zero where there is none.

    Returns
    -------
    float
        Zero without any echo.
    """
    ordered = np.sort(brightest[brightest > 0.0])
    if not ordered.size:
        return 0.0
    weight = np.cumsum(ordered**REFERENCE_WEIGHT)
    return float(ordered[np.searchsorted(weight, 0.5 * weight[-1])])


def find_echoes(polar: PolarImage, *, threshold_db: float | None = None) -> Echoes:
    """The ridges of the image that stand above noise, threshold and side lobes.

    Parameters
    ----------
    polar : PolarImage
    threshold_db : float [dB], optional
        Relative to the reference echo; by default `THRESHOLD_DB`.

    Returns
    -------
    Echoes
        Maybe none.
    """
    amplitude = polar.amplitude
    floor = np.maximum(noise_floor(polar)[:, None], side_lobes(polar) * 10.0 ** (SIDE_LOBE_MARGIN_DB / 20.0))
    above = amplitude > floor
    reference = reference_echo(np.max(amplitude, axis=0, initial=0.0, where=above))
    threshold = reference * 10.0 ** ((THRESHOLD_DB if threshold_db is None else threshold_db) / 20.0)
    above &= amplitude >= threshold * 10.0 ** (FAINT_DB / 20.0)

    cell = tuple(
        2 * round(width / step) + 1 for width, step in ((polar.range_cell, polar.dr), (polar.u_cell, polar.du))
    )
    above &= amplitude >= 10.0 ** (RIDGE_DB / 20.0) * maximum_filter(amplitude, size=cell, mode="constant")
    in_range = above & (amplitude == maximum_filter1d(amplitude, 3, axis=0, mode="constant"))
    in_u = above & (amplitude == maximum_filter1d(amplitude, 3, axis=1, mode="constant"))
    rows, columns = np.nonzero(in_range | in_u)
    range_ = polar.range[rows] + polar.dr * np.where(in_range[rows, columns], _vertex(amplitude, rows, columns, 0), 0.0)
    u = polar.u[columns] + polar.du * np.where(in_u[rows, columns], _vertex(amplitude, rows, columns, 1), 0.0)
    length = np.where(in_range[rows, columns], polar.cross_cell(range_, u) * polar.du / polar.u_cell, polar.dr)
    found = amplitude[rows, columns]
    return Echoes(polar.to_points(range_, u), range_, u, found, length, found >= threshold, threshold, reference)


def _vertex(amplitude: Array, rows: NDArray[np.intp], columns: NDArray[np.intp], axis: int) -> Array:
    """Offset, in samples, of the vertex of the parabola through a sample and its two neighbours along `axis`."""
    step = (1, 0) if axis == 0 else (0, 1)
    padded = np.pad(amplitude, 1)
    before = padded[rows + 1 - step[0], columns + 1 - step[1]]
    after = padded[rows + 1 + step[0], columns + 1 + step[1]]
    curvature = before - 2.0 * amplitude[rows, columns] + after
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = np.where(curvature < 0.0, 0.5 * (before - after) / curvature, 0.0)
    return np.asarray(np.clip(offset, -0.5, 0.5))


def find_pixels(polar: PolarImage, *, threshold_db: float) -> Echoes:
    """Every sample above a threshold relative to the brightest one: objects, as published.

    Parameters
    ----------
    polar : PolarImage
    threshold_db : float [dB]

    Returns
    -------
    Echoes
        All of amplitude one: the published transform counts pixels.
    """
    brightest = float(polar.amplitude.max())
    threshold = brightest * 10.0 ** (threshold_db / 20.0)
    rows, columns = np.nonzero((polar.amplitude >= threshold) & (polar.amplitude > 0.0))
    range_, u = polar.range[rows], polar.u[columns]
    # Pixels of equal area on the floor plan weigh equally.
    area = polar.dr * polar.cross_cell(range_, u) * polar.du / polar.u_cell
    length = area / polar.range_cell
    ones = np.ones(rows.size)
    return Echoes(polar.to_points(range_, u), range_, u, ones, length, ones > 0.0, threshold, brightest)
