"""How likely it is that a surface stands where a point says, and how well its place is known.

An echo that was scattered more than once is weak, and few echoes stand beside it. It is dimmer than the face of the
mirror behind which it appears, and part of its energy comes back by another way than it went. An echo that was folded
by mirrors whose places are uncertain lands beside its true place. These facts are the features of a point. Their
weights were fitted to scenes whose truth is known (logistic regression: Cox, J. R. Stat. Soc. B 20, 1958).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import expit

from mirrorfold.common.chains import chain_name
from mirrorfold.common.decibels import to_db
from mirrorfold.common.geometry import unit_or_zero
from mirrorfold.common.types import Array, Index
from mirrorfold.detection import ImageView, View
from mirrorfold.detection.mirrors.curved import dimming
from mirrorfold.detection.mirrors.mirror import turns
from mirrorfold.folding.points import Points, joined
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining.corners import Corners
from mirrorfold.tree.mirror_tree import MirrorTree, place_covariance
from mirrorfold.tree.rounds import OWN_SHARE

TRUE_CELLS = 1.5
"""A point is true if a surface stands within this many resolution cells of it."""

NEIGHBOUR_CELLS = 2.5
"""Echoes of one surface follow each other within this many resolution cells: speckle tears gaps of one cell."""

MOST_EXCESS_DB, LARGEST_MIRROR_ERROR = 20.0, 4.0
"""Upper limits of two features: larger levels over the threshold [dB], and larger errors of the place by mirrors, in
resolution cells, count as these."""

LEAST_OVER_FACE_DB, MOST_OVER_FACE_DB = -20.0, 10.0
"""Limits of the level against the face of the mirror [dB]: lower and higher levels count as these."""

LEAST_SHARE = 0.7
"""Share of energy that came back the way it went, as which smaller shares count: what arrives from elsewhere at the
same range lowers the share of a true echo, too. In line of sight, it counts as it is below `OWN_SHARE`, with which most
of the energy came back another way. Behind mirrors, what is left of such echoes, once mixed paths were taken out, is
mostly true."""

FEATURES = "one", "excess", "neighbours", "astray", "share", "over", "deeper"
"""Names of the columns of `features`."""

Weights = Mapping[str, Sequence[float]]
"""The weight of each of the `FEATURES`, for each kind of point."""

WEIGHTS: Weights = {
    "in line of sight": (-1.9, 0.02, 1.7, 0.0, 0.0, 0.0, 0.0),
    "behind mirrors": (-2.45, 0.12, 1.27, -1.8, 0.0, 0.0, 0.0),
    "on mirrors": (4.0, 0.0, 0.0, -1.8, 0.0, 0.0, -3.4),
}
"""Weights of the columns of `features`, for objects in line of sight, objects behind mirrors, and points on the faces
of mirrors. The weighted sum is the logarithm of the odds that a point is true, if the mirrors on its way are. These are
for echoes whose share is not known, where both arrays resolve directions. Hardly any face behind one mirror is false;
the weight 4.0 allows for one in fifty. Behind two mirrors half of the faces are false: mixed paths in front of a wall
pass for the second mirror, and the wall is folded by one mirror too many. The weight for that, -3.4, is such that 0.62
of the objects that these walls show are true; faces alone would give -4.0. Fitted by `benchmarks/confidence.py`, where
ray scenes, of four radars, and full-wave scenes have equal weight. The weight of 4.0 is less than the fit to ray scenes
gives, 5.1, which is too sure in corridors that were not used for it."""

WEIGHTS_ONE_WAY: Weights = {
    "in line of sight": (-2.24, 0.14, 0.55, 0.0, 0.0, 0.0, 0.0),
    "behind mirrors": (-0.29, 0.11, 0.05, -1.8, 0.0, 0.09, 0.0),
    "on mirrors": (-3.3, 0.22, 1.42, -1.8, 0.0, 0.0, 0.0),
}
"""The same where one array alone resolves directions: few antennas send and many receive, or one antenna moves. Mixed
paths, out by one way and back by another, are then as sharp as true echoes, and many a row of them passes for a wall.
Fitted to ray scenes of such radars; the weights of errors of mirrors are those above, for they do not depend on the
radar."""

WEIGHTS_MEASURED: Weights = {
    "in line of sight": (-8.6, 0.0, 2.5, 0.0, 6.1, 0.0, 0.0),
    "behind mirrors": (-11.3, 0.0, 1.35, -3.6, 13.4, 0.11, 0.0),
    "on mirrors": (5.0, 0.0, 0.0, -1.8, 0.0, 0.0, 0.0),
}
"""The same where the sweep tells how much of the energy came back the way it went, and helped to find the mirrors. Of
some 170 mirrors in 67 scenes by rays and full waves, none is then false; the weight 5.0 allows for one in 150."""

TABLES = WEIGHTS, WEIGHTS_ONE_WAY, WEIGHTS_MEASURED
"""All weights, in the order of `table_numbers`."""

EXPLAINED = 0.1
"""Confidence of a point whose echo does not come from where the image shows it: the share of such points near a
surface by chance."""

OWN_ERROR = 0.3
"""Standard error of an echo's place in the image, in resolution cells, along and across the line of sight."""


