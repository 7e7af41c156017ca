"""The total field of one transmitter on a grid of pixels: a picture of the waves in a scene."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.constants import speed_of_light

from mirrorfold.common.arguments import in_message, number, whole_number, wrong_kind
from mirrorfold.common.plausible import HIGHEST_OF_ALL
from mirrorfold.common.threads import one_thread
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes.arrays import Band
from mirrorfold.scenes.floor_plan import Scene, as_scene
from mirrorfold.simulation.fullwave.boundaries import Boundaries
from mirrorfold.simulation.fullwave.kernel import hankel
from mirrorfold.simulation.fullwave.preparation import prepare
from mirrorfold.simulation.fullwave.solver import Complex, System, currents
from mirrorfold.simulation.fullwave.tasks import source_strength

LOWEST_FREQUENCY = 1.0
"""Lowest frequency of a field [Hz]: its wavelength reaches almost to the moon."""

BLOCK_VALUES = 2_000_000
"""Number of values of the kernel that are kept in memory at a time."""


def near_field(
    scene: Scene | str | Path,
    frequency: float,
    grid: tuple[ArrayLike, ArrayLike],
    *,
    source: int | None = None,
    tolerance: float = 1e-3,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> xr.DataArray:
    """The total field of one transmitter on a grid.

    Parameters
    ----------
    scene : Scene or path
        Scene of perfect conductors and dielectric walls; its band is not used.
    frequency : float [Hz]
    grid : pair of (n,) and (m,) arrays [m]
        Coordinates x and y of the pixels.
    source : int, optional
        Number of the transmitter, from 0; the middle one by default.
    tolerance : float, default 1e-3
        Relative root-mean-square error, as in `mirrorfold.simulate`.
    seed : int, default 0
        Seed of the random profiles of rough surfaces.
    progress : callable, optional
        Called as ``progress(done, total)`` with the number of rows of pixels that are finished.

    Returns
    -------
    xarray.DataArray
        `field`, (y, x) complex64 [m^(-1/2)], for a source whose far field is ``exp(-j k d) / sqrt(d)``. It is not
        accurate closer to a surface than the spacing of the nodes, about a twelfth of a wavelength.

    Raises
    ------
    InputError
        If an argument is wrong or the scene cannot be solved.

    Examples
    --------
    >>> from mirrorfold.scenes.floor_plan import parse_scene
    >>> scene = parse_scene({
    ...     "name": "strip",
    ...     "array": {"elements": 1, "pitch": 0.5e-3},
    ...     "band": {"start": 290e9, "stop": 300e9, "points": 2},
    ...     "surface": [{"name": "strip", "kind": "segment", "start": [-0.01, 0.02], "end": [0.01, 0.02]}],
    ... })
    >>> field = near_field(scene, 300e9, ([0.0], [0.015, 0.022]))
    >>> bool(abs(field[0, 0]) > 10 * abs(field[1, 0]))  # before the strip, and in its shadow
    True
    """
    truth = as_scene(scene)
    if not isinstance(truth, Scene):
        raise InputError(f"scene {truth.name!r}: has three dimensions; the near field is computed in two")
    frequency = number("frequency", frequency, "Hz", lowest=LOWEST_FREQUENCY, highest=HIGHEST_OF_ALL[True])
    given: Any = grid
    if not isinstance(given, list | tuple | np.ndarray) or getattr(given, "shape", (2,))[:1] != (2,) or len(given) != 2:
        raise wrong_kind("grid", grid, "the coordinates (x, y) of the pixels in metres", reader="")
    tolerance, seed = number("tolerance", tolerance), whole_number("seed", seed)
    x, y = (_coordinates(axis, name) for axis, name in zip(grid, "xy", strict=True))
    count = len(truth.array.tx_position)
    source = count // 2 if source is None else whole_number("source", source)
    if source >= count:
        raise InputError(f"source is {in_message(source)}, expected the number of a transmitter, from 0 to {count - 1}")
    # The upper end of the band determines the spacing of the nodes, and the frequency at which skeletons are chosen.
    band = Band(start=0.5 * frequency, stop=frequency, points=2)
    k = 2.0 * math.pi * frequency / speed_of_light
    field = np.empty((y.size, x.size), dtype=np.complex64)
    with one_thread():
        system = prepare(replace(truth, band=band), tolerance=tolerance, seed=seed)
        excitation = np.zeros((count, 1), dtype=np.complex64)
        excitation[source] = 1.0
        strengths = currents(system, excitation, k)[:, 0]
        unknowns = len(strengths)
        rows = max(1, BLOCK_VALUES // (x.size * unknowns))
        for first in range(0, y.size, rows):
            pixels = np.stack(np.meshgrid(x, y[first : first + rows]), axis=-1).reshape(-1, 2)
            for some in np.array_split(np.arange(len(pixels)), max(1, len(pixels) * unknowns // BLOCK_VALUES)):
                field[first : first + rows].reshape(-1)[some] = _total(system, pixels[some], source, strengths, k)
            if progress is not None:
                progress(min(first + rows, y.size), y.size)
    return xr.DataArray(
        np.complex64(source_strength(k)) * field,
        dims=("y", "x"),
        coords={"y": ("y", y, {"units": "m"}), "x": ("x", x, {"units": "m"})},
        name="field",
        attrs={"frequency": float(frequency), "source": int(source), "title": truth.name},
    )


def _total(system: System, pixels: Array, source: int, strengths: Complex, k: float) -> Complex:
    """The total field at pixels (p, 2) [m], without the factor of the source.

    Outside, all currents and the source contribute; inside a body, only the body's own currents.
    """
    equation = system.equation
    everything = np.arange(equation.size)
    waves = equation.at_points(pixels, everything, k)
    # The field is infinite at a pixel on a node or on the source: that term is left out.
    total = np.where(np.isfinite(waves), waves, 0.0).T @ strengths
    straight = hankel(pixels, system.tx[source : source + 1], k)[:, 0]
    total += np.where(np.isfinite(straight), straight, 0.0)
    if isinstance(equation, Boundaries):
        for body, filling in enumerate(equation.inside):
            within = np.flatnonzero(equation.encloses(body, pixels)) if filling is not None else np.empty(0, int)
            if len(within):
                own = np.flatnonzero(equation.nodes.surface[equation.node] == body)
                total[within] = equation.at_points(pixels[within], own, k, body=body).T @ strengths[own]
    return total


def _coordinates(axis: ArrayLike, name: str) -> np.ndarray:
    """The coordinates (n,) [m] of the pixels along one axis, checked."""
    try:
        values = np.asarray(axis, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise wrong_kind(f"grid: {name}", axis, "a row of finite coordinates in metres", reader="") from None
    if values.ndim != 1 or not values.size or not np.isfinite(values).all():
        raise InputError(f"grid: {name} has shape {values.shape}, expected a row of finite coordinates in metres")
    return values
