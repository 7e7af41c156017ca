"""Echoes so weak beside the brightest one at their range that they may be side lobes of it.

The side lobes of a full aperture of equal antennas are known, and are never taken for echoes. The side lobes of a real
array are higher. Antennas that differ by a few percent leave lobes 40 dB below a bright glint in all directions. And if
only a part of the array sees the glint, past the end of a mirror or beside an object, its lobes fall no faster than
``1 / (pi D u / lambda)``, or if the part is small they are higher still, and stand at one range; and no dark place
separates them from the glint. Echoes like that are left out once the whole tree is found. Until then they hide what is
behind them, and a wall may go on through them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.spatial import cKDTree

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import Mask
from mirrorfold.detection import Echoes, ImageView
from mirrorfold.detection.search.side_lobes import RING_DEPTH, at_one_range, may_be_lobes
from mirrorfold.detection.views.image_view import SAMPLES_PER_CELL
from mirrorfold.tree.grouping import connected

OUTSHONE = "may be a side lobe of a much brighter one"

OUTSHONE_DB = 40.0
"""An echo weaker by this than the brightest echo within a range cell of its range is no evidence of an object."""

DARK_DB, RING_CELLS = 6.0, 5.0
"""A place between an echo and a brighter one at the same range is dark if it is weaker by this than the echo, over a
resolution cell: lobes grow towards their glint, and an object of its own ends somewhere. Echoes nearer to the glint
than so many cells may be of the same object: a row of that length at one range may be a mirror."""

LONGEST_ROW, RING_DB = 20.0, 12.0
"""A row at one range that is longer than so many resolution cells is a ring of side lobes, if it is weaker by so much
than the brightest echo at its range, be the image dark between them or not. A wall around the radar would stand at one
range, too, but is as bright on all sides."""


def outshone(objects: Echoes, view: ImageView) -> Mask:
    """Which objects may be side lobes of brighter echoes at their range, (n,).

    Side lobes have the same distance as their echo from that place along the array where the part that sees the echo
    begins or ends. This place is not known, so all are tried.
    """
    found = np.zeros(len(objects), dtype=bool)
    for place in view.places_along if len(objects) else ():
        distance = np.linalg.norm(objects.position - view.radar - place * view.along, axis=1)
        found |= _outshone(replace(objects, range=distance), view.from_along(place))
    return found


def _outshone(objects: Echoes, view: ImageView) -> Mask:
    """As `outshone`, with the ranges of objects and view from one place along the array."""
    level, brightest = view.brightest_at(objects.range)
    found = objects.amplitude < level * ratio_of(-OUTSHONE_DB)
    aside = np.abs(view.u[objects.direction] - view.u[brightest])
    lobes = may_be_lobes(objects, view, level, aside) & (aside > RING_CELLS * view.u_cell)
    found |= _in_rings(objects, view) & (objects.amplitude <= level * ratio_of(-RING_DB))
    row = view.row(objects.range)
    for i in np.flatnonzero(lobes & ~found):
        first, last = sorted((int(objects.direction[i]), int(brightest[i])))
        rows = slice(max(row[i] - SAMPLES_PER_CELL, 0), row[i] + SAMPLES_PER_CELL + 1)
        between = view.amplitude[rows, first : last + 1].max(axis=0)
        least = maximum_filter1d(between, SAMPLES_PER_CELL).min()
        found[i] = least >= objects.amplitude[i] * ratio_of(-DARK_DB)
    return found


def _in_rings(objects: Echoes, view: ImageView) -> Mask:
    """Which objects are in rows at one range that are longer than `LONGEST_ROW`, (n,)."""
    at_one = np.flatnonzero(at_one_range(objects, view, np.arange(len(objects))))
    u = view.u[objects.direction[at_one]] / view.u_cell
    places = np.column_stack([u, objects.range[at_one] / (RING_DEPTH * view.range_cell)])
    ring = connected(cKDTree(places).query_pairs(1.0, p=np.inf, output_type="ndarray"), len(places))
    longest = [np.ptp(u[ring == number]) for number in range(ring.max(initial=-1) + 1)]
    found = np.zeros(len(objects), dtype=bool)
    found[at_one] = np.array(longest)[ring] > LONGEST_ROW
    return found