Shares = Callable[[Array, Array], Array]
"""Measures the `confocal_share` (n,) of echoes from their positions (n, d) [m] in the image and amplitudes (n,)."""


def with_confidence(
    points: Points, found: Found, shares: Shares | None = None, corners: Corners | None = None
) -> Points:
    """The points with confidence and standard errors; appended, the echoes that do not come from where they are seen.

    The points are those that `fold_back` makes of what was `found`. `shares` measures how much of the energy of an
    object's echo came back the way it went; `corners` tells which echoes are those of right-angled corners.
    """
    view = found.sight.view
    if shares is not None:
        points = with_confocal_shares(points, shares, corners)
    error, mirror_error = errors(points, found.tree, view)
    values = features(points, view, mirror_error, over_faces(points, found.tree))
    table = table_numbers(points, values, view, by_sweep=shares is not None)
    points = replace(points, error=error, confidence=judged(points, found.tree, values, table))
    # A place that depends on whether an echo passed through a wall is no surer than that it did, or that it did not.
    points.confidence[:] = np.fmin(points.confidence, np.where(points.wall == "", 1.0 - points.passed, points.passed))
    if shares is not None and isinstance(view, ImageView):
        points = _with_shares_of_blurs(points, view, shares)
    echoes, nowhere = found.explained, np.full_like(found.explained.position, np.nan)
    ghosts = Points.of(echoes, echoes.position, confidence=EXPLAINED, error=nowhere, explanation=found.explanation)
    return joined(points, ghosts)


def judged(points: Points, tree: MirrorTree, values: Array, table: Index, tables: Sequence[Weights] = TABLES) -> Array:
    """The confidence of points, (n,), by their `features`, and the weights in one of the `tables` for each point."""
    weights = np.array([list(each.values()) for each in tables])[table, weight_rows(points)]
    points = replace(points, confidence=expit(np.sum(np.nan_to_num(values) * weights, axis=1)))
    multiply_by_mirrors(points, tree)
    return points.confidence


def table_numbers(points: Points, values: Array, view: View, *, by_sweep: bool) -> Index:
    """The number of the weights among `TABLES` for each point, (n,), by its `features` and whether there was a sweep.

    The sweep is not asked for the share of faces, but helped to find the mirrors.
    """
    measured = np.isfinite(values[:, FEATURES.index("share")]) | (by_sweep & (points.mirror != ""))
    return np.where(measured, 2, int(isinstance(view, ImageView) and view.one_way))


