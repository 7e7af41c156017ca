"""Step 2, between its halves: the line or plane of a mirror, fitted to the image itself, not to single echoes.

A tenth of a degree is what folding asks for. The centre of power across the mirror, place by place, gives it, where
single echoes stray by speckle; a wall that scatters from inside is moved to its front.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np

from mirrorfold.common.types import Array
from mirrorfold.detection.mirror import Mirror
from mirrorfold.detection.view import DEVIATION, View

PROFILE_SAMPLES = 61
"""Samples of a profile across a mirror."""

FEWEST_PLACES = 4
"""Of a fit to places along a mirror."""

ROUNDS = 3
"""Of a fit: each begins where the one before has led."""

PROFILE_STEP = 0.1
"""Step of the mean profile across a wall, in range cells."""

PROFILE_CELLS = 1.0
"""Half-length of that profile, in resolution cells: it holds all that scatters inside."""

DEPTH_CELLS = 0.65
"""Deepest volume scattering that the leading edge of a wall is corrected for, in resolution cells: 4 cm where a cell
measures 6, for building materials scatter from 1 to 3 cm deep at 0.1 to 1 THz."""

M = TypeVar("M", bound=Mirror)


def flat(points: Array, weight: Array) -> tuple[Array, Array]:
    """Unit normal and centroid of the line or plane with the least weighted squared distances to points (n, d)."""
    center = weight @ points / weight.sum()
    offset = points - center
    return np.linalg.eigh((offset * weight[:, None]).T @ offset)[1][:, 0], center


class Fit(NamedTuple):
    """A line or plane through points: normal and center (d,), how far [m] the points stray from it, robust, and the
    standard errors of its offset [m] and angle [degree].
    """

    normal: Array
    center: Array
    deviation: float
    offset_error: float
    angle_error: float


def robust(points: Array, weight: Array, independent: float) -> Fit:
    """The line or plane through points (n, d), with Cauchy weights against those that stand elsewhere.

    Of the points so many are `independent`: neighbours share a resolution cell and its speckle.
    """
    trust = weight
    for _ in range(ROUNDS):
        normal, center = flat(points, trust)
        beside = (points - center) @ normal
        deviation = 1.4826 * float(np.median(np.abs(beside))) + np.finfo(float).tiny
        trust = weight / (1.0 + (beside / (2.0 * deviation)) ** 2)
    variance = float(np.average(beside**2, weights=trust)) / max(independent - points.shape[1], 1.0)
    size = float(np.sqrt(np.linalg.eigvalsh(np.cov(points.T, aweights=trust))[1]))
    return Fit(normal, center, deviation, np.sqrt(variance), float(np.degrees(np.sqrt(variance) / size)))


def refined(mirror: M, view: View, reach: float, lobe: float, clip: float) -> tuple[M, float]:
    """A mirror moved to the line or plane through the centres of power across it, and how far [m] these stray.

    Profiles across the mirror are taken up to `reach` widths of the resolution cell to either side, their main lobes
    down to the amplitude `lobe` relative to their peaks. Places weigh with their power up to `clip` times the median.
    """
    base = mirror.places(view)
    for _ in range(ROUNDS):
        across = view.extent(base, mirror.normal)
        depth = across[:, None] * np.linspace(-reach, reach, PROFILE_SAMPLES)
        beyond, power = mirror.profiles(view, base, depth)
        peak = power.max(axis=1)
        power = np.where(power >= lobe**2 * peak[:, None], power, 0.0)
        total = power.sum(axis=1)
        lit = np.flatnonzero(total > 0.0)
        if lit.size < FEWEST_PLACES:
            return mirror, np.inf
        centroid = np.sum(power[lit] * depth[lit], axis=1) / total[lit]
        weight = np.minimum(peak[lit] / np.median(peak[lit]), clip) / across[lit] ** 2
        fit = robust(base[lit] + centroid[:, None] * beyond[lit], weight, mirror.independent(view))
        mirror = mirror.moved(fit.normal, fit.center)
        mirror = replace(mirror, angle_error=fit.angle_error, offset_error=fit.offset_error)
        base = mirror.places(view)
        if not np.isfinite(base).all():  # it has turned away from lines of sight that should meet it
            return mirror, np.inf
    return mirror, fit.deviation


def front_depth(mirror: Mirror, view: View) -> float:
    """How far [m] the face of a wall lies in front of the centres of power of its echoes.

    The mean power across the wall is a Gaussian of known width, the resolution cell's, for what scatters on the face,
    and the same convolved with an exponential decay for what scatters inside (Grushka, Anal. Chem. 44, 1972).
    """
    from scipy.optimize import least_squares  # slow to load, and needed here alone
    from scipy.special import log_ndtr

    base = mirror.places(view)
    cell = view.cell_at(mirror.center)
    step, largest = PROFILE_STEP * view.range_cell, DEPTH_CELLS * cell
    depth = np.arange(-PROFILE_CELLS * cell, PROFILE_CELLS * cell + 0.5 * step, step)
    _, power = mirror.profiles(view, base, np.broadcast_to(depth, (len(base), depth.size)))
    total = power.sum(axis=1)
    profile = np.sum(power[total > 0.0] / total[total > 0.0, None], axis=0)
    profile /= profile.max()
    sigma = DEVIATION * float(np.sqrt(np.mean(view.extent(base, mirror.normal) ** 2)))

    def model(p: Array) -> Array:
        at, width, face, inside, decay = p
        t, rate = (depth - at) / (sigma * width), sigma * width / decay
        tail = np.sqrt(2.0 * np.pi) * rate * np.exp(0.5 * rate**2 - rate * t + log_ndtr(t - rate))
        return np.asarray(face * np.exp(-0.5 * t**2) + inside * tail)

    # Place of the face, width of the cell over its nominal one, weights of face and inside, depth of decay.
    low, high = [-largest, 0.95, 0.0, 0.0, step], [largest, 1.05, 4.0, 8.0, largest]
    start = np.clip([-0.3 * sigma, 1.0, 0.5, 0.5, 0.15 * largest], low, high)
    scale = [sigma, 1.0, 1.0, 1.0, largest]
    fit = least_squares(lambda p: model(p) - profile, start, bounds=(low, high), x_scale=scale, ftol=1e-4)
    return float(np.clip(-fit.x[0], 0.0, largest))
