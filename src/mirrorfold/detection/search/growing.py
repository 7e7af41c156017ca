"""Step 2, second half: straight rows or flat sheets of echoes are mirrors.

This file holds what the search for lines and that for planes have in common. A few neighbouring echoes propose a line
or a plane, and all echoes vote for the proposals that they lie on (random sample consensus: Fischler and Bolles, Comm.
ACM 24, 1981). The proposal with the most votes grows to an unbroken row or sheet of echoes. It is a mirror if it is
large enough, filled with echoes, and flat. The search goes on among the remaining echoes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from itertools import product
from typing import Generic, TypeVar

import numpy as np
from scipy.spatial.distance import cdist

from mirrorfold.common.geometry import turned, unit
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Mirror, proving_echoes
from mirrorfold.detection.search.fit import flat, parabola_residual, split_in_two
from mirrorfold.detection.views.view import View

CLIP = 2.0
"""Largest weight of an echo, in multiples of the median amplitude: so glints do not dominate a fit. Up to that, echoes
weigh with their amplitude."""

PROPOSALS = 200
"""Number of groups of echoes that propose a line or plane, for each mirror. If a wall holds a third of all echoes, one
group in ten lies on it, and the probability that none does is ``0.9^200``."""

MOST_VOTERS = 1500
"""Largest number of echoes that propose and vote, evenly drawn from all."""

REACH_CELLS = 8.0
"""Largest distance, in resolution cells, between the first echo of a group and its other echoes: one wall is larger."""

NEAR = 0.6
"""Largest distance of echoes from their row or sheet, as a share of the resolution cell across it: the cell itself
reaches over 0.5, and the first proposal is not yet the best."""

NO_BOW = 0.9
"""Largest sum of squared residuals of two lines, relative to that of a parabola, at which what bulges is a mirror with
something else at its end. In rows it is 0.96 and more for arcs, and was 0.82 for a wall between two round objects; in
sheets 1.0 and more for cylinders and spheres, and 0.69 to 0.74 for walls that lean by 4 and 5 degrees over a floor."""

ROUNDS = 4
"""Number of times that a proposal is fitted to its echoes; then it no longer moves."""

M = TypeVar("M", bound=Mirror)


class Search(ABC, Generic[M]):
    """The search for mirrors of one kind among the `proving_echoes` of a view.

    Mirrors have at least the `minimum_length` [m], or in space as least width and height. Only if they are `tested`
    must they be filled and flat, too.
    """

    fewest: int
    """Least number of echoes of a row or sheet: fewer say too little about its direction."""
    sagitta: float
    """Largest bulge of a flat mirror, in resolution cells; a row or sheet that bulges more is a curved object."""
    misses: int
    """Number of failed proposals in a row that is tolerated: after one more, the search ends."""
    strong_share = 1.0
    """Share of the least length that the strong echoes of a mirror must cover, if faint ones continue it."""

    def __init__(self, echoes: Echoes, view: View, minimum_length: float, tested: bool) -> None:
        self.view, self.minimum_length, self.tested = view, minimum_length, tested
        self.every, self.echoes = echoes, proving_echoes(echoes, view)
        self.weight = clipped_weight(self.echoes, self.echoes.amplitude)
        self.square = view.squares(self.echoes.position)
        self.random = np.random.default_rng(0)

    @abstractmethod
    def patch(self, normal: Array, center: Array, near: Index) -> tuple[M, Index]:
        """The mirror that the echoes `near` a line or plane form without a gap, and the numbers of its echoes."""

    def shortest(self, mirror: M) -> float:
        """Least length [m] that this mirror must have, or least width and height."""
        return self.minimum_length

    def long_enough(self, mirror: M, share: float = 1.0) -> bool:
        """Whether a mirror has at least the given share of its least length, or width and height."""
        return bool(np.ptp(mirror.sides, axis=1).min() >= share * self.shortest(mirror))

    @abstractmethod
    def passes(self, mirror: M) -> bool:
        """Whether a large and flat mirror also passes the tests that only its kind has."""

    def bulges(self, mirror: M, member: Index) -> bool:
        """Whether the echoes of a mirror bulge so much that they are those of a curved object."""
        return sagitta(mirror, self.echoes.position[member]) > self.sagitta * self.view.cell_at(mirror.center)

    @abstractmethod
    def along_bend(self, mirror: M, points: Array) -> Array:
        """Places of points (n, d) along the direction in which a mirror that bulges is bent, (n,) [m]."""

    def straight_part(self, mirror: M, member: Index) -> tuple[M, Index] | None:
        """The flat part of a mirror that bulges only because something else goes on at its ends, and the numbers of its
        echoes; None if it is evenly curved.

        At the ends of a row stand objects. A sheet goes on where a wall leans over a floor that shows its image.
        """
        for _ in range(2):  # at either end
            points = self.echoes.position[member]
            along, beside = self.along_bend(mirror, points), mirror.beside(points)
            weight = self.weight[member] / self.square(mirror.normal, member)
            place, left, _ = split_in_two(along, beside, weight)
            longer = (along <= place) == (place >= 0.5 * (along.min() + along.max()))
            if left > NO_BOW * parabola_residual(along, beside, weight) or np.count_nonzero(longer) < self.fewest:
                return None
            mirror, member = self.patch(*flat(points[longer], weight[longer]), member[longer])
            if member.size < self.fewest or not self.long_enough(mirror):
                return None
            if not self.bulges(mirror, member):
                return mirror, member
        return None

    @abstractmethod
    def refined(self, mirror: M) -> M | None:
        """The mirror, fitted to the image or volume itself; None if that shows no mirror there."""

    def find(self, enough: float) -> list[M]:
        """All mirrors, that with the most votes first. The search ends at a proposal with fewer votes than `enough`."""
        free = np.ones(len(self.echoes), dtype=bool)
        found: list[M] = []
        missed = 0
        while np.count_nonzero(free) >= self.fewest and missed <= self.misses:
            normal, center, votes = self._proposed(np.flatnonzero(free))
            if votes < enough:
                break
            mirror, taken = self._grown(normal, center, free)
            # Side lobes of a glint may make another row beside a wall: it is no mirror of its own.
            if mirror is not None and not any(lies_on(mirror, other, self.view) for other in found):
                found.append(mirror)
            missed = 0 if mirror is not None else missed + 1
            if not free[taken].any():
                break
            free[taken] = False
        return found

    def _proposed(self, free: Index) -> tuple[Array, Array, float]:
        """The proposed line or plane with the most votes: its normal, a point on it, and the votes.

        Groups of `free` echoes propose. An echo within half a resolution cell of a proposal votes for it with its
        weight.
        """
        judge = drawn(free)
        points, weight = self.echoes.position[judge], self.weight[judge]
        seeds = self.random.choice(judge.size, PROPOSALS, p=weight / weight.sum())
        cell = np.median(self.view.cell(self.echoes.range[judge]))
        near = cdist(points[seeds], points, "sqeuclidean") < (REACH_CELLS * cell) ** 2
        partners = [np.argmax(near * self.random.random(near.shape), axis=1) for _ in range(self.view.dimensions - 1)]
        normal = _square_to([points[partner] - points[seeds] for partner in partners])
        distance = normal @ points.T - np.sum(points[seeds] * normal, axis=1)[:, None]
        votes = (4.0 * distance**2 < self.square(normal.T, judge).T) @ weight
        best = int(np.argmax(votes))
        return normal[best], points[seeds[best]], float(votes[best]) * free.size / judge.size

    def _grown(self, normal: Array, center: Array, free: Mask) -> tuple[M | None, Index]:
        """Grow a proposed line or plane to a mirror, from the echoes that are still `free`.

        Returns the mirror, None if it fails a test; and the numbers of the echoes to take out of the search.
        """
        points, member = self.echoes.position, np.flatnonzero(free)
        for i in range(ROUNDS + 1):
            distance, square = points @ normal - center @ normal, self.square(normal)
            near = np.flatnonzero(free & (distance**2 <= (NEAR**2 if i else 1.0) * square))
            if near.size < self.fewest:
                return None, member if i else near
            mirror, member = self.patch(normal, center, near)
            if member.size < self.fewest:
                return None, near
            if i < ROUNDS:
                normal, center = flat(points[member], self.weight[member] / square[member])
        judged, member = self._judged(mirror, member)
        if judged is None:
            return None, member
        _, own, across = judged.near(self.view, self.echoes)
        own = own & (np.abs(judged.beside(points)) <= across + judged.depth)
        judged = replace(judged, fill=judged.filled(self.view, self.echoes.take(own)))
        return judged, np.union1d(member, np.flatnonzero(own))

    def _judged(self, mirror: M, member: Index) -> tuple[M | None, Index]:
        """The mirror with its fill and strength, fitted to the image if it is `tested`, and the numbers of its echoes.

        None in the place of the mirror if it fails a test. The numbers are fewer than `member` if a part was cut off.
        """
        if not self.long_enough(mirror, self.strong_share if self.tested else 1.0):
            return None, member
        if self.tested and self.bulges(mirror, member):
            straight = self.straight_part(mirror, member)
            if straight is None:
                return None, member
            mirror, member = straight
        mirror = mirror.with_echoes(self.view, self.echoes.take(member))
        if not self.tested:
            return mirror, member
        fitted = self.refined(mirror) if self.passes(mirror) else None
        return (fitted if fitted is not None and self.long_enough(fitted) else None), member


def clipped_weight(echoes: Echoes, usual: Array) -> Array:
    """Weight of each echo, (n,): ``length min(amplitude / median(usual), CLIP)``, with `usual` (m,) amplitudes."""
    median = np.median(usual) if usual.size else 1.0
    return echoes.length * np.minimum(echoes.amplitude / median, CLIP)


def _square_to(spans: list[Array]) -> Array:
    """Unit vectors (n, d) square to one span in a plane, or to two in space, (n, d) each; any where these vanish."""
    normal = turned(spans[0]) if len(spans) == 1 else np.cross(spans[0], spans[1])
    normal[~normal.any(axis=1), -1] = 1.0
    return unit(normal)


def drawn(free: Index) -> Index:
    """At most `MOST_VOTERS` of the numbers (n,) of free echoes, evenly drawn."""
    return free[np.linspace(0, free.size - 1, min(MOST_VOTERS, free.size)).astype(np.intp)]


def lies_on(mirror: Mirror, other: Mirror, view: View) -> bool:
    """Whether a mirror lies on the line or plane of another one, to within a resolution cell, and its center between
    the ends of that.
    """
    place = (mirror.center - other.center) @ other.tangents.T
    if (place < other.sides[:, 0]).any() or (place > other.sides[:, 1]).any():
        return False
    corners = mirror.center + np.array(list(product(*mirror.sides))) @ mirror.tangents
    return bool((np.abs(other.beside(corners)) <= view.extent(corners, other.normal)).all())


def sagitta(mirror: Mirror, points: Array) -> float:
    """Bulge [m], over half the extent of a mirror, of the best parabola or paraboloid through points (n, d).

    A paraboloid bulges along both directions; the larger bulge counts.
    """
    middle, half = mirror.sides.mean(axis=1), 0.5 * np.ptp(mirror.sides, axis=1)
    place = ((points - mirror.center) @ mirror.tangents.T - middle) / half
    i, j = np.triu_indices(len(half))
    terms = np.column_stack([place[:, i] * place[:, j], place, np.ones(len(place))])
    bend = np.linalg.lstsq(terms, mirror.beside(points), rcond=None)[0][: len(i)]
    return float(np.abs(bend[i == j]).max())
