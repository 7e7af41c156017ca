"""The polar grid of one sector of a line array's image, and the kernels by which it is interpolated.

The grid must be as fine as the spectrum of the image is wide. A design takes milliseconds and makes no table; from it
follows what the tables will cost (see `sector_cost`).
"""

from __future__ import annotations

from math import ceil, floor, pi

import numpy as np
import scipy.fft

from mirrorfold.common.types import Array
from mirrorfold.focusing.lines.interpolation import taper_kernel, triangular_kernel
from mirrorfold.focusing.lines.lattice import Lattice
from mirrorfold.focusing.lines.nodes import Sector, largest_slopes
from mirrorfold.focusing.problem import Problem

STRETCH_OVERSAMPLING = 2.0
"""Oversampling of the first Fourier transform, from lattice points to directions at each wavenumber."""

POLAR_OVERSAMPLING = 2.0
"""Oversampling of the polar grid in range and direction: the spectrum of an image is a little wider than computed."""

NEAREST_GUARD = 0.25
"""Share of the range of the nearest pixel by which the guard rows of the polar grid may reach nearer, at most."""

DIRECTION_GUARD = 0.05
"""Width in w of the polar grid's guard on either side, as assumed for the slopes; at most four times this is used."""

SHARES = {"nodes": 0.5, "stretch": 0.2, "range": 0.4, "direction": 0.4}
"""Share of the tolerance of each source of error: the nodes, and the three interpolations. Errors add as squares."""


class SectorDesign:
    """Kernels and polar grid of a sector.

    The polar grid has a row for each range r, and a line for each direction w.

    Attributes
    ----------
    curvature : float [m^2]
        Factor of the term ``curvature (1 - u^2) / r``, which is taken off E and put back at the pixels.
    stretch_kernel, direction_kernel, range_kernel : Kernel
    cells, range_cells : int
        Lengths of the Fourier transforms: from lattice points to directions, and from frequencies to ranges.
    per_range, per_direction : float
        Grid points per metre of range, and per unit of w.
    row_first, line_first : int
        Index of the first row and of the first line of the grid; index 0 is at r = 0 and at w = 0.
    shape : (int, int)
        Number of lines of equal direction, and of rows of equal range.
    sector : Sector
        Ranges and directions that the polar grid covers, its guards included.
    slopes : pair of float
        Largest slopes of E without the curvature term, along r [m/m] and w [m], from `largest_slopes`.
    """

    def __init__(self, problem: Problem, lattice: Lattice, sector: Sector, tolerance: float) -> None:
        k = problem.k
        # Width of the image's spectrum: in w from the lattice, in r from the band, both plus k times the slopes of E.
        self.curvature = lattice.curvature(problem)
        # The taps of the kernels reach beyond the sector, so that the slopes there count, too.
        near = (1.0 - NEAREST_GUARD) * sector.near
        reach = Sector(near, sector.far, sector.w_low - DIRECTION_GUARD, sector.w_high + DIRECTION_GUARD)
        self.slopes = slope_r, slope_w = largest_slopes(problem, lattice, reach, self.curvature)
        width_w = 2.0 * float(k[-1]) * lattice.half_length + float(k[-1]) * slope_w
        width_r = float(k[-1] - k[0]) + float(k[-1]) * slope_r
        self.stretch_kernel = _pick(
            lambda width: triangular_kernel(width, STRETCH_OVERSAMPLING, True), SHARES["stretch"] * tolerance
        )
        self.direction_kernel = _pick(
            lambda width: triangular_kernel(width, POLAR_OVERSAMPLING, False), SHARES["direction"] * tolerance
        )
        self.range_kernel = _pick(
            lambda width: taper_kernel(width, POLAR_OVERSAMPLING, problem.taper), SHARES["range"] * tolerance
        )
        # Rows repeat after the ambiguous range pi / step. A single frequency has none: after twice the far range then.
        step = problem.wavenumber_step or pi / (2.0 * sector.far)
        guard_w, guard_r = self.direction_kernel.width // 2 + 1, self.range_kernel.width // 2 + 1
        self.per_direction = max(POLAR_OVERSAMPLING * width_w / pi, guard_w / (4.0 * DIRECTION_GUARD))
        # The guard rows must not reach nearer than `near`, up to which the slopes hold.
        finest = pi / step * guard_r / (NEAREST_GUARD * sector.near)
        self.range_cells = scipy.fft.next_fast_len(ceil(max(POLAR_OVERSAMPLING * width_r / step, finest, k.size)))
        self.per_range = self.range_cells * step / pi
        self.line_first = floor(sector.w_low * self.per_direction) - guard_w
        lines = ceil(sector.w_high * self.per_direction) + guard_w + 1 - self.line_first
        self.row_first = floor(sector.near * self.per_range) - guard_r
        rows = ceil(sector.far * self.per_range) + guard_r + 1 - self.row_first
        self.shape = (lines, rows)
        at_w, at_r = self.directions, np.maximum(self.ranges, 0.5 * sector.near)
        self.sector = Sector(float(at_r[0]), float(at_r[-1]), float(at_w[0]), float(at_w[-1]))
        # Lattice to directions: with the pitch h, the position in the transform is k h u / pi * cells.
        reach_s = max(-lattice.lowest, lattice.lowest + lattice.points - 1, 1)
        self.cells = scipy.fft.next_fast_len(ceil(STRETCH_OVERSAMPLING * (2 * reach_s + 1)))

    @property
    def directions(self) -> Array:
        """Directions w of the lines of the polar grid."""
        return (self.line_first + np.arange(self.shape[0])) / self.per_direction

    @property
    def ranges(self) -> Array:
        """Ranges [m] of the rows of the polar grid."""
        return (self.row_first + np.arange(self.shape[1])) / self.per_range

    @property
    def interpolation_error(self) -> float:
        """Relative error of all three interpolations together."""
        kernels = (self.stretch_kernel, self.direction_kernel, self.range_kernel)
        return float(np.linalg.norm([kernel.error for kernel in kernels]))


def _pick(make, tolerance: float):  # type: ignore[no-untyped-def]
    """The shortest kernel whose error is within the tolerance, else the longest; `make` makes one of a given width."""
    for width in (2, 4, 6, 8, 10, 12):
        kernel = make(width)
        if kernel.error <= tolerance:
            break
    return kernel
