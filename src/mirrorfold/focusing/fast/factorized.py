"""The fast algorithm of any array ("factorized"): an image made by few antennas is smooth, and needs few pixels.

The antennas of a small block see a pixel from nearly the same direction. Once the phase of the path over the block's
centre is taken off, their image is therefore band-limited, and a few sample pixels determine all others. These samples
are summed exactly, over few pairs and few pixels. They are interpolated to the denser samples of a block twice as
large, and added there, block after block, until the image by the whole array is interpolated to all pixels (factorised
back-projection: Ulander, Hellsten and Stenstrom 2003; Boag, Bresler and Michielssen 2000). The bands follow from the
directions to the antennas, so that arrays may be irregular, planar or anywhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise, permutations
from math import prod

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.phasor import turn
from mirrorfold.common.threads import counted, for_each, one_thread
from mirrorfold.common.types import Array, Index, Progress
from mirrorfold.focusing.exact.exact_sum import focus_exact
from mirrorfold.focusing.fast.bandlimited import Axis, Interpolator
from mirrorfold.focusing.fast.sides import Side, middle_of
from mirrorfold.focusing.predicting.cost import CALL, Cost, exact_cells, exact_cost, exact_seconds
from mirrorfold.focusing.predicting.machine import machine
from mirrorfold.focusing.problem import Problem, UnsuitedError

Planar = NDArray[np.float32]
"""Real and imaginary parts, (2, z, y, x)."""

DIVISION_SLACK = 1.2
"""A block is not divided if its two halves, each undivided, would take more than this times as long as the block."""

FINEST_PART = 3e-4
"""Blocks that take less than this share of the exact sum's time are not divided: laying out would take longer than that
could save."""

CALLS_TO_DIVIDE = 2.0
"""Blocks that take less time than this number of calls are not divided."""

SLAB_RATIO = 2.0
"""Largest ratio of the distances of pixels in one slab: its bands are those of the nearest pixels, which are widest."""

NEAREST_SHARE = 1e-3
"""Smaller distances, as a share of the largest, count as this: pixels may lie between the antennas, at no distance."""

SPREAD_ANGLES = 5
"""Pixels along each axis of a slab at which the band is computed, besides those nearest to the antennas."""

BAND_MARGIN = 1.1
"""Factor by which bands are widened: between these pixels the band may be wider than at them."""

FACTORIZATION_SLOWDOWN = 8.0
"""Time of a multiplication in a matrix factorisation over that in a matrix product."""

SCATTERED_SLOWDOWN = 1.3
"""Time of the exact sum on scattered samples over that on adjacent pixels, which find their tables in the cache."""

SHARE_EXACT = 0.5
SHARE_AXIS = 0.5
"""Shares of the tolerance for the exact sums, and for one interpolation along one axis."""


@dataclass(frozen=True, eq=False)
class Block:
    """Some antennas, and the samples (z, y, x) on which their image is made.

    Attributes
    ----------
    tx, rx : int arrays
        Indices of the antennas; of one moving antenna both are indices of its positions.
    centre : (2, 3) array [m]
        Centre of the transmitters and of the receivers; the phase of the path over both is taken off the image.
    axes : tuple of Axis
        Axes z, y and x of the slab's pixels.
    steps : tuple of int
        Steps of the block's bands along these axes, see `Axis.step`.
    parts : tuple of Block
        Blocks whose images are added up to that of this block; empty where all its pairs are summed exactly.
    cost : float [s]
        Predicted processor time of its image, of all cores together.
    """

    tx: Index
    rx: Index
    centre: Array
    axes: tuple[Axis, ...]
    steps: tuple[int, ...]
    parts: tuple[Block, ...]
    cost: float

    @property
    def counts(self) -> list[int]:
        """Predicted number of samples along z, y and x."""
        return [axis.count(step) for axis, step in zip(self.axes, self.steps, strict=True)]

    @property
    def size(self) -> int:
        """Predicted number of samples in all."""
        return prod(self.counts)

    @property
    def samples(self) -> tuple[Interpolator, ...]:
        """Interpolators along z, y and x, made when first asked for."""
        return tuple(axis.interpolator(step) for axis, step in zip(self.axes, self.steps, strict=True))

    @property
    def index(self) -> tuple[Index, Index, Index]:
        """Indices of the sample pixels along z, y and x."""
        z, y, x = self.samples
        return z.index, y.index, x.index

    def walk(self) -> Iterator[Block]:
        """Yield this block and all below it."""
        yield self
        for part in self.parts:
            yield from part.walk()


class Slab:
    """Pixels at similar distances, with the division of the array that images them.

    Attributes
    ----------
    whole : Block
        The whole array, with the blocks into which it is divided.
    cost : Cost
        Predicted cost of its tables and its image.
    """

    def __init__(self, problem: Problem, tolerance: float) -> None:
        self.problem = problem
        self.tolerance = tolerance
        self._speed = machine()
        self._cells = exact_cells(problem.taper, SHARE_EXACT * tolerance)
        self._coincident = problem.coincident
        self._least = FINEST_PART * exact_cost(problem, problem.pixels, SHARE_EXACT * tolerance).frame
        self.axes = tuple(Axis(a, SHARE_AXIS * tolerance) for a in (problem.z, problem.y, problem.x))
        near = np.stack([middle_of(problem.tx), middle_of(problem.rx)])
        few = [
            np.unique([*np.linspace(a[0], a[-1], SPREAD_ANGLES), *np.clip(near[:, n], a.min(), a.max())])
            for n, a in enumerate((problem.x, problem.y, problem.z))
        ]
        self._pixels = np.stack(np.meshgrid(*few, indexing="ij"), axis=-1).reshape(-1, 3)
        self._sides: dict[tuple[bool, bytes], Side] = {}
        self.whole = self._divided(self._undivided(np.arange(len(problem.tx)), np.arange(len(problem.rx))))
        # The last turn takes off the phase of one centre, of 2 paths; a merge exchanges two centres, of 4 paths.
        turned = 0.5 * problem.pixels * self._speed.turn
        last = _work(self.whole.counts, problem.shape) * self._speed.multiply + turned
        used = {(n, step) for block in self.whole.walk() for n, step in enumerate(block.steps)}
        work = sum(self.axes[n].work(step) for n, step in used)
        memory = sum(4.0 * self.axes[n].count(step) * self.axes[n].position.size for n, step in used)
        building = FACTORIZATION_SLOWDOWN * work * self._speed.multiply + len(used) * CALL
        self.cost = Cost(building, self.whole.cost + last, memory + 16 * problem.pixels)

    def prepare(self) -> None:
        """Make all interpolators."""
        for block in self.whole.walk():
            block.samples  # noqa: B018

    def _undivided(self, tx: Index, rx: Index) -> Block:
        """A block of some antennas, with all its pairs summed exactly."""
        problem = self.problem
        sides = self._side(tx, of_rx=False), self._side(rx, of_rx=not problem.monostatic)
        centre = np.stack([side.centre for side in sides])
        band = self._band(*sides)
        steps = tuple(axis.step(b) for axis, b in zip(self.axes, band[::-1], strict=True))
        block = Block(tx, rx, centre, self.axes, steps, (), 0.0)
        same = not problem.monostatic and self._coincident and np.array_equal(tx, rx)
        antennas = tx.size if problem.monostatic or same else tx.size + rx.size
        pairs = tx.size if problem.monostatic else tx.size * rx.size * (0.5 if same else 1.0)
        return replace(block, cost=SCATTERED_SLOWDOWN * exact_seconds(self._cells, pairs, antennas, block.size))

    def _divided(self, block: Block) -> Block:
        """The block as it is or, if that takes less time, divided into two parts, which may be divided in turn."""
        single = block.tx.size * (1 if self.problem.monostatic else block.rx.size) == 1
        if single or block.cost < max(CALLS_TO_DIVIDE * CALL, self._least):
            return block
        parts = tuple(self._undivided(*part) for part in self._halves(block.tx, block.rx))
        merge = block.size * self._speed.turn + CALL
        both = sum(merge + self._speed.multiply * _work(part.counts, block.counts) for part in parts)
        if both + sum(part.cost for part in parts) > DIVISION_SLACK * block.cost:
            return block
        parts = tuple(self._divided(part) for part in parts)
        cost = both + sum(part.cost for part in parts)
        return replace(block, parts=parts, cost=cost) if cost < block.cost else block

    def _halves(self, tx: Index, rx: Index) -> list[tuple[Index, Index]]:
        """The antennas in two parts: of transmitters and receivers, the ones that extend farther are halved."""
        of_tx = self._side(tx, of_rx=False)
        if self.problem.monostatic:
            return [(half, half) for half in of_tx.halves]
        of_rx = self._side(rx, of_rx=True)
        if rx.size > 1 and (tx.size == 1 or of_rx.extent > of_tx.extent):
            return [(tx, half) for half in of_rx.halves]
        return [(half, rx) for half in of_tx.halves]

    def _side(self, which: Index, *, of_rx: bool) -> Side:
        """Some transmitters, or receivers; the same ones are in many blocks."""
        key = of_rx, which.tobytes()
        if key not in self._sides:
            self._sides[key] = Side.of(self.problem.rx if of_rx else self.problem.tx, which, self._pixels)
        return self._sides[key]

    def _band(self, tx: Side, rx: Side) -> Array:
        """Largest spatial frequency [rad/m] along (x, y, z) of the image by some antennas, less the centre's phase."""
        k = self.problem.k
        central = self.problem.middle_wavenumber * (tx.from_centre + rx.from_centre)
        low, high = tx.low + rx.low, tx.high + rx.high
        ends = [np.abs(wavenumber * side - central) for wavenumber in (k[0], k[-1]) for side in (low, high)]
        return np.asarray(BAND_MARGIN * np.max(ends, axis=(0, 1)))

    def __call__(self, s: NDArray[np.complex64], image: NDArray[np.complex64]) -> None:
        """Write the image (z, y, x) of one frame."""
        everything = tuple(np.arange(n) for n in self.problem.shape)
        planar = _interpolated(self._image(self.whole, s), self.whole, everything)
        total = self._turned(planar, everything, self.whole.centre, None)
        image.real, image.imag = total

    def _image(self, block: Block, s: NDArray[np.complex64]) -> Planar:
        """The block's image on its samples, without the phase of the path over its centre."""
        problem = self.problem
        if not block.parts:
            z, y, x = (axis[i] for axis, i in zip((problem.z, problem.y, problem.x), block.index, strict=True))
            alone = problem.of(block.tx, block.rx).on(x, y, z)
            exact = focus_exact(alone, _data(problem, s, block), SHARE_EXACT * self.tolerance)
            return self._turned(np.stack([exact.real, exact.imag]), block.index, None, block.centre)
        total = np.zeros((2, *(i.size for i in block.index)), dtype=np.float32)
        for part in block.parts:
            planar = _interpolated(self._image(part, s), part, block.index)
            self._turned(planar, block.index, part.centre, block.centre, total)
        return total

    def _turned(
        self,
        planar: Planar,
        index: tuple[Index, ...],
        plus: Array | None,
        minus: Array | None,
        total: Planar | None = None,
    ) -> Planar:
        """The image times ``exp(j k_c (path over plus - path over minus))``, added to `total` if that is given.

        The path over the centres (2, 3) [m] of a block leads from the first to the pixel and on to the second.
        """
        problem = self.problem
        z, y, x = (axis[i] for axis, i in zip((problem.z, problem.y, problem.x), index, strict=True))
        centres = np.concatenate([c for c in (plus, minus) if c is not None])
        sign = np.concatenate([np.full(2, f) for c, f in ((plus, 1.0), (minus, -1.0)) if c is not None])
        turns = sign * problem.middle_wavenumber / (2.0 * np.pi)
        pixel_y, pixel_x = (axis.ravel() for axis in np.meshgrid(y, x, indexing="ij"))
        result = np.zeros(planar.shape, dtype=np.float32) if total is None else total
        flat, out = planar.reshape(2, z.size, -1), result.reshape(2, z.size, -1)

        def plane(n: int) -> None:
            turn(flat[0, n], flat[1, n], pixel_x, pixel_y, float(z[n]), centres, turns, out[0, n], out[1, n])

        for_each(plane, range(z.size))
        return result


