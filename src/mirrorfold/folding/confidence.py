"""How likely it is that something stands where a point says, and how well its place is known.

An echo of multiple scattering is weak and lonely, and what was folded by mirrors that are not known well enough lands
somewhere else. How much each of these says was fitted to scenes whose truth is known (logistic regression: Cox,
J. R. Stat. Soc. B 20, 1958).
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import expit

from mirrorfold.common.chains import chain_name
from mirrorfold.common.decibels import to_db
from mirrorfold.common.types import Array, Index
from mirrorfold.detection.view import View
from mirrorfold.folding.points import Points
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.mirror_tree import MirrorTree, led_astray

TRUE_CELLS = 1.5
"""A point is true where something stands this close to it, in resolution cells."""

NEIGHBOUR_CELLS = 2.5
"""Echoes of one surface follow each other within this many resolution cells: speckle tears gaps of one cell."""

MOST_EXCESS_DB, MOST_ASTRAY = 20.0, 4.0
"""More than this level over the threshold, or this many cells astray, say no more."""

WEIGHTS = {
    "in line of sight": (-1.9, 0.02, 1.7, 0.0),
    "behind mirrors": (-2.45, 0.12, 1.27, -1.8),
    "on mirrors": (4.0, 0.0, 0.0, -1.8),
}
"""Of the `evidence` in the logarithm of the odds, for objects in line of sight and behind mirrors, and for points on
faces of mirrors: of these none was false in ray scenes, and one in fifty is allowed for. Fitted by
`benchmarks/confidence.py`, where ray scenes, of four radars, and full waves weigh alike."""

EXPLAINED = 0.1
"""Probability of a point whose echo is explained otherwise: the share of them that stand at a surface by chance."""

OWN_ERROR = 0.3
"""Standard error of an echo's own place, in resolution cells along and across the line of sight."""


def judged(points: Points, found: Found) -> Points:
    """The points with their confidence and standard errors, and those whose echoes come from elsewhere.

    Parameters
    ----------
    points : Points
        As `fold_back` returns them.
    found : Found
        What they came from.
    """
    view = found.sight.view
    error, astray = errors(points, found.tree, view)
    odds = np.sum(evidence(points, view, astray) * np.array(list(WEIGHTS.values()))[kinds(points)], axis=1)
    points = replace(points, error=error, confidence=expit(odds))
    # What is seen in a mirror is no likelier than the mirror.
    for node in found.tree.walk():
        if node.line is not None:
            name = chain_name(node.chain)
            behind = (points.chain == name) | np.char.startswith(points.chain, f"{name}/")
            points.confidence[behind] *= mirror_confidence(points, name)
    return _with_ghosts(points, found)


def kinds(points: Points) -> Index:
    """Which of `WEIGHTS` each point has, (n,)."""
    return np.where(points.mirror != "", 2, np.minimum(points.bounces, 1)).astype(np.intp)


def mirror_confidence(points: Points, mirror: str) -> float:
    """Mean of that of all points on the face of a mirror, named by its chain; one if it was given without any."""
    own = points.confidence[points.mirror == mirror]
    return float(own.mean()) if own.size else 1.0


def evidence(points: Points, view: View, astray: Array) -> Array:
    """What speaks for and against each point, (n, 4).

    One; the level over what had to be exceeded [dB]; the logarithm to base 2 of the number of resolution cells nearby
    in which others of the same kind stand; and how far astray mirrors may have led it, in resolution cells.
    """
    cells, count = view.in_cells(points.initial), np.ones(len(points.initial))
    kind = np.unique(np.char.add(np.char.add(points.chain, "|"), points.mirror), return_inverse=True)[1].ravel()
    for each in range(kind.max(initial=-1) + 1):
        own = kind == each
        count[own] = _neighbours(cells[own])
    excess = to_db(points.amplitude / np.maximum(points.exceeded, np.finfo(float).tiny))
    return np.column_stack([
        np.ones_like(count), np.clip(excess, 0.0, MOST_EXCESS_DB), np.log2(count), np.minimum(astray, MOST_ASTRAY)
    ])  # fmt: skip


def _neighbours(cells: Array) -> Array:
    """In how many resolution cells nearby others stand, itself included, by their places in cells (n, d)."""
    filled, which = np.unique(np.rint(cells), axis=0, return_inverse=True)
    count = cKDTree(filled).query_ball_point(filled, NEIGHBOUR_CELLS, return_length=True)
    return np.asarray(count, dtype=float)[which.ravel()]


def errors(points: Points, tree: MirrorTree, view: View) -> tuple[Array, Array]:
    """Standard errors of the positions, (n, d) [m]; and how far astray the mirrors may have led each, in cells, (n,).

    An echo is known to a part of its resolution cell; what lies on a mirror, to that of the mirror. Each mirror on the
    way moves all behind it by twice its own errors, as a whole and by turning about its center.
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
            flat = np.eye(dimensions) - np.outer(mirror.normal, mirror.normal)
            variance[on_it] = flat @ variance[on_it] @ flat + mirror.strays(points.initial[on_it])
    for chain, way in ways.items():
        seen, turn = points.chain == chain_name(chain), folds[chain].linear
        variance[seen] = turn @ variance[seen] @ turn.T
        led[seen] = led_astray(points.initial[seen], way)
    astray = np.sqrt(np.trace(led, axis1=1, axis2=2)) / np.asarray(view.cell(range_))
    return np.sqrt(np.einsum("nii->ni", variance + led)), astray


def _with_ghosts(points: Points, found: Found) -> Points:
    """The points, and after them echoes that come from elsewhere, where the image shows them."""
    echoes = found.elsewhere
    nothing = np.full(len(echoes), "")
    ghosts = Points(
        echoes.position, echoes.position, echoes.amplitude, np.maximum(echoes.noise, echoes.limit),
        np.zeros(len(echoes), dtype=np.int32), nothing, nothing, np.full(len(echoes), EXPLAINED),
        np.full_like(echoes.position, np.nan), found.explanation,
    )  # fmt: skip
    return Points(*(np.concatenate([getattr(both, item.name) for both in (points, ghosts)]) for item in fields(points)))
