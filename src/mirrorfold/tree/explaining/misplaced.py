"""Echoes that come from elsewhere than their place in the image, found with the sweep.

Three causes are tested: grating lobes, waves from beyond the ambiguous range, and mixed paths. Each test is made once
in each resolution cell, at its brightest echo, and remembered.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import Array, Mask, Names
from mirrorfold.detection import Echoes, ImageView, View
from mirrorfold.detection.echoes import strongest_of
from mirrorfold.tree.explaining.corners import corner_ratio
from mirrorfold.tree.explaining.directions import confocal_share, direction_ratio
from mirrorfold.tree.explaining.lobes import LOBE, MARGIN_DB, lobe_level
from mirrorfold.tree.explaining.waves import SweepWaves
from mirrorfold.tree.explaining.wrapped import wrapping_ratio

SMALLEST_DIRECTION_RATIO, ABOVE_LOBES = 0.5, 1.4
"""Least `direction_ratio` of a true echo; where antennas are missing, at least `ABOVE_LOBES` times the height of their
grating lobe, but no more than halfway in decibels from that lobe to one. True echoes have ratios near one, glints of
faces somewhat less, mixed paths far below a half. Ghosts by grating lobes have the ratio of the lobe: a half if every
third antenna is missing, two thirds in chips of four antennas side by side, with gaps between the chips."""

LARGEST_WRAPPING_RATIO = 1.08
"""Largest `wrapping_ratio` of a true echo. True echoes fit waves from their own range at least as well as waves from
one ambiguous range farther away; echoes from there fit the latter several times better, if no other wave arrives with
them. Of 3400 true points, in 27 full-wave scenes and 12 of rays, none had more than 1.08 where the waves
differ; ten late echoes among several waves had 1.09 to 1.15."""

LATE, MIXED = "comes from beyond the ambiguous range", "left by one way and came back by another"

GHOST_CELLS, SAME_CELLS = 0.5, 0.1
"""Largest distance, in resolution cells, at which an echo is taken for a known one: in the same cell, and across the
border of a cell. The phase of an image that was kept in a file is rounded, which moves echoes a little."""

LIKE_A_CORNER = 1.1
"""Least `corner_ratio` of a right-angled corner. Of 152 bright echoes in 18 sweeps, the vertices of corners had 1.23 to
1.47, all others at most 1.04."""

Measure = Callable[[SweepWaves, ImageView, Array, Array], Array]
"""Measures echoes of a view, at ranges [m] and u, (n,) each, by the waves of a sweep, (n,)."""
Known = dict[tuple[Measure, float, float], float]


def misplaced(echoes: Echoes, waves: SweepWaves, view: ImageView, known: Known) -> Names:
    """Why echoes of a view come from elsewhere than they are seen, (n,): `LOBE`, `LATE`, `MIXED`, or "" if they do not.

    `known` holds the measurements of earlier calls, by range [m] and u; those of this call are added.
    """

    def measured(measure: Measure, some: Mask | slice = slice(None)) -> Array:
        return _once_a_cell(measure, echoes.position[some], echoes.amplitude[some], waves, view, known)

    lobe = echoes.amplitude <= ratio_of(MARGIN_DB) * measured(lobe_level)
    late = measured(wrapping_ratio) > LARGEST_WRAPPING_RATIO
    mixed, rest = np.zeros_like(late), ~(late | lobe)
    ghost = waves.grating_lobe
    least = max(SMALLEST_DIRECTION_RATIO, min(ABOVE_LOBES * ghost, np.sqrt(ghost)))
    mixed[rest] = measured(direction_ratio, rest) < least
    return np.select([lobe, late, mixed], [LOBE, LATE, MIXED], "")


def known_ghosts(echoes: Echoes, view: View, places: Array, explanation: Names) -> Names:
    """As `misplaced`, from known echoes at places (m, d) [m] of the image, with an `explanation` or "" each, (m,)."""
    known, own = view.in_cells(places), view.in_cells(echoes.position)
    distance, nearest = cKDTree(known).query(own)
    # One measurement holds for all echoes in a cell.
    alike = (np.floor(own) == np.floor(known[nearest])).all(axis=1) | (distance <= SAME_CELLS)
    return np.where(alike & (distance <= GHOST_CELLS), explanation[nearest], "")


def confocal(position: Array, amplitude: Array, waves: SweepWaves, view: ImageView, known: Known) -> Array:
    """`confocal_share` of echoes at positions (n, 2) [m] of the image, measured once in each resolution cell, (n,)."""
    return _once_a_cell(confocal_share, position, amplitude, waves, view, known)


def are_corners(position: Array, waves: SweepWaves, view: ImageView, known: Known) -> Mask:
    """Whether places (n, 2) [m] of the image show right-angled corners, measured once in each resolution cell, (n,)."""
    return _once_a_cell(corner_ratio, position, np.ones(len(position)), waves, view, known) > LIKE_A_CORNER


def known_confocal(position: Array, amplitude: Array, view: ImageView, places: Array, share: Array) -> Array:
    """As `confocal`, from the `share` (m,) measured before at places (m, 2) [m]; NaN for echoes elsewhere, (n,)."""
    distance, nearest = cKDTree(view.in_cells(places)).query(view.in_cells(position))
    return np.where(distance <= GHOST_CELLS, np.append(share, np.nan)[nearest], np.nan)


def known_corners(position: Array, view: ImageView, places: Array) -> Mask:
    """As `are_corners`, from the places (m, 2) [m] of corners that were found before."""
    return cKDTree(view.in_cells(places)).query(view.in_cells(position))[0] <= GHOST_CELLS


def _once_a_cell(
    measure: Measure, position: Array, amplitude: Array, waves: SweepWaves, view: ImageView, known: Known
) -> Array:
    """The result of a `measure` of echoes by waves, (n,), once in each resolution cell, at its brightest echo."""
    range_, u = view.to_polar(position)
    cell = np.unique(np.floor(view.in_cells(position)), axis=0, return_inverse=True)[1].ravel()
    brightest = strongest_of(cell, amplitude)
    where = [(measure, r, sine) for r, sine in zip(range_[brightest].tolist(), u[brightest].tolist(), strict=True)]
    if new := [place for place in where if place not in known]:
        range_, sine = np.array([place[1:] for place in new]).T
        known |= dict(zip(new, measure(waves, view, range_, sine).tolist(), strict=True))
    return np.array([known[place] for place in where])[cell]
