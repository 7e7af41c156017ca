"""Step 2 in three dimensions, second half: flat sheets of echoes are mirrors.

Planes are proposed by three echoes of neighbouring directions, judged by the echoes they pass near (random sample
consensus: Fischler and Bolles, Comm. ACM 24, 1981), refitted to the volume by centroids across them, and tested: large
enough, filled and flat. Their extent is the set of beams that show them.
"""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
from scipy.ndimage import binary_closing, binary_fill_holes, binary_opening, label

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.plane_fit import refitted, weighted_plane
from mirrorfold.detection.plane_mirror import PlaneMirror, hull, plane_points, plane_ranges
from mirrorfold.detection.volume_view import VolumeView

MINIMUM_CELLS = 7.5
"""Smallest width and height of a mirror in resolution cells: any surface is flat over a few of them, and a cloud of
single echoes may be by chance."""

SAGITTA_CELLS = 0.16
"""A sheet that bulges by more than this many resolution cells is a curved object, not a plane mirror: a sheet of a
hundred cells tells that twice as well as a row of ten."""

SMALLEST_FILL = 0.5
"""Share of its beams in which a mirror's own echo must stand."""

PROPOSALS = 300
"""Triples drawn for each plane. One in ten falls on a wall that holds a third of the echoes, so that the chance that
none of all these does is `0.9^300`."""

PARTNER_STEPS = (5, 18)
"""How many beams the other two echoes of a triple are away: beyond the speckle of one beam, within one wall."""

JUDGES = 3000
"""Echoes, evenly drawn, that judge a proposal."""

FEWEST_ECHOES = 30
"""A sheet of fewer echoes says too little about its direction."""

MAXIMUM_PLANES = 24
FAILURES = 2
"""A room has a dozen visible walls; after so many proposals in a row that are no mirrors there are no more."""

GAP_BEAMS = 3
"""A wall goes on behind gaps of this many beams: speckle fades over one or two."""

CLIP = 2.0
"""Echoes weigh with their amplitude up to this many times the median, so that glints do not steer a fit."""


def find_planes(
    echoes: Echoes,
    view: VolumeView,
    *,
    minimum_length: float,
    tested: bool = True,
    seed: int = 0,
) -> list[PlaneMirror]:
    """Plane mirrors among the visible echoes of a volume, from the largest.

    Parameters
    ----------
    echoes : Echoes
    view : VolumeView
    minimum_length : float [m]
        Smallest width and height.
    tested : bool
        Whether a sheet must be filled and flat, not only large enough.
    seed : int
        Of the random proposals.

    Returns
    -------
    list of PlaneMirror
    """
    generator = np.random.default_rng(seed)
    free = echoes.visible.copy()
    found: list[PlaneMirror] = []
    failures = 0
    for _ in range(MAXIMUM_PLANES):
        open_ = np.flatnonzero(free)
        if open_.size < FEWEST_ECHOES or failures > FAILURES:
            break
        proposal = _propose(echoes.take(open_), view, generator)
        if proposal is None:
            break
        mirror, member = _settle(*proposal, echoes, free, view, minimum_length, tested)
        if mirror is None:
            failures += 1
            free &= ~member
            if not member.any():
                break
            continue
        failures = 0
        found.append(mirror)
        cosine = np.abs(view.sight[echoes.direction] @ mirror.normal)
        across = view.range_cell + 4.0 * view.spread_across(echoes.range, cosine)
        free &= ~(mirror.beams[echoes.direction] & (np.abs(mirror.beside(echoes.position)) < across + mirror.depth))
    return sorted(found, key=lambda mirror: -float(mirror.beams.sum()))


def _propose(echoes: Echoes, view: VolumeView, generator: np.random.Generator) -> tuple[Array, Array] | None:
    """Normal and a point of the plane near most echoes, weighted by clipped amplitude."""
    weight = np.minimum(echoes.amplitude, CLIP * np.median(echoes.amplitude))
    order = np.argsort(echoes.direction, kind="stable")
    echoes, weight = echoes.take(order), weight[order]
    total = np.cumsum(weight)
    seeds = np.searchsorted(total, generator.uniform(0.0, total[-1], PROPOSALS))
    low, high = PARTNER_STEPS
    turn = generator.uniform(0.0, 2.0 * np.pi, PROPOSALS)
    # The second partner stands at a right angle to the first, more or less.
    turns = np.stack([turn, turn + generator.uniform(0.25 * np.pi, 0.75 * np.pi, PROPOSALS)])
    steps = generator.uniform(low, high, (2, PROPOSALS))
    rows = view.shape[1]
    first = np.searchsorted(echoes.direction, np.arange(rows * view.shape[0] + 1))
    triples = [seeds]
    valid = np.ones(PROPOSALS, dtype=bool)
    for angle, away in zip(turns, steps, strict=True):
        column = echoes.direction[seeds] // rows + np.rint(away * np.cos(angle)).astype(np.intp)
        row = echoes.direction[seeds] % rows + np.rint(away * np.sin(angle)).astype(np.intp)
        valid &= (column >= 0) & (column < view.shape[0]) & (row >= 0) & (row < rows)
        beam = np.where(valid, column * rows + row, 0)
        partner = np.full(PROPOSALS, -1)
        for i in np.flatnonzero(valid & (first[beam + 1] > first[beam])):
            there = np.arange(first[beam[i]], first[beam[i] + 1])
            partner[i] = there[np.argmin(np.abs(echoes.range[there] - echoes.range[seeds[i]]))]
        valid &= partner >= 0
        triples.append(partner)
    a, b, c = (echoes.position[t[valid]] for t in triples)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    good = length > 1e-9
    if not good.any():
        return None
    normal, a = normal[good] / length[good, None], a[good]
    judge = np.linspace(0, len(echoes) - 1, min(JUDGES, len(echoes))).astype(np.intp)
    votes = np.zeros(len(normal))
    sight = view.sight[echoes.direction[judge]]
    _judge(echoes.position[judge], sight, view.width(echoes.range[judge]), weight[judge],
           normal, a, 0.5 * view.range_cell, votes)  # fmt: skip
    best = int(np.argmax(votes))
    return normal[best], a[best]


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _judge(points, sight, width, weight, normal, on_plane, cell, votes):  # type: ignore[no-untyped-def]
    """Sum of the weights of the echoes within a cell and half a footprint of each plane."""
    for h in range(votes.size):
        n0, n1, n2 = normal[h]
        offset = on_plane[h, 0] * n0 + on_plane[h, 1] * n1 + on_plane[h, 2] * n2
        total = 0.0
        for i in range(weight.size):
            distance = abs(points[i, 0] * n0 + points[i, 1] * n1 + points[i, 2] * n2 - offset)
            cosine = sight[i, 0] * n0 + sight[i, 1] * n1 + sight[i, 2] * n2
            if distance < cell + 0.5 * width[i] * np.sqrt(max(1.0 - cosine * cosine, 0.0)):
                total += weight[i]
        votes[h] = total


