"""Step 2, first half: which parts of the image are echoes.

Everything is judged in the radar's view (`image_view`): the noise floor, a threshold relative to a robust reference,
the side lobes of brighter echoes, and the ridges that remain.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter, maximum_filter1d

from mirrorfold.common.types import Array
from mirrorfold.detection.echoes import RAYLEIGH_MEDIAN, SIDE_LOBE_MARGIN_DB, Echoes, noise_limit, reference_echo
from mirrorfold.detection.views.image_view import ImageView

THRESHOLD_DB = -18.0
"""Threshold relative to the reference echo. Diffuse surfaces spread over about 15 dB; multiple scattering starts
some 15-20 dB below them."""

FAINT_DB = -8.0
"""Echoes down to this far below the threshold are kept as faint: they prove no mirror, but continue a known wall where
its echoes fade."""

RIDGE_DB = -12.0
"""A ridge pixel is at most this far below the brightest one within a resolution cell: speckle fades by as much
between neighbouring cells, and the beam falls as fast from one cell to the next."""


def noise_floor(view: ImageView) -> Array:
    """Amplitude that noise stays below, (nr,).

    Noise has the same strength in the whole image before the range normalisation, and most of an image is empty: its
    median tells the noise. Of an image without noise that is the level of far side lobes, and harmless; where all that
    is faint was set to zero, it is zero.
    """
    spreading = view.range**view.power
    held = view.amplitude > 0.0
    raw = view.amplitude[held] / np.repeat(spreading, held.sum(axis=1))
    sigma = float(np.median(raw)) / RAYLEIGH_MEDIAN if raw.size and view.noisy else 0.0
    return noise_limit(sigma, raw.size) * spreading


def find_ridges(view: ImageView, *, threshold_db: float = THRESHOLD_DB, gain: Array | None = None) -> Echoes:
    """The ridges of the image above noise, side lobes, and a threshold [dB] relative to the reference echo.

    Where a `gain` (nr, nu) is given, the threshold is lower by it: there a known mirror dims what it shows.
    """
    amplitude = view.amplitude
    quiet, floor = noise_floor(view), view.side_lobes * 10.0 ** (SIDE_LOBE_MARGIN_DB / 20.0)
    np.maximum(quiet[:, None], floor, out=floor)
    above = amplitude > floor
    reference = reference_echo(np.max(amplitude, axis=0, initial=0.0, where=above))
    threshold = reference * 10.0 ** (threshold_db / 20.0)
    level = amplitude if gain is None else amplitude * gain
    above &= level >= threshold * 10.0 ** (FAINT_DB / 20.0)

    cell = tuple(2 * round(width / step) + 1 for width, step in ((view.range_cell, view.dr), (view.u_cell, view.du)))
    brightest = maximum_filter(amplitude, size=cell, mode="constant")
    brightest *= 10.0 ** (RIDGE_DB / 20.0)
    above &= amplitude >= brightest
    in_range = above & (amplitude == maximum_filter1d(amplitude, 3, axis=0, output=brightest, mode="constant"))
    in_u = above & (amplitude == maximum_filter1d(amplitude, 3, axis=1, output=brightest, mode="constant"))
    rows, columns = np.nonzero(in_range | in_u)
    found = amplitude[rows, columns]

    def beside(axis: int, step: int) -> Array:
        """Amplitude of the neighbours, zero outside."""
        place = [rows, columns]
        place[axis] = place[axis] + step
        inside = (place[axis] >= 0) & (place[axis] < amplitude.shape[axis])
        return np.where(inside, amplitude[tuple(np.where(inside, at, 0) for at in place)], 0.0)

    range_ = view.range[rows] + view.dr * _vertex(beside(0, -1), found, beside(0, 1))
    u = view.u[columns] + view.du * _vertex(beside(1, -1), found, beside(1, 1))
    points = view.to_points(range_, u)
    length = np.where(in_range[rows, columns], view.cross_cell(points) * view.du / view.u_cell, view.dr)
    echoes = Echoes.found(points, range_, view.column(u), found, length, floor[rows, columns], threshold, reference)
    if gain is None:
        return echoes
    limit = threshold / gain[rows, columns]
    return replace(echoes, limit=limit, strong=found >= limit)


def _vertex(before: Array, at: Array, after: Array) -> Array:
    """Offset, in samples, of the vertex of the parabola through samples that are a local maximum; zero elsewhere."""
    curvature = np.where((at >= before) & (at >= after), before - 2.0 * at + after, 0.0)
    return np.divide(0.5 * (before - after), curvature, out=np.zeros_like(at), where=curvature < 0.0)


def find_pixels(view: ImageView, *, threshold_db: float) -> Echoes:
    """Every sample above a threshold [dB] relative to the brightest one, as published; each weighs with its area."""
    brightest = float(view.amplitude.max())
    threshold = brightest * 10.0 ** (threshold_db / 20.0)
    rows, columns = np.nonzero((view.amplitude >= threshold) & (view.amplitude > 0.0))
    points = view.to_points(view.range[rows], view.u[columns])
    area = view.dr * view.cross_cell(points) * view.du / view.u_cell
    return Echoes.pixels(points, view.range[rows], columns, area / view.range_cell, brightest, threshold)