def multiply_by_mirrors(points: Points, tree: MirrorTree) -> None:
    """Multiply the confidence of points, in place, by that of the mirrors on their way: false ones fold wrongly."""
    for node in tree.walk():
        if node.mirror is not None:
            name = chain_name(node.chain)
            # The echoes on its face have the mirrors before it on their way, and were multiplied by them.
            points.confidence[points.chain == name] *= mirror_confidence(points, name)


def with_confocal_shares(points: Points, shares: Shares, corners: Corners | None = None) -> Points:
    """The points with the confocal shares of objects; faces of mirrors, which are strong and straight, need none.

    A right-angled corner sends most of the wave from one leg to the other, and back from there. It is a single thing
    even so, and in line of sight its share counts as one. Behind a mirror, the image of another corner of the room may
    return the same wave.
    """
    objects = points.mirror == ""
    share = np.full(len(points.initial), np.nan)
    share[objects] = shares(points.initial[objects], points.amplitude[objects])
    if corners is not None:
        asked = np.flatnonzero((share < OWN_SHARE) & (points.bounces == 0))
        share[asked[corners(points.initial[asked])]] = 1.0
    return replace(points, confocal=share)


def _with_shares_of_blurs(points: Points, view: ImageView, shares: Shares) -> Points:
    """The points with the confocal shares of echoes on faces that blur their wall: folding again asks for them."""
    blurs = (points.mirror != "") & ~points.interpolated
    blurs &= np.isin(points.initial @ (1.0, 1j), view.misplaced @ (1.0, 1j))
    if not blurs.any():
        return points
    share = points.confocal.copy()
    share[blurs] = shares(points.initial[blurs], points.amplitude[blurs])
    return replace(points, confocal=share)


def weight_rows(points: Points) -> Index:
    """The row of `WEIGHTS` for each point, (n,): 0 in line of sight, 1 behind mirrors, 2 on the faces of mirrors."""
    return np.where(points.mirror != "", 2, np.minimum(points.bounces, 1)).astype(np.intp)


def mirror_confidence(points: Points, mirror: str) -> float:
    """Mean confidence of the echoes on the face of the mirror with that chain.

    If no echo lies on the face, that of the mirror that shows it; one for a mirror in line of sight.
    """
    own = points.confidence[(points.mirror == mirror) & ~points.interpolated]
    if own.size:
        return float(own.mean())
    before = mirror.rpartition("/")[0]
    return mirror_confidence(points, before) if before else 1.0


def over_faces(points: Points, tree: MirrorTree) -> Array:
    """Level of each object over the median level of the face of the mirror that shows it, (n,) [dB].

    Waves that rough walls scatter twice are weaker than the echo of the face, which scatters once. The level is zero
    for objects in line of sight, and where no echo lies on the face. The loss by a curved mirror, which spreads the
    waves, is added back.
    """
    level = np.zeros(len(points.initial))
    for chain, way in tree.mirrors_by_chain().items():
        name = chain_name(chain)
        face, own = points.amplitude[points.mirror == name], (points.chain == name) & (points.mirror == "")
        if way and face.size and own.any():
            level[own] = to_db(dimming(way, points.initial[own]) * points.amplitude[own] / np.median(face))
    return level


