"""Step 2, second half: straight rows of echoes are mirrors.

An amplitude-weighted Hough transform proposes lines one at a time, the strongest first; each proposal is refitted to
its echoes by total least squares with clipped weights, cut where the row of echoes breaks off, and tested: long
enough, filled, straight and standing out of its surroundings.
"""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np

from mirrorfold.common.geometry import cross2
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.line_fit import CLIP, leading_edge, refined
from mirrorfold.detection.line_mirror import LineMirror, line_cell

MINIMUM_CELLS = 7.75
"""Shortest mirror in resolution cells: the row of echoes of a shorter one says too little about its direction."""

SAGITTA_CELLS = 0.3
"""A row of echoes that bulges by more than this many resolution cells is a curved object, not a plane mirror."""

GAP_CELLS = 3.0
"""A row of echoes ends at a gap of this many resolution cells: speckle fades over one or two."""

SMALLEST_FILL = 0.55
"""Share of its length that a mirror's echoes must fill; each fills one resolution cell along the line."""

SMALLEST_FILL_SHORT = 0.85
"""The same for a mirror of the minimum length, falling to the above at twice that: clutter makes short rows by chance,
filled by up to 85 %, but no long ones."""

SMALLEST_CONTRAST = 2.0
"""Echoes on a mirror's line over those in a band of equal width in front of it: clutter has a ratio near one."""

MAXIMUM_PROPOSALS = 100
"""A room has tens of mirrors, and the strongest come first; noise that passes for echoes proposes without end."""

HOUGH_STEP_DEG = 0.25
"""Step of the angle of proposed lines: half a cell off at the end of a row of a hundred cells."""

HOUGH_BIN = 0.25
"""Step of the distance of proposed lines, in range cells: a thin wall fills two or three bins."""

NARROWING = (0.8, 0.6, 0.6)
"""Echoes of a row lie within these parts of the cell across its line, from one refit to the next: half a cell to either
side is its own, and the first line is not yet the best."""

TAKEN = 1.5
"""Echoes this close to a mirror, in cells across it, belong to no other: its main lobe reaches as far."""

ON_LINE, BEFORE_LINE = 0.75, (1.0, 2.5)
"""Half the width of a mirror's own band, and where the band in front begins and ends, in cells across it: both hold 1.5
cells."""

FILL_SAMPLES = 200
"""Places along a mirror where its fill is judged: half a percent each."""

BAND_CELLS = 6.0
"""Echoes further from a proposed line than this many of the largest resolution cells cannot be part of what is found on
it: rows reach 1.5 cells from it, the band in front of them 2.5, and refits move it by a cell or two."""


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _vote(
    x: Array, y: Array, weight: Array, cosine: Array, sine: Array, first: float, step: float, votes: Array
) -> None:
    """``votes[a, (x cos a + y sin a - first) / step] += weight``, shared between the two nearest bins."""
    for a in range(cosine.size):
        for i in range(x.size):
            position = (x[i] * cosine[a] + y[i] * sine[a] - first) / step
            bin_ = int(position)
            share = position - bin_
            votes[a, bin_] += weight[i] * (1.0 - share)
            votes[a, bin_ + 1] += weight[i] * share


class _Hough:
    """Votes of echoes for lines ``x cos a + y sin a = d``; echoes can be withdrawn."""

    def __init__(self, points: Array, weight: Array, step: float) -> None:
        self.points = points
        self.weight = weight
        self.angle = np.radians(np.arange(0.0, 180.0, HOUGH_STEP_DEG))
        self.cosine, self.sine = np.cos(self.angle), np.sin(self.angle)
        reach = float(np.abs(points).sum(axis=1).max()) + 2.0 * step
        self.first, self.step = -reach, step
        self.votes = np.zeros((self.angle.size, int(2.0 * reach / step) + 3))
        self._cast(np.arange(len(points)), 1.0)

    def _cast(self, which: Index, sign: float) -> None:
        x, y = np.ascontiguousarray(self.points[which].T)
        _vote(x, y, sign * self.weight[which], self.cosine, self.sine, self.first, self.step, self.votes)

    def withdraw(self, which: Index) -> None:
        self._cast(which, -1.0)

    def strongest(self) -> tuple[Array, Array, float]:
        """A point on the line with the most votes, its direction, and the votes in its three middle bins."""
        # A wall is a little thicker than one bin.
        smooth = self.votes[:, :-2] + self.votes[:, 1:-1] + self.votes[:, 2:]
        a, d = np.unravel_index(int(np.argmax(smooth)), smooth.shape)
        normal = np.array([self.cosine[a], self.sine[a]])
        return (
            (self.first + (d + 1) * self.step) * normal,
            np.array([-normal[1], normal[0]]),
            float(smooth[a, d]),
        )


