"""`focus`: the image of a sweep, made by the fastest algorithm that keeps to the tolerance, and its measured error."""

from __future__ import annotations

import time
import warnings
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.arguments import in_message, wrong_kind
from mirrorfold.common.forecasts import tell
from mirrorfold.common.normalization import IMAGE_NORMALIZATIONS, RANGE_POWERS
from mirrorfold.common.settings import takes
from mirrorfold.common.threads import counted
from mirrorfold.common.types import Array, Progress
from mirrorfold.errors import InputError
from mirrorfold.focusing.checks import make_problem
from mirrorfold.focusing.choosing.caching import PlanCache, plan_cache
from mirrorfold.focusing.choosing.choice import EXACT_SHARE
from mirrorfold.focusing.choosing.proven import prove
from mirrorfold.focusing.choosing.strips import Strip, divide, held_parts, room_for_tables, table_bytes
from mirrorfold.focusing.exact.accuracy import measured_error
from mirrorfold.focusing.exact.exact_sum import focus_exact
from mirrorfold.focusing.labels import Labels
from mirrorfold.focusing.problem import Problem
from mirrorfold.focusing.scans.imaging import focus_scans
from mirrorfold.focusing.settings import FINEST_TOLERANCE, FocusSettings
from mirrorfold.sweep import is_raster
from mirrorfold.sweep.samples import check_level

SMALLEST = float(np.finfo(np.float32).tiny)
"""Divisor in place of the norm of an image that is zero everywhere."""

CHECKED_FRAMES = 8
"""At most so many frames of a sweep are compared with the float64 sum; they are chosen evenly."""


@takes(FocusSettings)
def focus(
    sweep: xr.Dataset, *, plans: PlanCache | None = None, progress: Progress | None = None, **given: Any
) -> xr.DataArray:
    """Focus a sweep on a regular grid of pixels: the total focusing method, to a given tolerance.

    The image is ``I(p) = sum_m,i,k a[m] w[i] v[k] S[m,i,k] exp(+j k_m (R_i(p) + R_k(p)))`` (Holmes, Drinkwater and
    Wilcox 2005), with the distances R of pixel p from transmitter i and receiver k, the wavenumber k_m, the taper
    a over frequency and the apodization w, v over the elements. For line arrays, and for large arrays of any other
    shape, a fast algorithm computes this sum where that saves time; otherwise all pairs are summed. The image is
    compared with the float64 sum on random pixels. If its error exceeds `tolerance`, it is made anew, more finely.

    Parameters
    ----------
    sweep : xarray.Dataset
        ``s(frequency, tx, rx)`` with ``tx_position``, ``rx_position`` [m]; of one moving antenna,
        ``s(frequency, position)`` with ``antenna_position`` [m]; or of a raster scan,
        ``s(frequency, azimuth, elevation)``. Leading dimensions, such as `frame`, are kept.
    **given
    plans : PlanCache, optional
        Keeps the tables that a fast algorithm has made for this geometry and these settings, for the next sweep. By
        default the cache of the whole process, `mirrorfold.focusing.plan_cache`;
        ``mirrorfold.focusing.plan_cache.clear()`` empties it.
    progress : callable, optional
        Called as ``progress(done, total)`` now and then.

    Returns
    -------
    xarray.DataArray
        ``image``, complex64, (..., y, x) or (..., z, y, x). Of a raster scan, whose beams are focused by its lens, it
        is the volume (range, azimuth, elevation), or with x, y and z its amplitude (z, y, x). Among its attrs:
        `radar_position`, `ambiguous_range` [m], `frequency_start`, `frequency_stop`, `frequency_step` [Hz],
        `wave_speed` [m/s]; of an array also `algorithm` ("polar", "factorized" or "exact", see `FocusPlan`) and
        `error`, the measured relative L2 error (of several frames, the largest). Where the memory does not hold the
        tables of the whole image, it is made in strips, perhaps by different algorithms; the attr `strips` counts them.

    Raises
    ------
    InputError
        If the sweep is not valid, or has one element and more than a range profile is wanted; if a pixel stands on an
        antenna, or all pixels beyond the ambiguous range; if the image does not fit into memory, or single precision
        does not reach the tolerance; for a setting that makes no sense.
    """
    settings = FocusSettings().with_given(**given)
    if plans is not None and not isinstance(plans, PlanCache):
        raise wrong_kind("plans", plans, "a PlanCache", reader="")
    if is_raster(sweep):
        return focus_scans(sweep, settings, progress)
    if settings.normalization not in IMAGE_NORMALIZATIONS:
        raise InputError(
            f"normalization is {in_message(settings.normalization)}, which raster scans alone have; "
            f"expected one of {', '.join(IMAGE_NORMALIZATIONS)}"
        )
    sweep, problem = make_problem(sweep, settings)
    if "s" not in sweep:
        raise InputError("sweep: holds no variable 's'; expected a sweep with s(frequency, tx, rx)")
    values = sweep["s"].values
    check_level("sweep: s", values)
    leading = sweep["s"].dims[: -2 if problem.monostatic else -3]
    frames = np.ascontiguousarray(values, dtype=np.complex64).reshape(-1, *problem.data_shape)
    start = time.perf_counter()
    tolerance = float(settings.tolerance)
    plans = plan_cache if plans is None else plans
    room = plans.nbytes + room_for_tables(problem, len(frames), settings.memory_limit, samples_held=True)
    scaled = problem.in_wavelengths
    strips = divide(scaled, lambda part: plans.options(part, tolerance, len(frames)), room)
    tables = max(table_bytes(strip.problem, strip.option) for strip in strips)
    parts = held_parts(problem, len(frames)) | {"tables, buffers and proof": tables}
    tell(parts, f"focusing {problem.pixels} pixels in {len(strips)} strip{'s' if len(strips) > 1 else ''}")
    if len(strips) > 1:
        warnings.warn(
            f"the memory does not hold the tables of the whole image: it is made in {len(strips)} strips, which takes "
            "longer",
            stacklevel=3,  # the line that called `focus`
        )
    images, error, algorithms = _focus_strips(scaled, strips, frames, tolerance, plans, room, progress)
    if error > tolerance:
        raise InputError(
            f"tolerance is {tolerance:g} and the image's error {error:.2g}: its echoes cancel below what single "
            "precision holds; ask for a larger tolerance, or remove the strong echoes that cancel"
        )
    seconds = time.perf_counter() - start
    if settings.normalization != "none":
        images *= (_ranges(problem) ** RANGE_POWERS[settings.normalization]).astype(np.float32)
    images = images.reshape(*(sweep.sizes[d] for d in leading), *problem.shape)
    labels = Labels(sweep, problem, settings, leading)
    attrs = {"algorithm": " and ".join(sorted(algorithms)), "error": error}
    if len(strips) > 1:
        attrs["strips"] = len(strips)
    if len(frames) > 1:
        attrs["frames_per_second"] = len(frames) / seconds
    return labels.image(images, attrs)


