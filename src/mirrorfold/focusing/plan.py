"""A reusable plan: which algorithm focuses which pixels, proven against the direct sum."""

from __future__ import annotations

import time
import warnings
from contextlib import suppress

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mirrorfold.common.memory import available_memory
from mirrorfold.common.threads import Progress
from mirrorfold.common.windows import window
from mirrorfold.errors import InputError
from mirrorfold.focusing.accuracy import measured_error
from mirrorfold.focusing.factorized import FactorizedPlan
from mirrorfold.focusing.grid import default_grid, extent
from mirrorfold.focusing.linear import PolarPlan
from mirrorfold.focusing.nodes import UnsuitedError
from mirrorfold.focusing.problem import Problem, pixel_axis
from mirrorfold.focusing.tfm import ROUNDING, TABLE_BYTES, focus_exact
from mirrorfold.sweep import MONOSTATIC_DIMENSIONS, PAIR_DIMENSIONS, antenna_positions, check_sweep
from mirrorfold.sweep import wave_speed as own_wave_speed

REFINEMENTS = 3
"""Tries at a third of the tolerance each before the exact kernel takes over."""

FEWEST_PAIR_PIXELS = 2e8
"""Below this many pair-pixels the exact kernel needs no more time than building a plan."""

SAMPLING_MARGIN = 0.8
"""Share of the tolerance that the error measured on a sample of pixels must keep under."""

NEAREST_PIXEL = 1e-3
"""Distance of a pixel from an antenna, in wavelengths, under which it stands on it."""

FastPlan = PolarPlan | FactorizedPlan
"""In the order in which they are tried: the first is the faster, the second suits any array."""

Apodization = str | ArrayLike | tuple[str | ArrayLike | None, str | ArrayLike | None] | None


def check_measurement(sweep: xr.Dataset) -> xr.Dataset:
    """A valid sweep of pairs or of one moving antenna; a geometry without data passes too."""
    if not isinstance(sweep, xr.Dataset) or "s" in sweep:
        return check_sweep(sweep)
    if "frequency" in sweep.variables:
        dims: tuple[str, ...] = PAIR_DIMENSIONS
        names: tuple[str, ...] = ("frequency", "tx_position", "rx_position")
        if "antenna_position" in sweep.variables:
            dims, names = MONOSTATIC_DIMENSIONS, ("frequency", "antenna_position")
        if set(names) <= set(sweep.variables) and all(sweep[name].ndim for name in names):
            shape = tuple(len(sweep[name]) for name in names)
            check_sweep(sweep.assign(s=(dims, np.broadcast_to(np.complex64(1.0), shape))))
            return sweep
    return check_sweep(sweep)


def make_problem(
    sweep: xr.Dataset,
    x: ArrayLike | None,
    y: ArrayLike | None,
    z: ArrayLike | None,
    tolerance: float,
    taper: str | ArrayLike,
    apodization: Apodization,
    wave_speed: float | None,
) -> Problem:
    """The focusing problem of a checked sweep on checked pixels.

    Raises
    ------
    InputError
        With what is wrong with the request; see `focus`.
    """
    if wave_speed is None:
        wave_speed = own_wave_speed(sweep)
    if not isinstance(wave_speed, (int, float)) or not np.isfinite(wave_speed) or wave_speed <= 0.0:
        raise InputError(f"wave_speed is {wave_speed!r}, expected a positive number of metres per second")
    if not isinstance(tolerance, (int, float)) or not 0.0 < tolerance < 1.0:
        raise InputError(f"tolerance is {tolerance!r}, expected a relative error between {ROUNDING:g} and 1")
    if tolerance < ROUNDING:
        raise InputError(
            f"tolerance is {tolerance:g}, finer than the {ROUNDING:g} that single-precision images can hold; "
            "ask for a larger one"
        )
    monostatic = "antenna_position" in sweep.variables
    tx, rx = antenna_positions(sweep)
    centre = None if sweep.attrs.get("scene_center") is None else np.asarray(sweep.attrs["scene_center"], dtype=float)
    frequency = np.asarray(sweep["frequency"].values, dtype=np.float64)
    if len(tx) * (1 if monostatic else len(rx)) < 2 and (x is None or y is None or np.size(x) > 1 or np.size(y) < 2):
        raise InputError(
            "the sweep has one element, which sees no direction; measure at two positions at least, or ask for a range "
            "profile: a single x and many y"
        )
    if x is None or y is None:
        own_x, own_y = default_grid(frequency, tx, rx, wave_speed, centre=centre)
        x, y = own_x if x is None else x, own_y if y is None else y
    tx_window, rx_window = apodization if isinstance(apodization, tuple) else (apodization, apodization)
    problem = Problem(
        k=2.0 * np.pi * frequency / wave_speed,
        tx=tx,
        rx=rx,
        taper=window(taper, frequency.size, "taper"),
        tx_weight=window(tx_window, len(tx), "apodization"),
        rx_weight=window(None if monostatic else rx_window, len(rx), "apodization"),
        x=pixel_axis(x, "x"),
        y=pixel_axis(y, "y"),
        z=pixel_axis((0.0 if centre is None else centre[2]) if z is None else z, "z"),
        monostatic=monostatic,
    )
    _check_pixels(problem, extent(frequency, tx, rx, wave_speed).ambiguous_range, centre)
    return problem