@dataclass(frozen=True, eq=False)
class Division:
    """The slabs of a problem, the rows (y) of pixels of each, and their predicted cost."""

    slabs: tuple[Slab, ...]
    rows: tuple[slice, ...]
    cost: Cost


class FactorizedPlan:
    """Factorised back-projection of any array on a regular grid.

    Parameters
    ----------
    problem : Problem
    tolerance : float
    layout : Division, optional
        The division of this problem; by default it is made.
    """

    algorithm = "factorized"

    def __init__(self, problem: Problem, tolerance: float, layout: Division | None = None) -> None:
        self.problem = problem
        self.tolerance = tolerance
        layout = layout or self.lay_out(problem, tolerance)
        self.slabs, self._rows = layout.slabs, layout.rows
        with one_thread():
            for slab in self.slabs:
                slab.prepare()

    @staticmethod
    def lay_out(problem: Problem, tolerance: float) -> Division:
        """Divide the pixels into slabs and, for each slab, the array into blocks.

        Raises
        ------
        UnsuitedError
            If no slab is imaged faster by dividing the array.
        """
        rows = tuple(_slabs(problem))
        slabs = tuple(Slab(problem.on(problem.x, problem.y[part], problem.z), tolerance) for part in rows)
        if not any(slab.whole.parts for slab in slabs):
            raise UnsuitedError("no part of the image is made faster by dividing the array")
        return Division(slabs, rows, sum((slab.cost for slab in slabs), Cost()))

    @property
    def nbytes(self) -> int:
        """Memory of the tables [bytes]."""
        return sum(made.matrix.nbytes for slab in self.slabs for axis in slab.axes for made in axis.interpolators())

    def __call__(self, s: NDArray[np.complex64], progress: Progress | None = None) -> NDArray[np.complex64]:
        """Image (z, y, x) of one frame."""
        image = np.zeros(self.problem.shape, dtype=np.complex64)
        step = counted(progress, len(self.slabs))
        with one_thread():
            for rows, slab in zip(self._rows, self.slabs, strict=True):
                slab(s, image[:, rows])
                step()
        return image


