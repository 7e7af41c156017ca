"""The speed of this machine: the loops in which focusing spends its time, timed at first use, in a quarter of a second.

Processor time is measured, so that other programs disturb it little. The times are kept in the user's cache folder, or
in the process where that folder cannot be written.
"""

from __future__ import annotations

import itertools
import json
import platform
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, astuple, dataclass, fields
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numba
import numpy as np
import scipy.fft

from mirrorfold.common import phasor
from mirrorfold.common.cache import cache_folder
from mirrorfold.common.leftovers import remove_leftovers, temporary_name
from mirrorfold.common.noise import complex_noise
from mirrorfold.common.threads import cpu_count
from mirrorfold.focusing.exact import kernels as exact_kernels
from mirrorfold.focusing.exact import range_tables
from mirrorfold.focusing.exact.range_tables import TERMS, spectral_weights
from mirrorfold.focusing.lines import kernels as line_kernels
from mirrorfold.focusing.lines.interpolation import triangular_kernel

tile_tables: Any = exact_kernels.tile_tables
sum_transmitters: Any = exact_kernels.sum_transmitters
turn: Any = phasor.turn
unfold_spectrum: Any = range_tables.unfold_spectrum
interleave_coefficients: Any = range_tables.interleave_coefficients

REPEATS = 3
"""Number of times that each loop is timed. The fastest counts: other programs can only slow a loop down."""

VERSION = 4
"""Version of the cached file, to be raised whenever other loops are measured."""


@dataclass(frozen=True)
class Machine:
    """Processor time [s] of one unit of each loop.

    Attributes
    ----------
    pair_pixel : float
        For a pair and a pixel of the exact kernel's sum.
    compress : float
        For a coefficient in the exact kernel's range tables.
    table : float
        For path and phase factor of an antenna and a pixel.
    fourier : float
        For a point of a Fourier transform of length N, divided by log2(N).
    gather : float
        For a sample that is sorted by lattice point.
    collapse : float
        For a real multiplication in the small matrix products, one for each lattice point.
    multiply : float
        For a real multiplication in a matrix product of a few dozen rows and columns.
    stretch : float
        For a tap of the interpolation of the lattice's spectrum, from lattice points to directions.
    combine : float
        For a node and a point of the polar grid, where the nodes are summed.
    pixel, tap : float
        For a pixel of the interpolation from the polar grid, and for each of its taps.
    turn : float
        For a pixel whose phase is turned by the paths over centres.
    number : float
        For a complex exponential by NumPy, the unit in which the building of plans is counted.
    """

    pair_pixel: float
    compress: float
    table: float
    fourier: float
    gather: float
    collapse: float
    multiply: float
    stretch: float
    combine: float
    pixel: float
    tap: float
    turn: float
    number: float


@lru_cache(maxsize=1)
def machine() -> Machine:
    """Speed of the machine: read from the cache folder, or measured and kept there."""
    path = cache_folder() / "machine.json"
    with suppress(OSError, ValueError, TypeError):
        kept = json.loads(path.read_text())
        if kept.pop("of") == _identity():
            return Machine(**{field.name: float(kept[field.name]) for field in fields(Machine)})
    found = measure()
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        remove_leftovers(path.parent)
        partial = path.with_name(temporary_name())
        partial.write_text(json.dumps({"of": _identity(), **asdict(found)}))
        partial.replace(path)
    return found


def _identity() -> list[str]:
    """Machine, number of its cores that this process may use, and versions, for which a measurement holds."""
    model = ""
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    of_machine = platform.machine(), platform.processor(), model, str(cpu_count())
    return [str(VERSION), *of_machine, np.__version__, numba.__version__]


def measure() -> Machine:
    """Time every loop, on all cores at once: cores that share caches and memory are slower together than alone."""
    with ThreadPoolExecutor(cpu_count()) as pool:
        found = list(pool.map(lambda _: _measure(), range(cpu_count())))
    return Machine(*np.mean([astuple(one) for one in found], axis=0).tolist())


def _measure() -> Machine:
    """Time every loop on this thread."""
    rng = np.random.default_rng(0)
    noise = partial(complex_noise, rng)
    taps = triangular_kernel(4, 2.0, False).coefficients
    more = triangular_kernel(8, 2.0, False).coefficients
    few, many = _pixels(taps), _pixels(more)
    slope = (many - few) / (more.shape[0] ** 2 - taps.shape[0] ** 2)
    left, right = rng.standard_normal((24, 60, 40)).astype(np.float32), np.ones((24, 40, 40), np.float32)
    spectrum, beams = noise(8, 324, 12), noise(8, 200, 12)
    cell = rng.integers(0, 324, (8, 200)).astype(np.int32)
    weight = rng.random((8, 200, 4)).astype(np.float32)
    stretch = line_kernels.stretcher(4)
    profile, value, polar = noise(600, 16, 12), noise(16, 500, 12), np.zeros((16, 500), np.complex64)
    x, centres, turns = rng.random(20_000), rng.random((4, 3)), np.ones(4)
    planar = np.zeros((4, x.size), np.float32)
    angle = 1j * rng.random(50_000)
    return Machine(
        pair_pixel=_pairs(),
        compress=_profiles(),
        table=_tables(),
        fourier=_seconds(lambda: scipy.fft.fft(spectrum, axis=1), spectrum.size * np.log2(324)),
        **_lattice(noise),
        multiply=_seconds(lambda: left @ right, 24 * 60 * 40 * 40),
        stretch=_seconds(
            lambda: stretch(spectrum.view(np.float32), cell, weight, beams.view(np.float32)), 4 * beams.size
        ),
        combine=_seconds(lambda: line_kernels.combine(profile, value, 50, polar), value.size),
        pixel=max(few - slope * taps.shape[0] ** 2, 0.1 * few),
        tap=max(slope, 1e-12),
        turn=_seconds(lambda: turn(*planar[:2], x, x, 0.1, centres, turns, *planar[2:]), x.size),
        number=_seconds(lambda: np.exp(angle), angle.size),
    )


