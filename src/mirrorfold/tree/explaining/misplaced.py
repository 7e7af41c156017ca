"""Echoes that come from elsewhere than where they stand in the image, told by the sweep."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from mirrorfold.common.types import Array, Names
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.tree.explaining.directions import confocal_share, direction_ratio, grating_lobe
from mirrorfold.tree.explaining.lobes import LOBE, MARGIN_DB, lobe_level
from mirrorfold.tree.explaining.wrapped import wrapping_ratio

SMALLEST_DIRECTION_RATIO, ABOVE_LOBES = 0.5, 1.4
"""True echoes have ratios near one, glints of faces somewhat less, mixed paths far below a half. Where antennas are
missing, ghosts by grating lobes have the ratio of the lobe (a half, if every third is): then this many times it."""

LARGEST_WRAPPING_RATIO = 1.15
"""Echoes fit at least as well to the waves of where they stand as to those from one ambiguous range farther away; those
from there fit several times better. Far away, where waves are flat either way, both fit alike."""

LATE, MIXED = "comes from beyond the ambiguous range", "left by one way and came back by another"

GHOST_CELLS = 0.5
"""An echo this close, in resolution cells, to a ghost that outshines it, or to a known one, is that ghost."""

Measure = Callable[[xr.Dataset, ImageView, Array, Array], Array]
Known = dict[tuple[Measure, float, float], float]


def misplaced(echoes: Echoes, sweep: xr.Dataset, view: ImageView, known: Known | None = None) -> Names:
    """What makes echoes of a view stand elsewhere than where they are seen, (n,); empty for those that do not.

    `known` holds what was measured in earlier calls, by range [m] and u; what is measured now is added.
    """
    known = {} if known is None else known
    claimed = 10.0 ** (MARGIN_DB / 20.0) * _measured(lobe_level, echoes.position, sweep, view, known)
    beside = echoes.amplitude <= claimed
    late = _measured(wrapping_ratio, echoes.position, sweep, view, known) > LARGEST_WRAPPING_RATIO
    mixed = np.zeros_like(late)
    rest = ~(late | beside)
    least = max(SMALLEST_DIRECTION_RATIO, ABOVE_LOBES * grating_lobe(sweep))
    mixed[rest] = _measured(direction_ratio, echoes.position[rest], sweep, view, known) < least
    return _with_flanks(np.select([beside, late, mixed], [LOBE, LATE, MIXED], ""), echoes, view)


def _with_flanks(explanation: Names, echoes: Echoes, view: View) -> Names:
    """The same, with the flanks of ghosts: weaker echoes close to one, which its waves make and which may seem true."""
    tree, out = cKDTree(view.in_cells(echoes.position)), explanation.copy()
    for ghost in sorted(np.flatnonzero(explanation != ""), key=echoes.amplitude.__getitem__):
        close = np.array(tree.query_ball_point(tree.data[ghost], GHOST_CELLS))
        flank = (explanation[close] == "") & (echoes.amplitude[close] < echoes.amplitude[ghost])
        out[close[flank]] = explanation[ghost]
    return out


def known_ghosts(echoes: Echoes, view: View, places: Array, explanation: Names) -> Names:
    """`misplaced` by ghosts that are known from before, at places (m, d) [m] with an `explanation` each, (m,)."""
    distance, nearest = cKDTree(view.in_cells(places)).query(view.in_cells(echoes.position))
    return np.where(distance <= GHOST_CELLS, explanation[nearest], "")


def confocal(position: Array, sweep: xr.Dataset, view: ImageView, known: Known) -> Array:
    """`confocal_share` of echoes at positions (n, 2) [m] of the image, (n,)."""
    return _measured(confocal_share, position, sweep, view, known)


def known_confocal(position: Array, view: ImageView, places: Array, share: Array) -> Array:
    """`confocal` by what was measured before at places (m, 2) [m]: its `share` (m,), NaN for echoes elsewhere, (n,)."""
    if not len(places):
        return np.full(len(position), np.nan)
    distance, nearest = cKDTree(view.in_cells(places)).query(view.in_cells(position))
    return np.where(distance <= GHOST_CELLS, share[nearest], np.nan)


def _measured(measure: Measure, position: Array, sweep: xr.Dataset, view: ImageView, known: Known) -> Array:
    """What `measure` says of each echo at positions (n, 2) [m], (n,); only those that are not yet known are asked."""
    range_, u = view.to_polar(position)
    where = [(measure, r, sine) for r, sine in zip(range_.tolist(), u.tolist(), strict=True)]
    if new := [place for place in dict.fromkeys(where) if place not in known]:
        range_, sine = np.array([place[1:] for place in new]).T
        known |= dict(zip(new, measure(sweep, view, range_, sine).tolist(), strict=True))
    return np.array([known[place] for place in where])