def _slabs(problem: Problem) -> list[slice]:
    """Rows (y) of pixels, divided where their distance from the antennas has grown by the factor SLAB_RATIO."""
    antennas = np.concatenate([problem.tx, problem.rx])
    low, high = antennas.min(axis=0), antennas.max(axis=0)
    aside = [max(low[i] - axis.max(), axis.min() - high[i], 0.0) for i, axis in ((0, problem.x), (2, problem.z))]
    ahead = np.maximum(np.maximum(low[1] - problem.y, problem.y - high[1]), 0.0)
    distance = np.sqrt(ahead**2 + aside[0] ** 2 + aside[1] ** 2)
    octave = np.floor(
        np.log(np.maximum(distance / max(distance.min(), NEAREST_SHARE * distance.max()), 1.0)) / np.log(SLAB_RATIO)
    )
    cuts = [0, *(np.flatnonzero(np.diff(octave)) + 1), problem.y.size]
    return [slice(a, b) for a, b in pairwise(cuts)]


def _data(problem: Problem, s: NDArray[np.complex64], block: Block) -> NDArray[np.complex64]:
    """The samples of a block's pairs."""
    return s[:, block.tx] if problem.monostatic else s[:, block.tx[:, None], block.rx[None, :]]


def _work(few, many) -> float:  # type: ignore[no-untyped-def]
    """Multiplications to interpolate from few to many samples along (z, y, x), in the best order of the axes."""
    return min(_work_in(few, many, order) for order in permutations(range(3)))


def _work_in(few, many, order) -> float:  # type: ignore[no-untyped-def]
    """Multiplications to interpolate along the axes in this order."""
    sizes, work = [int(n) for n in few], 0.0
    for axis in order:
        if few[axis] != many[axis]:
            work += 2.0 * prod(sizes) * many[axis]
            sizes[axis] = int(many[axis])
    return work


def _interpolated(planar: Planar, block: Block, index: tuple[Index, ...]) -> Planar:
    """A block's image, interpolated to other pixels by one matrix product per axis, in the order of least work."""
    few, many = [i.size for i in block.index], [i.size for i in index]
    for axis in min(permutations(range(3)), key=lambda order: _work_in(few, many, order)):
        matrix = block.samples[axis].onto(index[axis])
        if matrix is None:
            continue
        if axis == 2:
            planar = planar @ matrix
        elif axis == 1:
            planar = matrix.T @ planar
        else:
            flat = matrix.T @ planar.reshape(*planar.shape[:2], -1)
            planar = flat.reshape(2, flat.shape[1], *planar.shape[2:])
    return planar
