"""How likely it is that a surface stands where a point says, and how well its place is known.

An echo that was scattered more than once is weak and has few others beside it; it is dimmer than the face of the mirror
that seems to show it, and part of its energy comes back another way than it went. What was folded by mirrors that are
not known well enough lands beside its true place. How much each of these says was fitted to scenes whose truth is known
(logistic regression: Cox, J. R. Stat. Soc. B 20, 1958).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import expit

from mirrorfold.common.chains import chain_name
from mirrorfold.common.decibels import to_db
from mirrorfold.common.types import Array, Index
from mirrorfold.detection.mirrors.curved import dimming
from mirrorfold.detection.mirrors.mirror import turns
from mirrorfold.detection.views.view import View
from mirrorfold.folding.points import Points, joined
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.mirror_tree import MirrorTree, led_astray

TRUE_CELLS = 1.5
"""A point is true where a surface stands this close to it, in resolution cells."""

NEIGHBOUR_CELLS = 2.5
"""Echoes of one surface follow each other within this many resolution cells: speckle tears gaps of one cell."""

MOST_EXCESS_DB, MOST_ASTRAY = 20.0, 4.0
"""Levels over the threshold [dB], and distances astray in resolution cells, count as these where they are larger."""

LEAST_OVER_FACE_DB, MOST_OVER_FACE_DB = -20.0, 10.0
"""Levels against the mirror's own face [dB] count as these where they are lower, or higher."""

LEAST_SHARE = 0.7
"""Shares of energy that came back the way it went count as this where they are smaller: what arrives from elsewhere at
the same range lowers the share of a true echo, too."""

WEIGHTS = {
    "in line of sight": (-1.9, 0.02, 1.7, 0.0),
    "behind mirrors": (-2.45, 0.12, 1.27, -1.8),
    "on mirrors": (4.0, 0.0, 0.0, -1.8),
}
"""Weights of the first four columns of the `evidence`, for objects in line of sight, objects behind mirrors, and points
on the faces of mirrors. The weighted sum is the logarithm of the odds that a point is true. No point on a face was
false in the ray scenes; their 4.0 allows for one in fifty. Fitted by `benchmarks/confidence.py`, where ray scenes, of
four radars, and full waves weigh alike."""

WEIGHTS_MEASURED = {
    "in line of sight": (-8.6, 0.0, 2.5, 0.0, 6.1, 0.0),
    "behind mirrors": (-11.3, 0.0, 1.35, -3.6, 13.4, 0.11),
    "on mirrors": (4.0, 0.0, 0.0, -1.8, 0.0, 0.0),
}
"""Weights of all six columns, where the sweep has told how much of the energy came back the way it went."""

EXPLAINED = 0.1
"""Confidence of a point whose echo comes from elsewhere: the share of such points that stand at a surface by chance."""

OWN_ERROR = 0.3
"""Standard error of an echo's own place, in resolution cells along and across the line of sight."""


Shares = Callable[[Array, Array], Array]
"""Measures `confocal_share` of echoes, (n,), by their positions (n, d) [m] in the image and amplitudes (n,)."""


def judged(points: Points, found: Found, shares: Shares | None = None) -> Points:
    """The points with their confidence and standard errors; after them, echoes that come from elsewhere.

    Parameters
    ----------
    points : Points
        As `fold_back` returns them.
    found : Found
        The tree of mirrors and the echoes that the points were made of.
    shares : callable, optional
        Measures how much of the energy of objects' echoes came back the way it went.
    """
    view = found.sight.view
    if shares is not None:
        points = measured(points, shares)
    error, astray = errors(points, found.tree, view)
    given = evidence(points, view, astray, over_faces(points, found.tree))
    kind = kinds(points)
    seen, with_share = (np.array(list(weights.values()))[kind] for weights in (WEIGHTS, WEIGHTS_MEASURED))
    alone = np.sum(given[:, : seen.shape[1]] * seen, axis=1)
    odds = np.where(np.isfinite(given[:, 4]), np.sum(np.nan_to_num(given) * with_share, axis=1), alone)
    points = replace(points, error=error, confidence=expit(odds))
    # What is seen in a mirror is no likelier than the mirror.
    for node in found.tree.walk():
        if node.line is not None:
            name = chain_name(node.chain)
            behind = (points.chain == name) | np.char.startswith(points.chain, f"{name}/")
            points.confidence[behind] *= mirror_confidence(points, name)
    # A place that rests on whether an echo passed through a wall is no likelier than that.
    points.confidence[:] = np.fmin(points.confidence, np.maximum(points.passed, 1.0 - points.passed))
    return _with_ghosts(points, found)


def measured(points: Points, shares: Shares) -> Points:
    """The points with the shares of the objects among them; faces of mirrors, strong and straight, need none."""
    objects = points.mirror == ""
    share = np.full(len(points.initial), np.nan)
    share[objects] = shares(points.initial[objects], points.amplitude[objects])
    return replace(points, confocal=share)