def features(points: Points, view: View, mirror_error: Array, over_face: Array) -> Array:
    """The features of each point that speak for or against it, (n, 7), in the order of `FEATURES`.

    The columns are: (0) one; (1) the level over what the echo had to exceed [dB]; (2) the logarithm to base 2 of the
    number of resolution cells nearby, its own included, that hold points of the same chain and face; (3) the error of
    the place by the errors of mirrors, `mirror_error`, in resolution cells; (4) the mean share of the energy in those
    cells that came back the way it went, NaN where it is not known; (5) the level over the face of the mirror [dB]; (6)
    the number of mirrors on the way after the first.
    """
    cells, count, share = view.in_cells(points.initial), np.ones(len(points.initial)), points.confocal.copy()
    kind = np.unique(np.char.add(np.char.add(points.chain, "|"), points.mirror), return_inverse=True)[1].ravel()
    for each in range(kind.max(initial=-1) + 1):
        own = kind == each
        count[own], share[own] = _neighbours(cells[own], share[own])
    foreign = (points.bounces == 0) & (share < OWN_SHARE)
    share = np.where(foreign, share, np.maximum(share, LEAST_SHARE))
    excess = to_db(points.amplitude / np.maximum(points.exceeded, np.finfo(float).tiny))
    return np.column_stack([
        np.ones_like(count), np.clip(excess, 0.0, MOST_EXCESS_DB), np.log2(count),
        np.minimum(mirror_error, LARGEST_MIRROR_ERROR), share,
        np.clip(over_face, LEAST_OVER_FACE_DB, MOST_OVER_FACE_DB), np.maximum(points.bounces - 1.0, 0.0),
    ])  # fmt: skip


def _neighbours(cells: Array, share: Array) -> tuple[Array, Array]:
    """For points at `cells` (n, d), in units of resolution cells: the number of cells nearby that hold a point, (n,).

    The point's own cell counts. Also the mean of the `share` (n,) over these cells, (n,); NaN if it is known in none.
    """
    filled, which = np.unique(np.rint(cells), axis=0, return_inverse=True)
    which, near = which.ravel(), cKDTree(filled).query_ball_point(filled, NEIGHBOUR_CELLS)
    known = np.isfinite(share)
    number = np.bincount(which[known], minlength=len(filled))
    total = np.bincount(which[known], weights=share[known], minlength=len(filled))
    with np.errstate(invalid="ignore"):
        each = total / number
    mean = np.array([np.mean(each[some][number[some] > 0]) if number[some].any() else np.nan for some in near])
    return np.array([len(some) for some in near], dtype=float)[which], mean[which]


def errors(points: Points, tree: MirrorTree, view: View) -> tuple[Array, Array]:
    """Standard errors of positions, (n, d) [m]; and the part due to errors of mirrors, (n,), in resolution cells.

    The place of an echo in the image is known to `OWN_ERROR` of its resolution cell. Across the face of a mirror, a
    point on it is known as well as the mirror itself. Each mirror on the way moves what it shows by twice its own
    error: the error of its offset shifts the points, the error of its angle turns them about its center.
    """
    dimensions = points.position.shape[1]
    sight, range_ = unit_or_zero(points.initial - view.radar), np.linalg.norm(points.initial - view.radar, axis=1)
    along = np.einsum("ni,nj->nij", sight, sight)
    across = np.eye(dimensions) - along
    variance = (OWN_ERROR * view.range_cell) ** 2 * along
    variance += ((OWN_ERROR * view.cross_cell(points.initial)) ** 2)[:, None, None] * across
    mirror_variance = np.zeros_like(variance)
    for node in tree.walk():
        if (mirror := node.mirror) is not None:
            on_it = points.mirror == chain_name(node.chain)
            normal = mirror.facing(points.initial[on_it])[1]
            flat = np.eye(dimensions) - np.einsum("ni,nj->nij", normal, normal)
            variance[on_it] = flat @ variance[on_it] @ flat + mirror.displacement_covariance(points.initial[on_it])
    for node in tree.walk():
        seen = points.chain == chain_name(node.chain)
        turn = turns(node.fold, points.initial[seen])
        variance[seen] = turn @ variance[seen] @ np.swapaxes(turn, -1, -2)
        mirror_variance[seen] = place_covariance(points.initial[seen], node.way)
    cell = view.cell(range_, np.maximum(points.growth, 1.0))
    mirror_error = np.sqrt(np.trace(mirror_variance, axis1=1, axis2=2)) / cell
    return np.sqrt(np.einsum("nii->ni", variance + mirror_variance)), mirror_error
