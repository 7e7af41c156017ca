"""The public face of focusing: sweeps in, images out."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mirrorfold.common.threads import Progress
from mirrorfold.errors import InputError
from mirrorfold.focusing.accuracy import measured_error
from mirrorfold.focusing.grid import extent
from mirrorfold.focusing.plan import Apodization, check_measurement, make_problem, prove
from mirrorfold.focusing.problem import Problem
from mirrorfold.focusing.range_profiles import focus_raster, to_voxels
from mirrorfold.focusing.tfm import focus_exact
from mirrorfold.sweep import is_raster
from mirrorfold.sweep import wave_speed as own_wave_speed

NORMALISATIONS = {"none": 0, "r": 1, "r2": 2}
"""Powers of the range from the radar position that the image may be multiplied with."""

CHECKED_FRAMES = 8
"""Of a sweep with more frames, as many are compared with the direct sum, evenly chosen."""


def focus(
    sweep: xr.Dataset,
    *,
    x: ArrayLike | None = None,
    y: ArrayLike | None = None,
    z: ArrayLike | None = None,
    tolerance: float = 1e-4,
    taper: str | ArrayLike = "hann",
    apodization: Apodization = None,
    wave_speed: float | None = None,
    normalization: str = "none",
    progress: Progress | None = None,
) -> xr.DataArray:
    """Focus a sweep on a regular grid of pixels: the total focusing method, by the fastest way that is exact enough.

    The image is ``I(p) = sum_m,i,k a[m] w[i] v[k] S[m,i,k] exp(+j k_m (R_i(p) + R_k(p)))`` (Holmes, Drinkwater and
    Wilcox 2005), with the distances R of pixel p from transmitter i and receiver k, the taper a over frequency and the
    apodization w, v over the elements. Line arrays take a structured path; any other geometry the sum over all pairs.
    Either is compared with the float64 sum on random pixels of the very image, and refined until `tolerance` holds.

    Parameters
    ----------
    sweep : xarray.Dataset
        ``s(frequency, tx, rx)`` with ``tx_position``, ``rx_position`` [m]; or of one moving antenna,
        ``s(frequency, position)`` with ``antenna_position`` [m]. Leading dimensions, such as `frame`, are kept.
    x, y, z : 1D arrays [m], optional
        Pixel coordinates; x and y default to everything the array can see (`default_grid`). A single element sees
        ranges only: give one x, and y. With a 1D `z` the image is
        a volume; a single number (default 0) is the height of a plane.
    tolerance : float
        Largest relative L2 error of the image.
    taper : str or (frequencies,) array
        ``"hann"``, ``"triangular"`` (Cui and Trichopoulos 2024), ``"uniform"``, ``"taylor"``, or weights.
    apodization : str, (elements,) array, or a pair of them for transmitters and receivers, optional
        Weights over the elements, complex if need be; default uniform.
    wave_speed : float [m/s]
        Default: the attr `wave_speed` of the sweep; without it, of light in vacuum.
    normalization : {"none", "r", "r2"}
        Multiply by this power of the range from the radar position. For a raster scan "none", "r2" or "beam".
    progress : callable, optional
        Called as ``progress(done, total)`` now and then.

    Returns
    -------
    xarray.DataArray
        ``image``, complex64, (..., y, x) or (..., z, y, x). Of a raster scan, whose beams are focused by its lens, it
        is the volume (range, azimuth, elevation), exact, or with x, y and z its amplitude (z, y, x). Among its attrs:
        `algorithm`, `error` (measured),
        `radar_position`, `ambiguous_range` [m], `frequency_start`, `frequency_stop`, `frequency_step` [Hz].

    Raises
    ------
    InputError
        If the sweep is not valid or has one element; if pixels stand on an antenna or all of them beyond the ambiguous
        range; if the image does not fit into memory; for a taper, apodization, tolerance or wave speed that makes no
        sense.
    """
    if is_raster(sweep):
        return _focus_raster(sweep, x, y, z, taper, normalization, progress)
    if normalization not in NORMALISATIONS:
        raise InputError(f"normalization is {normalization!r}, expected one of {', '.join(NORMALISATIONS)}")
    sweep = check_measurement(sweep)
    if "s" not in sweep:
        raise InputError("sweep: holds no variable 's'; expected a sweep with s(frequency, tx, rx)")
    wave_speed = own_wave_speed(sweep) if wave_speed is None else wave_speed
    problem = make_problem(sweep, x, y, z, tolerance, taper, apodization, wave_speed)
    values = sweep["s"].values
    leading = sweep["s"].dims[: -2 if problem.monostatic else -3]
    frames = np.ascontiguousarray(values, dtype=np.complex64).reshape(-1, *problem.data_shape)
    start = time.perf_counter()
    images, error, algorithm = _focus_frames(problem, frames, tolerance, progress)
    seconds = time.perf_counter() - start
    if normalization != "none":
        images *= (_ranges(problem) ** NORMALISATIONS[normalization]).astype(np.float32)
    volume = z is not None and np.ndim(z) == 1
    images = images.reshape(*(sweep.sizes[d] for d in leading), *problem.shape)
    attrs = _attrs(sweep, problem, wave_speed)
    attrs |= {"algorithm": algorithm, "tolerance": float(tolerance), "error": error, "normalization": normalization}
    attrs |= {"taper": taper if isinstance(taper, str) else np.abs(problem.taper)}
    named = "uniform" if apodization is None else apodization
    attrs |= {"apodization": named if isinstance(named, str) else "given"}
    if len(frames) > 1:
        attrs["frames_per_second"] = len(frames) / seconds
    coords: dict[str, Any] = {
        "y": ("y", problem.y, {"units": "m", "long_name": "range"}),
        "x": ("x", problem.x, {"units": "m", "long_name": "cross-range"}),
        "z": ("z", problem.z, {"units": "m", "long_name": "height"}),
    }
    coords |= {
        str(name): value for name, value in sweep.coords.items() if set(value.dims) <= set(leading) and value.dims
    }
    if not volume:
        images = images[..., 0, :, :]
        coords["z"] = xr.Variable((), problem.z[0], {"units": "m", "long_name": "height"})
    dims = (*leading, "z", "y", "x") if volume else (*leading, "y", "x")
    return xr.DataArray(images, dims=dims, coords=coords, attrs=attrs, name="image")


def _focus_raster(
    sweep: xr.Dataset,
    x: ArrayLike | None,
    y: ArrayLike | None,
    z: ArrayLike | None,
    taper: str | ArrayLike,
    normalization: str,
    progress: Progress | None,
) -> xr.DataArray:
    """The volume of a raster scan, or its amplitude on a Cartesian grid where that is given."""
    volume = focus_raster(sweep, taper=taper, normalization=normalization, progress=progress)
    if x is None and y is None and z is None:
        return volume
    if x is None or y is None or z is None:
        raise InputError("x, y and z: a raster scan is gridded on all three or on none; give the missing ones")
    return to_voxels(volume, x=x, y=y, z=z)


def _focus_frames(
    problem: Problem, frames: NDArray[np.complex64], tolerance: float, progress: Progress | None
) -> tuple[NDArray[np.complex64], float, str]:
    """Images (frames, z, y, x) with the largest measured error and the algorithm used."""
    inner = progress if len(frames) == 1 else None
    fast, first, error = prove(problem, tolerance, frames[0], inner)
    if len(frames) == 1 and fast is not None and first is not None:
        return first[None], error, fast.algorithm
    images = np.empty((len(frames), *problem.shape), dtype=np.complex64)
    checked = set(np.linspace(0, len(frames) - 1, min(len(frames), CHECKED_FRAMES)).astype(int))
    worst = 0.0
    for n, s in enumerate(frames):
        images[n] = fast(s) if fast is not None else focus_exact(problem, s, 0.5 * tolerance, inner)
        if n in checked and np.any(s):
            error = measured_error(problem, images[n], s, seed=n)
            if error > tolerance and fast is not None:
                fast = None
                images[n] = focus_exact(problem, s, 0.5 * tolerance)
                error = measured_error(problem, images[n], s, seed=n)
            worst = max(worst, error)
        if progress is not None and len(frames) > 1:
            progress(n + 1, len(frames))
    if worst > tolerance:
        raise InputError(
            f"tolerance is {tolerance:g} and the image's error {worst:.2g}: its echoes cancel below what single "
            "precision holds; ask for a larger tolerance, or remove the strong echoes that cancel"
        )
    return images, worst, "exact" if fast is None else fast.algorithm


def _ranges(problem: Problem) -> NDArray[np.float64]:
    """Distance [m] of every pixel from the mean of the antenna positions, (z, y, x)."""
    radar = _radar(problem)
    return np.asarray(
        np.sqrt(
            (problem.x[None, None, :] - radar[0]) ** 2
            + (problem.y[None, :, None] - radar[1]) ** 2
            + (problem.z[:, None, None] - radar[2]) ** 2
        )
    )


def _radar(problem: Problem) -> NDArray[np.float64]:
    return np.asarray(0.5 * (problem.tx.mean(axis=0) + problem.rx.mean(axis=0)))


def _direction(problem: Problem) -> NDArray[np.float64]:
    """Unit vector along the arrays, pointing to +x where it can."""
    offset = np.concatenate([problem.tx - problem.tx.mean(axis=0), problem.rx - problem.rx.mean(axis=0)])
    if not np.any(np.abs(offset) > 0.0):
        return np.array([1.0, 0.0, 0.0])
    along = np.linalg.svd(offset, full_matrices=False)[2][0]
    return np.asarray(along * (1.0 if along[np.argmax(np.abs(along))] > 0.0 else -1.0))


def _attrs(sweep: xr.Dataset, problem: Problem, wave_speed: float) -> dict[str, Any]:
    """What an image has to know about the measurement."""
    frequency = sweep["frequency"].values
    see = extent(frequency, problem.tx, problem.rx, wave_speed)
    attrs: dict[str, Any] = {
        "mirrorfold_kind": "image",
        "radar_position": _radar(problem),
        "array_direction": _direction(problem),
        "ambiguous_range": see.ambiguous_range,
        "range_resolution": see.range_resolution,
        "frequency_start": float(frequency[0]),
        "frequency_stop": float(frequency[-1]),
        "frequency_step": float((frequency[-1] - frequency[0]) / max(frequency.size - 1, 1)),
        "frequency_points": int(frequency.size),
        "tx_aperture": float(np.linalg.norm(np.ptp(problem.tx, axis=0))),
        "rx_aperture": float(np.linalg.norm(np.ptp(problem.rx, axis=0))),
        "wave_speed": float(wave_speed),
    }
    for name in ("title", "instrument"):
        if name in sweep.attrs:
            attrs[name] = sweep.attrs[name]
    return attrs
