"""Step 2, between its halves: the line of a mirror, fitted to the image itself instead of to single echoes.

A tenth of a degree is what folding asks for. The power centroid across the line, place by place, gives it; a wall that
scatters from inside is moved to its leading edge.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from mirrorfold.common.types import Array
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.line_mirror import LineMirror, line_cell

PLACES = 0.125, 0.25
"""Steps along a mirror, in range cells, from one profile across it to the next: for its line, and for its front."""

LOBE, AROUND, BEHIND = 0.75, 1.5, 2.0
"""Half-lengths of the profiles across a mirror, in cells across it: of its main lobe; with its surroundings; and with
what scatters behind its front."""

HALF = 0.5
"""Amplitude, relative to the peak, down to which the main lobe is taken: the cell's own definition."""

DEEP = 0.1
"""A line at least this many range cells behind the leading edge of its wall's echoes is moved to it."""

LARGEST_TURN_DEG = 0.8
"""How far [degree] the speckle of a thick wall may have turned the line through it: 1 cm of depth over 1 m."""

END_CELLS = 0.4
"""A refit leaves out this much of a slanting resolution cell at either end of a row."""

LEVEL_CELLS = 8.0
"""Resolution cells along a wall over which its speckle is averaged to tell how bright the wall is there."""

SPECKLE_FLOOR = 1e-4
"""Power, relative to the wall's, that speckle cannot be told from noise and side lobes below."""

PROFILE_SAMPLES = 121
"""Samples of a profile across a mirror."""

CLIP = 2.0
"""Echoes weigh with their amplitude up to this many times the median, so that glints do not steer a fit."""


def across_profiles(mirror: LineMirror, view: ImageView, reach: float, spacing: float) -> tuple[Array, Array, Array]:
    """Amplitude on lines square to a mirror.

    Parameters
    ----------
    mirror : LineMirror
    view : ImageView
    reach : float
        How far the lines go to either side, in resolution cells across the mirror.
    spacing : float
        Of the lines along the mirror, in range cells.

    Returns
    -------
    along : (n,) array [m]
        From the mirror's start.
    offset : (n, m) array [m]
        From the mirror's line, positive on the side of its normal.
    amplitude : (n, m) array
    """
    along = np.linspace(0.0, mirror.length, max(8, int(mirror.length / (spacing * view.range_cell))))
    base = mirror.start + along[:, None] * mirror.direction
    across, _ = line_cell(view, base, mirror.direction)
    offset = across[:, None] * np.linspace(-reach, reach, PROFILE_SAMPLES)
    return along, offset, view.at(*view.to_polar(base[:, None, :] + offset[..., None] * mirror.normal))


def refined(mirror: LineMirror, view: ImageView) -> LineMirror:
    """The mirror fitted to the image itself instead of to single echoes.

    At many places along the line the power-weighted centroid of the main lobe across it is taken, and a straight line
    is fitted to the centroids: weighted by clipped power, with Cauchy weights against places that hold something else.
    """
    for _ in range(2):
        along, offset, amplitude = across_profiles(mirror, view, reach=LOBE, spacing=PLACES[0])
        peak = amplitude.max(axis=1)
        if not peak.any():
            return mirror
        lobe = np.where(amplitude >= HALF * peak[:, None], amplitude**2, 0.0)
        centroid = (lobe * offset).sum(axis=1) / np.maximum(lobe.sum(axis=1), np.finfo(float).tiny)
        strength = np.minimum(peak / np.median(peak[peak > 0.0]), CLIP) ** 2
        first, last = _slanting(mirror, view)
        whole = (along >= first) & (along <= mirror.length - last)
        if whole.any():
            strength = strength * whole
        basis = np.stack([np.ones_like(along), along - 0.5 * mirror.length], axis=1)
        weight = strength
        for _ in range(3):
            normal_matrix = basis.T @ (weight[:, None] * basis)
            solution = np.linalg.solve(normal_matrix, basis.T @ (weight * centroid))
            residual = centroid - basis @ solution
            scale = 2.0 * 1.4826 * float(np.median(np.abs(residual))) + np.finfo(float).tiny
            weight = strength / (1.0 + (residual / scale) ** 2)
        # Neighbouring places share a resolution cell and its speckle.
        _, cell = line_cell(view, mirror.center[None], mirror.direction)
        independent = max(mirror.length / float(cell[0]), 3.0)
        variance = float(np.average(residual**2, weights=weight)) / (independent - 2.0)
        spread = np.sqrt(variance * weight.sum() * np.diag(np.linalg.inv(normal_matrix)))
        direction = mirror.direction + solution[1] * mirror.normal
        direction /= np.linalg.norm(direction)
        middle = mirror.center + solution[0] * mirror.normal
        mirror = replace(
            mirror,
            start=middle - 0.5 * mirror.length * direction,
            end=middle + 0.5 * mirror.length * direction,
            angle_error=float(np.degrees(spread[1])),
            offset_error=float(spread[0]),
        )
    return mirror