def find_lines(
    echoes: Echoes,
    view: ImageView,
    *,
    minimum_length: float,
    tested: bool = True,
) -> list[LineMirror]:
    """Straight mirrors among the echoes, strongest first.

    Parameters
    ----------
    echoes : Echoes
        Those that are visible may support a mirror; strong ones are evidence, faint ones continue it.
    view : ImageView
        What the echoes were found in; tells the resolution.
    minimum_length : float [m]
    tested : bool
        Whether a row must be straight, filled and stand out of its surroundings, not only long enough.

    Returns
    -------
    list of LineMirror
    """
    every = echoes.position[echoes.visible]
    usable = echoes.visible & echoes.strong
    points = echoes.position[usable]
    if len(points) < 3:
        return []
    amplitude = echoes.amplitude[usable]
    weight = echoes.length[usable] * np.minimum(amplitude / np.median(amplitude), CLIP)
    hough = _Hough(points - view.radar, weight, HOUGH_BIN * view.range_cell)
    widest = max(view.range_cell, float(view.cross_cell(*view.to_polar(points)).max()))
    free = np.ones(len(points), dtype=bool)
    mirrors: list[LineMirror] = []
    # Less than this many votes cannot be a filled row of the minimum length, even of faint echoes.
    enough = 0.25 * minimum_length * SMALLEST_FILL
    for _ in range(MAXIMUM_PROPOSALS):
        on_line, direction, votes = hough.strongest()
        if votes < enough:
            return mirrors
        on_line = on_line + view.radar
        band = np.flatnonzero(np.abs(cross2(points - on_line, direction)) <= BAND_CELLS * widest)
        mirror, row = _grow(
            points[band], amplitude[band], weight[band], free[band], on_line, direction, view, minimum_length, tested
        )
        if mirror is not None:
            if tested:
                mirror = leading_edge(refined(_extended(mirror, every, view), view), view)
            mirrors.append(mirror)
        taken = band[row & free[band]]
        if not taken.size:
            # Votes without echoes nearby: what rounding left over.
            return mirrors
        free[taken] = False
        hough.withdraw(taken)
    return mirrors


def _grow(
    points: Array,
    amplitude: Array,
    weight: Array,
    free: Mask,
    on_line: Array,
    direction: Array,
    view: ImageView,
    minimum_length: float,
    tested: bool,
) -> tuple[LineMirror | None, Mask]:
    """Refit a proposed line; the mirror on it, if there is one, and the echoes to take out of the search."""
    proposal = LineMirror(on_line, on_line + direction)
    across, _ = line_cell(view, points, direction)
    near = free & (np.abs(proposal.beside(points)) <= across)
    row = _longest_row(points, weight, near, proposal, view)
    for tolerance in NARROWING:
        if np.count_nonzero(row) < 3:
            break
        proposal = _fit(points[row], weight[row])
        across, _ = line_cell(view, points, proposal.direction)
        close = free & (np.abs(proposal.beside(points)) <= tolerance * across)
        row = _longest_row(points, weight, close, proposal, view)
    if np.count_nonzero(row) < 3:
        return None, near
    mirror = _fit(points[row], weight[row], amplitude[row])
    # Take out all that belongs to this row, also what is too far off the line to help the fit.
    _, along_cell = line_cell(view, points, mirror.direction)
    position = mirror.along(points)
    across, _ = line_cell(view, points, mirror.direction)
    inside = (position > -along_cell) & (position < mirror.length + along_cell)
    taken = free & inside & (np.abs(mirror.beside(points)) <= TAKEN * across)
    if mirror.length < minimum_length:
        return None, row
    mirror = replace(mirror, fill=filled(points[row], mirror, view))
    short = np.clip(2.0 - mirror.length / minimum_length, 0.0, 1.0)
    if tested and not (
        _is_straight(points[row], mirror, view)
        and mirror.fill >= SMALLEST_FILL + short * (SMALLEST_FILL_SHORT - SMALLEST_FILL)
        and _contrast(points, weight, mirror, view) >= SMALLEST_CONTRAST
    ):
        return None, row
    return mirror, taken | row