def _focus_strips(
    problem: Problem,
    strips: list[Strip],
    frames: NDArray[np.complex64],
    tolerance: float,
    plans: PlanCache,
    room: float,
    progress: Progress | None,
) -> tuple[NDArray[np.complex64], float, set[str]]:
    """Images (frames, z, y, x), their relative L2 error, and the algorithms used; `room` [bytes] is left for tables.

    The errors of the strips, weighted by the norms of their images, add as squares to the error of the whole image.
    """
    if len(strips) == 1:
        images, error, algorithm_used = _focus_frames(problem, frames, tolerance, plans, room, progress)
        return images, error, {algorithm_used}
    count = len(strips)
    images = np.empty((len(frames), *problem.shape), dtype=np.complex64)
    norms, errors, used = np.zeros(count), np.full(count, np.inf), [""] * count
    step = counted(progress, count)
    # The error of a strip may be tolerance * norm of the image / (sqrt(number of strips) * norm of the strip). Norms
    # are known only after the first pass, which accepts any error; the second one makes anew the strips that exceed it.
    goals = np.full(count, np.inf)
    for second_pass in (False, True):
        for n, strip in enumerate(strips):
            if second_pass and errors[n] <= goals[n]:
                continue
            plans.clear()  # frees the tables of the strip before
            part, errors[n], used[n] = _focus_frames(strip.problem, frames, tolerance, plans, room, None, goals[n])
            images[:, *strip.rows] = part
            norms[n] = np.linalg.norm(part)
            if not second_pass:
                step()
        errors[norms == 0.0] = 0.0
        image_norm = max(float(np.linalg.norm(norms)), SMALLEST)
        goals = tolerance * image_norm / np.sqrt(count) / np.maximum(norms, SMALLEST)
    plans.clear()
    return images, float(np.linalg.norm(errors * norms)) / image_norm, set(used)


def _focus_frames(
    problem: Problem,
    frames: NDArray[np.complex64],
    tolerance: float,
    plans: PlanCache,
    room: float,
    progress: Progress | None,
    goal: float | None = None,
) -> tuple[NDArray[np.complex64], float, str]:
    """Images (frames, z, y, x), the largest relative L2 error measured on a frame, and the algorithm used.

    The images are planned for `tolerance`; their measured error must keep under `goal`, by default the tolerance.
    """
    goal = tolerance if goal is None else goal
    frame_progress = progress if len(frames) == 1 else None
    first = next((s for s in frames if np.any(s)), frames[0])  # an empty frame has no relative error
    proven = prove(problem, tolerance, first, plans, len(frames), frame_progress, room, goal)
    if len(frames) == 1 and proven is not None:
        return proven.image[None], proven.error, proven.plan.algorithm
    plan, finer = None if proven is None else proven.plan, EXACT_SHARE * tolerance
    images = np.empty((len(frames), *problem.shape), dtype=np.complex64)
    checked = set(np.linspace(0, len(frames) - 1, min(len(frames), CHECKED_FRAMES)).astype(int))
    largest_error, step = 0.0, counted(None if len(frames) == 1 else progress, len(frames))
    for n, s in enumerate(frames):
        images[n] = plan(s) if plan is not None else focus_exact(problem, s, finer, frame_progress)
        if n in checked and np.any(s):
            error = measured_error(problem, images[n], s, seed=n)
            while error > goal and (plan is not None or finer > FINEST_TOLERANCE):
                # Where all echoes lie beside the image, it is dark, and the same absolute error is relatively larger.
                finer = finer if plan is not None else max(finer * min(0.5, 0.5 * goal / error), FINEST_TOLERANCE)
                plan = None
                images[n] = focus_exact(problem, s, finer)
                error = measured_error(problem, images[n], s, seed=n)
            largest_error = max(largest_error, error)
        step()
    return images, largest_error, "exact" if plan is None else plan.algorithm


def _ranges(problem: Problem) -> Array:
    """Distance [m] of every pixel from the radar, (z, y, x)."""
    radar = problem.radar_position
    return np.asarray(
        np.sqrt(
            (problem.x[None, None, :] - radar[0]) ** 2
            + (problem.y[None, :, None] - radar[1]) ** 2
            + (problem.z[:, None, None] - radar[2]) ** 2
        )
    )
