"""Step 2, second half: flat rows or sheets of echoes are mirrors.

What the floor plan and space have in common: few echoes of a neighbourhood propose a line or a plane, all echoes vote
(random sample consensus: Fischler and Bolles, Comm. ACM 24, 1981), and the proposal with the most votes grows to the
unbroken row or sheet about it. It is a mirror if it is large enough, filled and flat. The search goes on among the
echoes that are left.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from itertools import product
from typing import Generic, TypeVar

import numpy as np
from scipy.spatial.distance import cdist

from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Mirror, evidence
from mirrorfold.detection.search.fit import flat
from mirrorfold.detection.views.view import View

CLIP = 2.0
"""Echoes weigh with their amplitude up to this many times the median, so that glints do not steer a fit."""

PROPOSALS = 200
"""Groups of echoes drawn for each mirror. Of a wall that holds a third of the echoes one in ten falls on it, so that
the chance that none of all these does is ``0.9^200``."""

JUDGES = 1500
"""So many echoes, evenly drawn, propose and vote."""

REACH_CELLS = 8.0
"""Largest distance of the others of a group from its first echo, in resolution cells: they lie within one wall."""

NEAR = 0.6
"""Echoes of a row or sheet lie within this part of the resolution cell across it: half a cell to either side is its
own, and the first proposal is not yet the best."""

ROUNDS = 4
"""A proposal is fitted to its echoes so many times; then it no longer moves."""

M = TypeVar("M", bound=Mirror)


class Search(ABC, Generic[M]):
    """The search for mirrors of one kind.

    Parameters
    ----------
    echoes : Echoes
        See `evidence`.
    view : View
    minimum_length : float [m]
        Of a mirror, or its smallest width and height.
    tested : bool
        Whether a mirror must be filled and flat, not only large enough.
    """

    fewest: int
    """A row or sheet of fewer echoes says too little about its direction."""
    sagitta: float
    """What bulges by more than this many resolution cells is a curved object, not a flat mirror."""
    misses: int
    """After so many proposals in a row that are no mirrors there are no more."""
    strong_share = 1.0
    """Share of its least length that the strong echoes of a mirror must have, where faint ones continue it."""

    def __init__(self, echoes: Echoes, view: View, minimum_length: float, tested: bool) -> None:
        self.view, self.minimum_length, self.tested = view, minimum_length, tested
        self.every, self.echoes = echoes, evidence(echoes, view)
        usual = np.median(self.echoes.amplitude) if len(self.echoes) else 1.0
        self.weight = self.echoes.length * np.minimum(self.echoes.amplitude / usual, CLIP)
        self.square = view.squares(self.echoes.position)
        self.random = np.random.default_rng(0)

    @abstractmethod
    def patch(self, normal: Array, center: Array, near: Index) -> tuple[M, Index]:
        """The mirror that echoes near a line or plane make up, unbroken, and those of them that lie on it."""

    def shortest(self, mirror: M) -> float:
        """Least length [m] of that mirror, or width and height."""
        return self.minimum_length

    def long_enough(self, mirror: M, share: float = 1.0) -> bool:
        """Whether a mirror has that share of its least length."""
        return bool(np.ptp(mirror.sides, axis=1).min() >= share * self.shortest(mirror))

    @abstractmethod
    def passes(self, mirror: M) -> bool:
        """Whether a large and flat mirror passes the tests of its kind, too."""

    def bulges(self, mirror: M, member: Index) -> bool:
        """Whether the echoes on a mirror are those of a curved object."""
        return sagitta(mirror, self.echoes.position[member]) > self.sagitta * self.view.cell_at(mirror.center)

    def straight_part(self, mirror: M, member: Index) -> tuple[M, Index] | None:
        """A flat mirror in one that bulges, and the echoes on it; None if there is none."""
        return None

    @abstractmethod
    def refined(self, mirror: M) -> M | None:
        """The mirror fitted to the image or volume itself; None if that shows no mirror."""

    def find(self, enough: float) -> list[M]:
        """Mirrors from the one with the most votes on; proposals with less than `enough` are none."""
        free = np.ones(len(self.echoes), dtype=bool)
        found: list[M] = []
        missed = 0
        while np.count_nonzero(free) >= self.fewest and missed <= self.misses:
            normal, center, votes = self._proposed(np.flatnonzero(free))
            if votes < enough:
                break
            mirror, taken = self._grown(normal, center, free)
            # A row that side lobes of a glint make beside a wall is the wall once more.
            if mirror is not None and not any(lies_on(mirror, other, self.view) for other in found):
                found.append(mirror)
            missed = 0 if mirror is not None else missed + 1
            if not free[taken].any():
                break
            free[taken] = False
        return found

    def _proposed(self, free: Index) -> tuple[Array, Array, float]:
        """Normal, a point and the votes of the line or plane near most echoes, by their weight."""
        judge = drawn(free)
        points, weight = self.echoes.position[judge], self.weight[judge]
        seeds = self.random.choice(judge.size, PROPOSALS, p=weight / weight.sum())
        cell = np.median(self.view.cell(self.echoes.range[judge]))
        near = cdist(points[seeds], points, "sqeuclidean") < (REACH_CELLS * cell) ** 2
        partners = [np.argmax(near * self.random.random(near.shape), axis=1) for _ in range(self.view.dimensions - 1)]
        group = points[np.column_stack([seeds, *partners])]
        normal = np.linalg.svd(group - points[seeds][:, None])[2][:, -1]
        distance = normal @ points.T - np.sum(points[seeds] * normal, axis=1)[:, None]
        votes = (4.0 * distance**2 < self.square(normal.T, judge).T) @ weight
        best = int(np.argmax(votes))
        return normal[best], points[seeds[best]], float(votes[best]) * free.size / judge.size

    def _grown(self, normal: Array, center: Array, free: Mask) -> tuple[M | None, Index]:
        """The mirror that a proposal grows to, None if it is none; and the echoes to take out of the search."""
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
        if not self.long_enough(mirror, self.strong_share if self.tested else 1.0):
            return None, member
        if self.tested and self.bulges(mirror, member):
            straight = self.straight_part(mirror, member)
            if straight is None:
                return None, member
            mirror, member = straight
        on_it = self.echoes.take(member)
        mirror = replace(mirror, fill=mirror.filled(self.view, on_it), strength=float(np.median(on_it.amplitude)))
        if self.tested:
            if not self.passes(mirror):
                return None, member
            fitted = self.refined(mirror)
            if fitted is None or not self.long_enough(fitted):
                return None, member
            mirror = fitted
        _, own, across = mirror.near(self.view, self.echoes)
        own &= np.abs(mirror.beside(points)) <= across + mirror.depth
        mirror = replace(mirror, fill=mirror.filled(self.view, self.echoes.take(own)))
        return mirror, np.union1d(member, np.flatnonzero(own))


def drawn(free: Index) -> Index:
    """As many as `JUDGES` of the numbers of echoes that are free, (n,), evenly drawn."""
    return free[np.linspace(0, free.size - 1, min(JUDGES, free.size)).astype(np.intp)]


def lies_on(mirror: Mirror, other: Mirror, view: View) -> bool:
    """Whether a mirror lies on another one, within a resolution cell."""
    corners = mirror.center + np.array(list(product(*mirror.sides))) @ mirror.tangents
    beside = np.abs(other.beside(corners)) <= view.extent(corners, other.normal)
    place = (mirror.center - other.center) @ other.tangents.T
    return bool(beside.all() and (place >= other.sides[:, 0]).all() and (place <= other.sides[:, 1]).all())


def sagitta(mirror: Mirror, points: Array) -> float:
    """How far [m] the best paraboloid through points (n, d) bulges over the extent of a mirror."""
    middle, half = mirror.sides.mean(axis=1), 0.5 * np.ptp(mirror.sides, axis=1)
    place = ((points - mirror.center) @ mirror.tangents.T - middle) / half
    i, j = np.triu_indices(len(half))
    terms = np.column_stack([place[:, i] * place[:, j], place, np.ones(len(place))])
    bend = np.linalg.lstsq(terms, mirror.beside(points), rcond=None)[0][: len(i)]
    return float(np.abs(bend[i == j]).max())
