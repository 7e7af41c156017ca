"""Step 2, first half: which parts of an image are echoes.

The search works in the radar's own view, range against direction (`image_view`). A sample belongs to an echo if it
exceeds the noise, the side lobes of brighter echoes, and a threshold relative to a robust reference amplitude. Of these
samples only the ridges are kept: local maxima in range or in direction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter, maximum_filter1d

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import Array
from mirrorfold.detection.echoes import RAYLEIGH_MEDIAN, SIDE_LOBE_MARGIN_DB, Echoes, noise_limit, reference_echo
from mirrorfold.detection.views.image_view import ImageView

THRESHOLD_DB = -18.0
"""Threshold [dB] of strong echoes, relative to the reference echo. Echoes of diffuse surfaces spread over about 15 dB;
multiple scattering starts some 15-20 dB below them."""

FAINT_DB = -8.0
"""Level [dB], relative to the threshold, down to which echoes are kept as faint ones. Faint echoes are no evidence of a
mirror, but they continue a known wall where its echoes fade."""

RIDGE_DB = -12.0
"""Least level [dB] of a sample on a ridge, relative to the brightest sample within a resolution cell: speckle fades by
as much between neighbouring cells, and the beam falls as fast from one cell to the next."""


def noise_floor(view: ImageView) -> Array:
    """Amplitude that noise stays below at each range, (nr,).

    Before the normalisation with range, noise has the same strength in the whole image. Most of an image is empty, so
    that its median amplitude is that of the noise. In an image without noise, the median is the level of far side
    lobes, which does no harm. Where all faint samples were set to zero before, the result is zero.
    """
    spreading = view.range**view.power
    held = view.amplitude > 0.0
    raw = view.amplitude[held] / np.repeat(spreading, held.sum(axis=1))
    sigma = float(np.median(raw)) / RAYLEIGH_MEDIAN if raw.size and view.noisy else 0.0
    return noise_limit(sigma, raw.size) * spreading


def ring_floor(view: ImageView) -> Array:
    """Amplitude that the side lobes of imperfect arrays stay below, (nr, nu), where only one array tells directions.

    Each of its places sees the lobes of a bright echo at the same distance in all directions. They are as high as gaps
    and errors make them: nobody knows them before. They are told from echoes by the median over all directions, more
    than any wall fills: one that faces the radar is a range cell deep up to ``u = sqrt(2 range_cell / range)``. Where
    such a wall would fill half of the image, there is no limit.
    """
    floor = np.zeros_like(view.amplitude)
    facing, seen = 2.0 * np.sqrt(2.0 * view.range_cell / view.range), float(np.ptp(view.u))
    factor = np.where(facing < 0.5 * seen, noise_limit(1.0, round(seen / view.u_cell)) / RAYLEIGH_MEDIAN, 0.0)
    for place in view.places_along:
        ring = factor * np.median(view.from_along(place).amplitude, axis=1)
        np.maximum(floor, ring[view.row(view.distance_along(place))], out=floor)
    return floor


def find_ridges(view: ImageView, *, threshold_db: float = THRESHOLD_DB, gain: Array | None = None) -> Echoes:
    """Echoes on the ridges of the image: local maxima above the noise, the side lobes, and the threshold.

    The threshold [dB] is relative to the reference echo. It is divided by the `gain` (nr, nu), if one is given: the
    factor by which known mirrors dim the echoes that they show there.
    """
    amplitude = view.amplitude
    quiet, floor = noise_floor(view), view.side_lobes * ratio_of(SIDE_LOBE_MARGIN_DB)
    np.maximum(quiet[:, None], floor, out=floor)
    if view.one_way:
        np.maximum(ring_floor(view), floor, out=floor)
    above = amplitude > floor
    reference = _reference(np.max(amplitude, axis=0, initial=0.0, where=above), quiet, threshold_db)
    threshold = reference * ratio_of(threshold_db)
    level = amplitude if gain is None else amplitude * gain
    above &= level >= threshold * ratio_of(FAINT_DB)

    cell = tuple(2 * round(width / step) + 1 for width, step in ((view.range_cell, view.dr), (view.u_cell, view.du)))
    brightest = maximum_filter(amplitude, size=cell, mode="constant")
    brightest *= ratio_of(RIDGE_DB)
    above &= amplitude >= brightest
    in_range = above & (amplitude == maximum_filter1d(amplitude, 3, axis=0, output=brightest, mode="constant"))
    in_u = above & (amplitude == maximum_filter1d(amplitude, 3, axis=1, output=brightest, mode="constant"))
    rows, columns = np.nonzero(in_range | in_u)
    found = amplitude[rows, columns]

    def beside(axis: int, step: int) -> Array:
        """Amplitude of the samples one step away from the ridges, zero outside the view."""
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


def _reference(brightest: Array, quiet: Array, threshold_db: float) -> float:
    """The `reference_echo` of an image, from the brightest echo in each direction, (nu,): zero where there is none.

    Noise stays below `quiet` (nr,). Where it may hide echoes that would count, directions without echoes have the level
    of the noise: otherwise the few glints above the noise would set the reference alone, and walls would be faint.
    """
    reference, hidden = reference_echo(brightest), float(np.median(quiet))
    if reference == 0.0 or hidden <= ratio_of(threshold_db + FAINT_DB) * reference:
        return reference
    return reference_echo(np.where(brightest > 0.0, brightest, hidden))


def _vertex(before: Array, at: Array, after: Array) -> Array:
    """Offset, in samples, of the peak of the parabola through three samples; zero if the middle one is no maximum."""
    curvature = np.where((at >= before) & (at >= after), before - 2.0 * at + after, 0.0)
    return np.divide(0.5 * (before - after), curvature, out=np.zeros_like(at), where=curvature < 0.0)


def find_pixels(view: ImageView, *, threshold_db: float) -> Echoes:
    """Echoes of the published algorithm: every sample above a threshold [dB] relative to the brightest sample.

    The length of each echo is the area of its sample over the range cell [m].
    """
    brightest = float(view.amplitude.max())
    threshold = brightest * ratio_of(threshold_db)
    rows, columns = np.nonzero((view.amplitude >= threshold) & (view.amplitude > 0.0))
    points = view.to_points(view.range[rows], view.u[columns])
    area = view.dr * view.cross_cell(points) * view.du / view.u_cell
    return Echoes.pixels(points, view.range[rows], columns, area / view.range_cell, brightest, threshold)