def _check_pixels(problem: Problem, ambiguous_range: float, centre: NDArray[np.float64] | None) -> None:
    """Refuse pixels on antennas and beyond the ambiguous range, and images that do not fit into memory.

    Ranges count from the radar; where the scene has a centre, by half of them to either side of it.
    """
    axes = (problem.x, problem.y, problem.z)
    antennas = np.unique(np.concatenate([problem.tx, problem.rx]), axis=0)
    gaps = [np.abs(antennas[:, n, None] - axis[None, :]) for n, axis in enumerate(axes)]
    nearest = np.sqrt(sum(gap.min(axis=1) ** 2 for gap in gaps))
    wavelength = 2.0 * np.pi / float(problem.k[-1])
    if nearest.min() < NEAREST_PIXEL * wavelength:
        spot = ", ".join(f"{value:g}" for value in antennas[int(np.argmin(nearest))])
        raise InputError(f"a pixel stands on the antenna at ({spot}) m; move or shorten the grid")
    start, place = "the radar", 0.5 * (problem.tx.mean(axis=0) + problem.rx.mean(axis=0))
    if centre is not None:
        start, place, ambiguous_range = "the centre of the scene", centre, 0.5 * ambiguous_range
    spans = [np.abs(axis - place[n]) for n, axis in enumerate(axes)]
    closest = float(np.sqrt(sum(span.min() ** 2 for span in spans)))
    if closest > ambiguous_range:
        raise InputError(
            f"the grid begins {closest:.3g} m from {start}, beyond the ambiguous range of {ambiguous_range:.3g} m; "
            "move it nearer, or measure with a smaller frequency step"
        )
    beyond = [name for name, span in zip("xyz", spans, strict=True) if span.max() > ambiguous_range]
    if beyond:
        warnings.warn(
            f"{' and '.join(beyond)} reach beyond the ambiguous range of {ambiguous_range:.3g} m: what is imaged there "
            "also stands nearer by that range",
            stacklevel=4,
        )
    needed = 3 * 8 * problem.pixels + TABLE_BYTES
    free = available_memory()
    if needed > free:
        raise InputError(
            f"an image of {problem.pixels} pixels needs about {needed / 2**30:.3g} GiB of memory and "
            f"{free / 2**30:.3g} GiB are free; ask for fewer pixels"
        )


def white_noise(problem: Problem, seed: int = 0) -> NDArray[np.complex64]:
    """Complex white noise of unit variance in the shape of the data."""
    rng = np.random.default_rng(seed)
    shape = (*problem.data_shape, 2)
    return rng.standard_normal(shape, dtype=np.float32).view(np.complex64)[..., 0]


_latest: tuple[type, bytes, float, FastPlan] | None = None


def _fast_plan(kind: type[FastPlan], problem: Problem, tolerance: float) -> FastPlan:
    """A fast plan; the latest one is kept, for whoever focuses many sweeps of one geometry."""
    global _latest
    key, latest = problem.key, _latest
    if latest is None or latest[:3] != (kind, key, tolerance):
        _latest = None
        latest = (kind, key, tolerance, kind(problem, tolerance))
        _latest = latest
    return latest[3]