def kinds(points: Points) -> Index:
    """Which row of `WEIGHTS` holds for each point, (n,): in line of sight 0, behind mirrors 1, on mirrors 2."""
    return np.where(points.mirror != "", 2, np.minimum(points.bounces, 1)).astype(np.intp)


def mirror_confidence(points: Points, mirror: str) -> float:
    """Mean confidence of the echoes on the face of a mirror, named by its chain; one if none lies on it."""
    own = points.confidence[(points.mirror == mirror) & ~points.interpolated]
    return float(own.mean()) if own.size else 1.0


def over_faces(points: Points, tree: MirrorTree) -> Array:
    """By how much objects are brighter than the median of the face of the mirror that shows them, (n,) [dB].

    What rough walls scatter twice is weaker than the face, which scatters once. Zero for objects that no mirror
    shows, or one on whose face no echo lies. What a curved mirror makes weaker by spreading the waves is added back.
    """
    level = np.zeros(len(points.initial))
    for chain, way in tree.ways().items():
        name = chain_name(chain)
        face, own = points.amplitude[points.mirror == name], (points.chain == name) & (points.mirror == "")
        if way and face.size and own.any():
            level[own] = to_db(dimming(way, points.initial[own]) * points.amplitude[own] / np.median(face))
    return level


def evidence(points: Points, view: View, astray: Array, over_face: Array) -> Array:
    """What speaks for and against each point, (n, 6).

    The columns are: one; the level over what the echo had to exceed [dB]; the logarithm to base 2 of the number of
    resolution cells nearby that hold points of the same chain and face, its own included; how far mirrors may have led
    the point astray, in resolution cells; the share of the energy in those cells nearby that came back the way it went,
    NaN where that is not known; and the level against the face of the mirror that shows the point [dB].
    """
    cells, count, share = view.in_cells(points.initial), np.ones(len(points.initial)), points.confocal.copy()
    kind = np.unique(np.char.add(np.char.add(points.chain, "|"), points.mirror), return_inverse=True)[1].ravel()
    for each in range(kind.max(initial=-1) + 1):
        own = kind == each
        count[own], share[own] = _neighbours(cells[own], share[own])
    excess = to_db(points.amplitude / np.maximum(points.exceeded, np.finfo(float).tiny))
    return np.column_stack([
        np.ones_like(count), np.clip(excess, 0.0, MOST_EXCESS_DB), np.log2(count), np.minimum(astray, MOST_ASTRAY),
        np.maximum(share, LEAST_SHARE), np.clip(over_face, LEAST_OVER_FACE_DB, MOST_OVER_FACE_DB),
    ])  # fmt: skip


def _neighbours(cells: Array, share: Array) -> tuple[Array, Array]:
    """For each of some points, at `cells` (n, d) in units of resolution cells: how many cells nearby hold a point, its
    own included, (n,); and the mean over these cells of the `share` (n,), where it is known in one of them, else NaN.
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
    """Standard errors of the positions, (n, d) [m]; and how far the mirrors may have led each point astray, (n,), in
    resolution cells.

    The place of an echo is known to `OWN_ERROR` of its resolution cell; that of a point on the face of a mirror, across
    the mirror, as well as the mirror's own place. Each mirror on the way moves all that it shows by twice its own
    error: by that of its offset as a whole, and by that of its angle as a turn about its center.
    """
    folds, dimensions = tree.folds(), points.position.shape[1]
    sight = points.initial - view.radar
    range_ = np.linalg.norm(sight, axis=1)
    sight /= np.maximum(range_, np.finfo(float).tiny)[:, None]
    along = np.einsum("ni,nj->nij", sight, sight)
    across = np.eye(dimensions) - along
    variance = (OWN_ERROR * view.range_cell) ** 2 * along
    variance += ((OWN_ERROR * view.cross_cell(points.initial)) ** 2)[:, None, None] * across
    led = np.zeros_like(variance)
    ways = tree.ways()
    for chain, way in ways.items():
        if way:
            on_it, mirror = points.mirror == chain_name(chain), way[-1]
            normal = mirror.facing(points.initial[on_it])[1]
            flat = np.eye(dimensions) - np.einsum("ni,nj->nij", normal, normal)
            variance[on_it] = flat @ variance[on_it] @ flat + mirror.strays(points.initial[on_it])
    for chain, way in ways.items():
        seen = points.chain == chain_name(chain)
        turn = turns(folds[chain], points.initial[seen])
        variance[seen] = turn @ variance[seen] @ np.swapaxes(turn, -1, -2)
        led[seen] = led_astray(points.initial[seen], way)
    astray = np.sqrt(np.trace(led, axis1=1, axis2=2)) / np.asarray(view.cell(range_))
    return np.sqrt(np.einsum("nii->ni", variance + led)), astray


def _with_ghosts(points: Points, found: Found) -> Points:
    """The points, and after them echoes that come from elsewhere, where the image shows them."""
    echoes = found.elsewhere
    error = np.full_like(echoes.position, np.nan)
    ghosts = Points.of(echoes, echoes.position, confidence=EXPLAINED, error=error, explanation=found.explanation)
    return joined(points, ghosts)