def _seconds(work: Callable[[], object], units: float) -> float:
    """Processor time [s] of this thread per unit of some work; the first call, which may compile, is not counted."""
    work()
    best = np.inf
    for _ in range(REPEATS):
        start, calls = time.thread_time(), 0
        while (spent := time.thread_time() - start) < 0.004 or not calls:
            work()
            calls += 1
        best = min(best, spent / calls)
    return float(best / units)


def _lattice(noise: Callable[..., np.ndarray]) -> dict[str, float]:
    """Seconds of `gather` and `collapse`: samples of 60 antennas, sorted by the midpoints of pairs, times ten nodes."""
    i, k = np.triu_indices(60)
    order = np.argsort(i + k, kind="stable")
    i, k = i[order], k[order]
    first = np.searchsorted(i + k, np.arange(120))
    # More frequencies than one call works on: the samples of the next call come from memory, not from the cache.
    data, gathered = noise(8, 16, 3600), np.empty(16 * i.size, np.complex64)
    factor, summed = noise(2 * i.size, 10).view(np.float32), np.empty((119, 16, 20), np.float32)
    part = itertools.cycle(data)
    return {
        "gather": _seconds(
            lambda: line_kernels.gather(next(part), 60 * i + k, 60 * k + i, True, first, gathered), 2 * gathered.size
        ),
        "collapse": _seconds(
            lambda: line_kernels.collapse(gathered.view(np.float32), factor, first, 16, summed), 40 * gathered.size
        ),
    }


def _places(count: int, pixels: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) [m] of `count` elements on a line, and of pixels of a tile in front of it."""
    element = np.zeros((count, 3))
    element[:, 0] = 5e-4 * np.arange(count)
    y, x = np.divmod(np.arange(pixels), 32)
    return element, np.stack([0.01 * x, 1.0 + 0.02 * y, 0.0 * x], axis=1)


def _tables() -> float:
    """Seconds of `table`: path and phase factor of an antenna and a pixel."""
    element, pixel = _places(32, 512)
    delay, re, im = (np.empty((32, 512), np.float32) for _ in range(3))
    reference = np.zeros(32)
    return _seconds(lambda: tile_tables(*pixel.T.copy(), element, 70.0, 6e3, reference, delay, re, im), delay.size)


def _profiles() -> float:
    """Seconds of `compress`: a coefficient of the range tables of one transmitter's pairs."""
    data, cells = np.ones((201, 40), np.complex64), 432
    weight = spectral_weights(np.ones(201, np.complex128), cells)
    spectrum = np.empty((40, TERMS, cells), np.complex64)
    table = np.empty((40, cells, TERMS), np.complex64)

    def compress() -> None:
        unfold_spectrum(data, weight, spectrum)
        interleave_coefficients(scipy.fft.ifft(spectrum, axis=-1, norm="forward"), table)

    return _seconds(compress, table.size)


def _pairs() -> float:
    """Seconds of `pair_pixel`: the exact sum on one tile, without the tables of path and phase."""
    element, pixel = _places(32, 512)
    delay, re, im = (np.empty((32, 512), np.float32) for _ in range(3))
    reference = np.linalg.norm(element - pixel.mean(axis=0), axis=1) * 70.0
    tile_tables(*pixel.T.copy(), element, 70.0, 6e3, reference, delay, re, im)
    table = np.ones((32 * 4, (1024 + 128) * 8), np.float32)
    start, index, out = 32 * np.arange(5), np.arange(4), np.zeros(512, np.complex64)
    one = (reference, delay, re, im)
    return _seconds(lambda: sum_transmitters(table, start, index, False, 1024, 64, *one, *one, out), 4 * delay.size)


def _pixels(coefficients: np.ndarray) -> float:
    """Seconds per pixel of the interpolation from the polar grid to pixels, with these kernels both ways."""
    x, y = np.linspace(-0.5, 0.5, 400), np.linspace(0.6, 1.4, 24)
    runs = np.stack([np.arange(24), np.zeros(24, int), np.full(24, 400)], axis=1).astype(np.int64)
    polar, image = np.ones((200, 900), np.complex64), np.zeros((24, 400), np.complex64)
    grid = np.zeros(3), np.eye(3), np.zeros((2, 3)), False, 500.0, 10, 80.0, -100, 1e3, 1e-4
    pixels, taps = (x, y, np.zeros(1), *grid), (coefficients, coefficients)
    interpolate = line_kernels.interpolator(len(coefficients))
    return _seconds(lambda: interpolate(runs, pixels, polar, taps, image), image.size)