def _near(echoes: Echoes, view: VolumeView, normal: Array, center: Array) -> Mask:
    """Echoes that may belong to a plane: within three standard deviations of a beam's echo on it."""
    cosine = np.abs(view.sight[echoes.direction] @ normal)
    return np.abs((echoes.position - center) @ normal) < 3.0 * view.spread_across(echoes.range, cosine)


def _settle(
    normal: Array, center: Array, echoes: Echoes, free: Mask, view: VolumeView, smallest: float, tested: bool
) -> tuple[PlaneMirror | None, Mask]:
    """The mirror that a proposal grows to, None if it is none; and the echoes that it was judged by."""
    for _ in range(4):
        member = free & _near(echoes, view, normal, center)
        if member.sum() < FEWEST_ECHOES:
            return None, member
        normal, center = _least_squares(echoes, view, member, normal)
    beams = _largest_region(echoes, view, member, normal, center)
    member &= beams[echoes.direction]
    for _ in range(3):
        if member.sum() < FEWEST_ECHOES:
            return None, member
        normal, center = _least_squares(echoes, view, member, normal)
        near = _near(echoes, view, normal, center)
        beams = _largest_region(echoes, view, free & near, normal, center)
        member = free & near & beams[echoes.direction]
    if member.sum() < FEWEST_ECHOES or beams.sum() < FEWEST_ECHOES:
        return None, member
    normal = normal * -np.sign((center - view.radar) @ normal)
    fill = np.unique(echoes.direction[member]).size / max(int(beams.sum()), 1)
    strength = float(np.median(echoes.amplitude[member]))
    points = plane_points(view, normal, center, beams)
    mirror = PlaneMirror(center, normal, points, beams, strength=strength, fill=min(fill, 1.0))
    if min(mirror.extent) < smallest:
        return None, member
    if tested:
        if fill < SMALLEST_FILL or _sagitta(echoes, mirror, member) > SAGITTA_CELLS * view.cell_at(mirror.center):
            return None, member
        fitted = refitted(view, mirror)
        if fitted is None:
            return None, member
        mirror = fitted
    points = plane_points(view, mirror.normal, mirror.center, beams)
    return replace(mirror, center=points.mean(axis=0), outline=hull(points, mirror.normal)), member


def _least_squares(echoes: Echoes, view: VolumeView, member: Mask, normal: Array) -> tuple[Array, Array]:
    """Total least squares with weights: amplitude, clipped, over the variance of an echo's place."""
    points = echoes.position[member]
    cosine = np.abs(view.sight[echoes.direction[member]] @ normal)
    weight = np.minimum(echoes.amplitude[member], CLIP * np.median(echoes.amplitude[member]))
    weight = weight / view.spread_across(echoes.range[member], cosine) ** 2
    return weighted_plane(points, weight)


def _largest_region(echoes: Echoes, view: VolumeView, member: Mask, normal: Array, center: Array) -> Mask:
    """The largest connected set of beams that show a plane, its small gaps closed, (beams,)."""
    meets = plane_ranges(view, normal, center) <= view.range[-1]
    lit = np.zeros(view.shape, dtype=bool)
    lit.ravel()[echoes.direction[member]] = True
    pad = GAP_BEAMS + 1
    closed = binary_closing(np.pad(lit, pad), iterations=GAP_BEAMS)[pad:-pad, pad:-pad]
    # Threads of chance echoes do not join two walls.
    closed = binary_opening(np.pad(closed, 2, mode="edge"), iterations=2)[2:-2, 2:-2]
    regions, count = label(closed)
    if not count:
        return np.zeros(lit.size, dtype=bool)
    largest = 1 + int(np.argmax(np.bincount(regions.ravel())[1:]))
    return np.asarray(binary_fill_holes(regions == largest)).ravel() & meets


def _sagitta(echoes: Echoes, mirror: PlaneMirror, member: Mask) -> float:
    """How far [m] the best paraboloid through the echoes bulges over the extent of the mirror."""
    offset = echoes.position[member] - mirror.center
    half = 0.5 * np.array(mirror.extent)
    u, v = offset @ mirror.right / half[0], offset @ np.cross(mirror.normal, mirror.right) / half[1]
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    bend = np.linalg.lstsq(terms, offset @ mirror.normal, rcond=None)[0][3:]
    return float(np.max(np.abs(bend[[0, 2]])))
