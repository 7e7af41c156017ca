"""The plane of a mirror, fitted to the volume itself instead of to single echoes, and the front of its wall."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.plane_mirror import PlaneMirror, plane_ranges
from mirrorfold.detection.volume_view import VolumeView

LARGEST_DEVIATION = 1.2
"""Deviation of a mirror's centroids, relative to the footprint of the beam and `INSIDE_CELLS` together: walls show
up to 0.8, for they average over the footprint, the flattest parts of a body 1.3 and more."""

INSIDE_CELLS = 0.065
"""What volume scattering adds at most to the deviation of a wall's centroids, in resolution cells."""

PROFILE_STEP = 0.1
"""Step of the mean profile across a wall, in range cells."""

PROFILE_CELLS = 1.0
"""Half-length of that profile, in resolution cells: it holds all that scatters inside."""

DEPTH_CELLS = 0.65
"""Deepest volume scattering that the leading edge of a wall is corrected for, in resolution cells: 4 cm where a cell
measures 6, for building materials scatter from 1 to 3 cm deep at 0.1 to 1 THz."""


def weighted_plane(points: Array, weight: Array) -> tuple[Array, Array]:
    """Normal and centroid of the plane with the least weighted squared distances."""
    center = weight @ points / weight.sum()
    offset = points - center
    return np.linalg.eigh((offset * weight[:, None]).T @ offset)[1][:, 0], center


def refitted(view: VolumeView, mirror: PlaneMirror) -> PlaneMirror | None:
    """The mirror moved to the plane through the centres of power of all its beams; None if they lie in no plane.

    A beam gathers echoes from all of its footprint, symmetrically about its axis: their centre of power lies on the
    plane, where single echoes are off by the footprint.
    """
    normal, center = mirror.normal, mirror.center
    cell = view.cell_at(center)
    sight = view.sight
    beams = np.flatnonzero(mirror.beams)
    for _ in range(3):
        predicted = plane_ranges(view, normal, center)[beams]
        cosine = np.abs(sight[beams] @ normal)
        spread = view.spread_across(predicted, cosine)
        half = (3.0 * spread + 0.5 * DEPTH_CELLS * cell) / cosine
        centroid, power = np.zeros(beams.size), np.zeros(beams.size)
        _centroids(view.amplitude.reshape(-1, view.range.size), beams, predicted, half, float(view.range[0]),
                   view.step, 2.0 * view.noise**2, centroid, power)  # fmt: skip
        good = power > 0.0
        points = view.radar + centroid[good, None] * sight[beams[good]]
        weight = 1.0 / spread[good] ** 2
        across = (points - center) @ normal
        deviation = 1.4826 * float(np.median(np.abs(across - np.median(across)))) + np.finfo(float).tiny
        weight = weight / (1.0 + (np.abs(across - np.median(across)) / (2.0 * deviation)) ** 4)
        fitted, center = weighted_plane(points, weight)
        normal = fitted * np.sign(fitted @ normal)
    # Beams a beam radius apart see the same speckle: fewer of them are independent.
    shared = float(np.mean(np.maximum(view.width(predicted) / (view.beam_step * predicted), 1.0) ** 2))
    independent = max(float(good.sum()) / shared, 3.0)
    size = float(np.sqrt(np.linalg.eigvalsh(np.cov(points.T))[1]))
    offset_error = deviation / np.sqrt(independent)
    if deviation > LARGEST_DEVIATION * float(np.hypot(np.median(spread), INSIDE_CELLS * cell)):
        return None
    depth = front_depth(view, normal, center, mirror.beams)
    return replace(
        mirror,
        center=center + depth * normal,
        normal=normal,
        angle_error=float(np.degrees(offset_error / max(size, np.finfo(float).tiny))),
        offset_error=offset_error,
        depth=depth,
    )


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _centroids(amplitude, beams, predicted, half, first, step, noise, centroid, power):  # type: ignore[no-untyped-def]
    """Centre of power [m] of each beam within `half` of its predicted range, the mean noise power taken off."""
    for i in range(beams.size):
        low = max(int(np.ceil((predicted[i] - half[i] - first) / step)), 0)
        high = min(int((predicted[i] + half[i] - first) / step), amplitude.shape[1] - 1)
        moment = 0.0
        for n in range(low, high + 1):
            excess = amplitude[beams[i], n] ** 2 - noise
            power[i] += excess
            moment += n * excess
        if power[i] > 0.0:
            centroid[i] = first + step * moment / power[i]