def prepare(
    geometry: xr.Dataset,
    x: ArrayLike | None = None,
    y: ArrayLike | None = None,
    z: ArrayLike | None = None,
    tolerance: float = 1e-4,
    taper: str | ArrayLike = "hann",
) -> None:
    """Make the plan that `focus` will try first, from a sweep's geometry alone: while its samples are still being read.

    Raises
    ------
    InputError
        As `focus`, which also gives the warnings.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        problem = make_problem(check_measurement(geometry), x, y, z, tolerance, taper, None, None)
    if problem.pairs * problem.pixels < FEWEST_PAIR_PIXELS:
        return
    for kind in (PolarPlan, FactorizedPlan):
        with suppress(UnsuitedError):
            _fast_plan(kind, problem, tolerance)
            break


def prove(
    problem: Problem, tolerance: float, s: NDArray[np.complex64], progress: Progress | None = None
) -> tuple[FastPlan | None, NDArray[np.complex64] | None, float]:
    """The coarsest fast plan that images `s` within the tolerance, its image, and its measured error.

    None for the plan and image where no fast plan is suited or holds the tolerance.
    """
    if problem.pairs * problem.pixels < FEWEST_PAIR_PIXELS:
        return None, None, tolerance
    for kind in (PolarPlan, FactorizedPlan):
        target = tolerance
        for _ in range(REFINEMENTS):
            try:
                fast = _fast_plan(kind, problem, target)
            except UnsuitedError:
                break
            image = fast(s, progress)
            error = measured_error(problem, image, s)
            if error <= SAMPLING_MARGIN * tolerance:
                return fast, image, error
            target *= min(0.5, 0.5 * tolerance / error)
    return None, None, tolerance


class FocusPlan:
    """Everything about an imaging task that does not depend on the data, ready to run frame by frame.

    Parameters
    ----------
    sweep : xarray.Dataset
        A sweep, or only its geometry: ``frequency`` [Hz] and ``tx_position``, ``rx_position`` [m] (or
        ``antenna_position`` for one moving antenna).
    x, y, z, tolerance, taper, apodization, wave_speed
        As in `focus`.

    Attributes
    ----------
    x, y, z : 1D arrays [m]
        The pixels.
    algorithm : str
        ``"polar"`` for the structured path of line arrays, ``"factorized"`` for that of any array, ``"exact"`` for
        the sum over all pairs.
    error : float
        Relative L2 error on white noise, measured on random pixels when the plan was made.
    build_time : float [s]
    nbytes : int
        Memory of the plan's tables [bytes].

    Raises
    ------
    InputError
        As `focus`.

    Notes
    -----
    A plan may be used from several threads at once.
    """

    def __init__(
        self,
        sweep: xr.Dataset,
        *,
        x: ArrayLike | None = None,
        y: ArrayLike | None = None,
        z: ArrayLike | None = None,
        tolerance: float = 1e-4,
        taper: str | ArrayLike = "hann",
        apodization: Apodization = None,
        wave_speed: float | None = None,
    ) -> None:
        start = time.perf_counter()
        self._problem = make_problem(check_measurement(sweep), x, y, z, tolerance, taper, apodization, wave_speed)
        self.tolerance = float(tolerance)
        self._fast, _, self.error = prove(self._problem, self.tolerance, white_noise(self._problem))
        self.x, self.y, self.z = self._problem.x, self._problem.y, self._problem.z
        self.build_time = time.perf_counter() - start

    @property
    def algorithm(self) -> str:
        """``"polar"``, ``"factorized"`` or ``"exact"``."""
        return "exact" if self._fast is None else self._fast.algorithm

    @property
    def nbytes(self) -> int:
        """Memory of the plan's tables [bytes]."""
        return 0 if self._fast is None else self._fast.nbytes

    def __repr__(self) -> str:
        shape = " x ".join(str(n) for n in self._problem.shape)
        return (
            f"FocusPlan({self._problem.pairs} pairs, {self._problem.k.size} frequencies -> {shape} pixels "
            f"(z, y, x), {self.algorithm}, error {self.error:.1e}, {self.nbytes / 2**20:.0f} MiB, "
            f"built in {self.build_time:.2f} s)"
        )

    def __call__(self, s: ArrayLike | xr.DataArray, progress: Progress | None = None) -> NDArray[np.complex64]:
        """Image (z, y, x), or (y, x) where there is one z, of one frame s(frequency, tx, rx)."""
        data = np.ascontiguousarray(s, dtype=np.complex64)
        if data.shape != self._problem.data_shape:
            raise InputError(
                f"the frame has shape {data.shape}, expected {self._problem.data_shape} as in the plan's geometry; "
                "transpose it to (frequency, tx, rx) or make a plan of its own"
            )
        if self._fast is None:
            image = focus_exact(self._problem, data, self.tolerance, progress)
        else:
            image = self._fast(data, progress)
        return image[0] if self._problem.z.size == 1 else image
