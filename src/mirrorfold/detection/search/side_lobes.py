"""Rows of side lobes, which are no mirrors.

Side lobes stand at the range of their echo, in a row about the radar. Those of the whole array are known, and are never
taken for echoes. Those of a glint that only a part of the array sees are higher, see `ImageView.part_lobes`.
"""

from __future__ import annotations

from mirrorfold.common.types import Array
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.views.image_view import EDGE_CELLS, ImageView

LARGEST_SHARE = 0.5
"""Largest share of a row, by weight, that may be side lobes: it was 1.0 in rows of side lobes, and at most 0.18 in all
other rows of 30 scenes, of rays and of full waves."""


def are_side_lobes(row: Echoes, weight: Array, view: ImageView) -> bool:
    """Whether most of a row may be side lobes of brighter echoes beyond its ends.

    A bright echo in the row itself does not count: a wall that faces the radar shows a glint, and stands at one range.

    Parameters
    ----------
    row : Echoes
    weight : (n,) array
        The weight of each of its echoes.
    view : ImageView
    """
    if not len(row):
        return False
    level, brightest = view.brightest_at(row.range)
    u, sine, reach = view.u[brightest], view.u[row.direction], EDGE_CELLS * view.u_cell
    beyond = (u < sine.min() - reach) | (u > sine.max() + reach)
    lobe = view.part_lobes(level, sine - u)
    return bool(weight[beyond & (row.amplitude <= lobe)].sum() > LARGEST_SHARE * weight.sum())