def _slanting(mirror: LineMirror, view: ImageView) -> Array:
    """How much [m] of either end of a mirror a fit must not use, (2,).

    A cell that lies askew to the row is filled on one side only where the row ends: its centroid moves off the line, to
    opposite sides at the two ends, and turns a short wall. It does so as much as the cell's extents along and across
    the row are correlated.
    """
    ends = np.stack([mirror.start, mirror.end])
    across, along = line_cell(view, ends, mirror.direction)
    range_, u = view.to_polar(ends)
    correlation = np.sqrt(np.maximum(1.0 - (view.range_cell * view.cross_cell(range_, u) / (across * along)) ** 2, 0))
    return np.asarray(END_CELLS * correlation * along)


def leading_edge(mirror: LineMirror, view: ImageView) -> LineMirror:
    """The mirror moved to the front of a wall that scatters from inside.

    A thick wall's echoes lie deeper than its face. The mean power across the wall rises to a quarter of its peak half
    a resolution cell before the face; where that says that the fitted line lies well behind the face, it is moved.
    """
    _, offset, amplitude = across_profiles(mirror, view, reach=AROUND, spacing=PLACES[1])
    towards = np.sign(float((view.radar - mirror.center) @ mirror.normal)) or 1.0
    cell = float(np.median(offset[:, -1])) / AROUND
    if towards > 0.0:
        amplitude = amplitude[:, ::-1]
    # Now from in front of the wall to behind it.
    depth = np.linspace(-AROUND, AROUND, PROFILE_SAMPLES)
    peak = amplitude.max(axis=1)
    power = np.mean((amplitude / np.maximum(peak, np.median(peak))[:, None]) ** 2, axis=0)
    top = int(np.argmax(power))
    front = np.flatnonzero(power[:top] < HALF**2 * power[top])
    if not front.size:
        return mirror
    i = int(front[-1])
    crossing = depth[i] + (HALF**2 * power[top] - power[i]) / (power[i + 1] - power[i]) * (depth[i + 1] - depth[i])
    shift = float(crossing + 0.5) * cell
    if shift > -DEEP * view.range_cell:
        return mirror
    mirror = replace(
        mirror,
        start=mirror.start - shift * towards * mirror.normal,
        end=mirror.end - shift * towards * mirror.normal,
    )
    return _parallel_to_speckle(mirror, view)


def _parallel_to_speckle(mirror: LineMirror, view: ImageView) -> LineMirror:
    """The mirror turned about its middle to where the speckle of its wall is likeliest.

    The power of speckle is distributed exponentially about its mean (Goodman 2007), which depends on the depth behind
    the face alone. With the mean at each depth taken from the wall itself, the likelihood is largest where the mean of
    the depths' logarithmic means is smallest: a line askew smears the wall's steep front.
    """
    along, offset, amplitude = across_profiles(mirror, view, reach=BEHIND, spacing=PLACES[1])
    power = amplitude**2
    _, cell = line_cell(view, mirror.center[None], mirror.direction)
    width = LEVEL_CELLS * float(cell[0]) / (along[1] - along[0])
    level = uniform_filter1d(power.max(axis=1), max(1, round(width)), mode="nearest")
    power /= np.maximum(level, np.finfo(float).tiny)[:, None]
    position = along - 0.5 * mirror.length

    def unlikelihood(angle: float) -> float:
        rows = zip(offset, position, power, strict=True)
        turned = [np.interp(row + np.tan(angle) * at, row, values) for row, at, values in rows]
        return float(np.log(np.mean(turned, axis=0) + SPECKLE_FLOOR).mean())

    angle = 0.0
    for step in np.radians([LARGEST_TURN_DEG / 8.0, LARGEST_TURN_DEG / 64.0]):
        angle = min(angle + step * np.arange(-8, 9), key=unlikelihood)
    direction = mirror.direction + np.tan(angle) * mirror.normal
    half = 0.5 * mirror.length * direction / np.linalg.norm(direction)
    return replace(mirror, start=mirror.center - half, end=mirror.center + half)