def front_depth(view: VolumeView, normal: Array, center: Array, beams: Mask) -> float:
    """How far [m] the face of a wall lies in front of the centroids of its echoes.

    The mean power across the wall is a Gaussian of known width, the footprint's, for what scatters on the face,
    and the same convolved with an exponential decay for what scatters inside (Grushka, Anal. Chem. 44, 1972).
    """
    from scipy.optimize import least_squares  # slow to load, and needed here alone
    from scipy.special import erfcx

    which = np.flatnonzero(beams)
    predicted = plane_ranges(view, normal, center)[which]
    cosine = np.abs(view.sight[which] @ normal)
    spread = view.spread_across(predicted, cosine)
    cell = view.cell_at(center)
    step, reach = PROFILE_STEP * view.range_cell, PROFILE_CELLS * cell
    z = np.arange(-reach, reach + 0.5 * step, step)
    largest = DEPTH_CELLS * cell
    profile = np.zeros(z.size)
    _stack(view.amplitude.reshape(-1, view.range.size), which, predicted, 1.0 / cosine, float(view.range[0]),
           view.step, 2.0 * view.noise**2, z, profile)  # fmt: skip
    if profile.max() <= 0.0:
        return 0.0
    profile /= profile.max()
    sigma = float(np.sqrt(np.mean(spread**2)))

    def model(p: Array) -> Array:
        at, width, face, inside, depth = p
        s = sigma * width
        t = (z - at) / s
        gauss = np.exp(-0.5 * t**2)
        rate = s / depth
        with np.errstate(over="ignore", invalid="ignore"):
            tail = np.sqrt(np.pi / 2.0) * rate * erfcx((rate - t) / np.sqrt(2.0)) * gauss
        tail = np.where(np.isfinite(tail), tail, rate * np.sqrt(2.0 * np.pi) * np.exp(0.5 * rate**2 - rate * t))
        return np.asarray(face * gauss + inside * tail)

    # Place of the face, width of the beam's footprint over its nominal one, weights of face and inside, depth.
    start = np.array([-0.3 * sigma, 1.0, 0.5, 0.5, 0.15 * largest])
    low, high = [-largest, 0.95, 0.0, 0.0, step], [largest, 1.05, 4.0, 8.0, largest]
    scale = [sigma, 1.0, 1.0, 1.0, largest]
    fit = least_squares(lambda p: model(p) - profile, start, bounds=(low, high), x_scale=scale)
    return float(np.clip(-fit.x[0], 0.0, largest))


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _stack(amplitude, beams, predicted, stretch, first, step, noise, z, profile):  # type: ignore[no-untyped-def]
    """Mean power at the depths z behind a plane, over beams; each weighs with its own total."""
    line = np.empty(z.size)
    for i in range(beams.size):
        total = 0.0
        for k in range(z.size):
            at = (predicted[i] + z[k] * stretch[i] - first) / step
            n = int(at)
            line[k] = 0.0
            if at >= 0.0 and n + 1 < amplitude.shape[1]:
                share = at - n
                value = amplitude[beams[i], n] * (1.0 - share) + amplitude[beams[i], n + 1] * share
                line[k] = value * value - noise
            total += line[k]
        if total > 0.0:
            for k in range(z.size):
                profile[k] += line[k] / total