def _longest_row(points: Array, weight: Array, near: Mask, line: LineMirror, view: ImageView) -> Mask:
    """The heaviest unbroken row among the echoes `near` a line."""
    which = np.flatnonzero(near)
    if which.size < 3:
        return near
    position = line.along(points[which])
    order = np.argsort(position)
    which, position = which[order], position[order]
    _, cell = line_cell(view, points[which], line.direction)
    gap = np.diff(position) > GAP_CELLS * np.maximum(cell[:-1], cell[1:])
    run = np.concatenate([[0], np.cumsum(gap)])
    best = int(np.argmax(np.bincount(run, weights=weight[which])))
    row = np.zeros_like(near)
    row[which[run == best]] = True
    return row


def _extended(mirror: LineMirror, points: Array, view: ImageView) -> LineMirror:
    """The mirror as far as its row of echoes, faint ones included, goes on."""
    across, _ = line_cell(view, points, mirror.direction)
    near = np.abs(mirror.beside(points)) <= NARROWING[-1] * across
    position = mirror.along(points)
    # Its own echoes outweigh any other row on the same line.
    weight = np.where((position >= 0.0) & (position <= mirror.length), 1.0, 1e-6)
    row = position[_longest_row(points, weight, near, mirror, view)]
    first, last = min(float(row.min()), 0.0), max(float(row.max()), mirror.length)
    at = mirror.start
    return replace(mirror, start=at + first * mirror.direction, end=at + last * mirror.direction)


def _fit(points: Array, weight: Array, amplitude: Array | None = None) -> LineMirror:
    """Weighted total least squares line through points, as long as they reach."""
    center = np.average(points, axis=0, weights=weight)
    offset = points - center
    scatter = (offset * weight[:, None]).T @ offset / weight.sum()
    _, vectors = np.linalg.eigh(scatter)
    direction = vectors[:, 1]
    along = offset @ direction
    strength = float(np.median(amplitude)) if amplitude is not None else 1.0
    return LineMirror(center + along.min() * direction, center + along.max() * direction, strength)


def _is_straight(points: Array, mirror: LineMirror, view: ImageView) -> bool:
    """Whether a parabola through the echoes bulges by less than the allowed sagitta."""
    along = mirror.along(points) / mirror.length * 2.0 - 1.0
    beside = mirror.beside(points)
    basis = np.stack([np.ones_like(along), along, along**2], axis=1)
    solution, *_ = np.linalg.lstsq(basis, beside, rcond=None)
    return bool(abs(solution[2]) <= SAGITTA_CELLS * view.cell_at(mirror.center))


def filled(points: Array, mirror: LineMirror, view: ImageView) -> float:
    """Share of the mirror's length within half a resolution cell of one of its echoes."""
    _, cell = line_cell(view, points, mirror.direction)
    position = mirror.along(points)
    sample = np.linspace(0.0, mirror.length, FILL_SAMPLES)
    # How many echoes begin to cover each sample, less those that have ceased to.
    begun = np.bincount(np.searchsorted(sample, position - 0.5 * cell), minlength=FILL_SAMPLES + 1)
    ceased = np.bincount(np.searchsorted(sample, position + 0.5 * cell, side="right"), minlength=FILL_SAMPLES + 1)
    return float(np.mean(np.cumsum(begun - ceased)[:FILL_SAMPLES] > 0))


def _contrast(points: Array, weight: Array, mirror: LineMirror, view: ImageView) -> float:
    """Weight of the echoes on the mirror's line over that in a band of the same width in front of it."""
    position, beside = mirror.along(points), mirror.beside(points)
    across, _ = line_cell(view, points, mirror.direction)
    towards = np.sign(float((view.radar - mirror.center) @ mirror.normal)) or 1.0
    inside = (position >= 0.0) & (position <= mirror.length)
    on_it = inside & (np.abs(beside) <= ON_LINE * across)
    before = inside & (beside * towards > BEFORE_LINE[0] * across) & (beside * towards <= BEFORE_LINE[1] * across)
    return float(weight[on_it].sum() / max(weight[before].sum(), 1e-12))
