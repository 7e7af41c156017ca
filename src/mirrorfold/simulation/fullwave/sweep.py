"""The full-wave sweep of a scene: checks, the solution at all frequencies, and results on disk."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.memory import available_memory
from mirrorfold.common.threads import one_thread
from mirrorfold.common.windows import hann
from mirrorfold.errors import InputError
from mirrorfold.scenes.arrays import Band
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.simulation.fullwave.checkpoint import Checkpoint, fingerprint
from mirrorfold.simulation.fullwave.estimate import Estimate, estimate
from mirrorfold.simulation.fullwave.preparation import prepare
from mirrorfold.simulation.fullwave.solver import residual
from mirrorfold.simulation.fullwave.tasks import solve_frequencies

Complex = NDArray[np.complex64]

STRONG_DB = -40.0
"""Level relative to the strongest echo [dB], in a simulation by rays, above which an echo must not wrap around. From
-30 dB on, wrapped echoes show in an image; but rays lack multiple diffuse scattering, so that their late echoes are
10-15 dB too weak."""

LONGER = 8
"""Number of ambiguous ranges that are searched for strong echoes."""

SEARCH_STEPS = 800
"""Largest number of frequency steps of that search: its range resolution may be coarser than that of the sweep."""

LOBE = 2
"""Number of bins of a range profile, before and behind an echo, over which the Hann window spreads it."""


def fullwave_field(
    scene: Scene,
    *,
    tolerance: float,
    seed: int,
    direct: bool,
    check_residual: bool,
    workers: int,
    scheduler: str | None,
    checkpoint: Path | None,
    resume: bool,
    progress: Callable[[int, int], None] | None,
) -> tuple[Complex, dict[str, float]]:
    """The field at each receiver for each transmitter, whose own far field is ``exp(-j k d) / sqrt(d)``.

    Parameters
    ----------
    scene : Scene
    tolerance : float
        Relative root-mean-square error of the samples.
    seed : int
        Seed of the random profiles of rough surfaces.
    direct : bool
        Add the direct wave from the transmitter to the scattered field.
    check_residual : bool
        Compute the relative residual of the full system at mid-band.
    workers : int
        Number of processes.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers are used instead.
    checkpoint : path, optional
        Folder for the results of finished frequencies; it stays when the sweep is finished.
    resume : bool
        Use the results in that folder.
    progress : callable, optional
        Called as ``progress(done, total)`` after every frequency.

    Returns
    -------
    s : (frequencies, tx, rx) complex64 array
    facts : dict
        `unknowns`, `skeletons`, and `residual` where it was asked for.

    Raises
    ------
    InputError
        If the scene or an argument is wrong, or memory or disk space does not suffice.
    """
    frequency = scene.band.frequency
    with one_thread():
        system = prepare(scene, tolerance=tolerance, seed=seed)
    cost = estimate(system, frequency.size)
    check_resources(cost, workers=1 if scheduler else workers, folder=checkpoint)
    warn_of_wrapped_echoes(scene, stacklevel=5)  # the line that called `simulate`
    kept = None
    if checkpoint is not None:
        kept = Checkpoint(checkpoint, fingerprint(system, frequency, direct=direct), resume=resume)
    s = np.empty((frequency.size, len(system.tx), len(system.rx)), dtype=np.complex64)
    todo = []
    for index in range(frequency.size):
        done = kept.read(index) if kept else None
        if done is None:
            todo.append(index)
        else:
            s[index] = done
    if progress is not None:
        progress(frequency.size - len(todo), frequency.size)
    finished = frequency.size - len(todo)
    results = solve_frequencies(system, frequency, todo, direct=direct, workers=workers, scheduler=scheduler)
    for index, result in results:
        s[index] = result
        if kept:
            kept.write(index, result)
        finished += 1
        if progress is not None:
            progress(finished, frequency.size)
    facts: dict[str, float] = {"unknowns": cost.unknowns, "skeletons": cost.skeletons}
    if check_residual:
        with one_thread():
            middle = 2.0 * np.pi * frequency[frequency.size // 2] / speed_of_light
            facts["residual"] = residual(system, float(middle), seed=seed)
    return s, facts


def estimate_sweep(scene: Scene, *, tolerance: float, seed: int) -> Estimate:
    """Estimate the cost of the full-wave sweep of a scene. This takes as long as the preparation of the sweep.

    Parameters
    ----------
    scene : Scene
    tolerance : float
    seed : int

    Returns
    -------
    Estimate

    Raises
    ------
    InputError
        If the scene cannot be solved.
    """
    with one_thread():
        system = prepare(scene, tolerance=tolerance, seed=seed)
    warn_of_wrapped_echoes(scene, stacklevel=4)  # the line that called `estimate`
    return estimate(system, scene.band.points)


def check_resources(cost: Estimate, *, workers: int, folder: Path | None) -> None:
    """Refuse a sweep for which memory or disk space does not suffice.

    Raises
    ------
    InputError
        The message states what is needed, what is free, and the remedy.
    """
    free = available_memory()
    if workers * cost.memory > free:
        fewer = int(free // cost.memory)
        remedy = f"use {fewer} workers" if fewer else "simulate a smaller scene or a lower band"
        raise InputError(
            f"workers: {workers} processes need {workers * cost.memory / 1e9:.1f} GB of memory for {cost.unknowns} "
            f"unknowns, but {free / 1e9:.1f} GB are free; {remedy}"
        )
    if folder is not None:
        place = folder.absolute()
        while not place.exists():
            place = place.parent
        room = shutil.disk_usage(place).free
        if cost.disk > room:
            raise InputError(
                f"{folder}: the sweep needs {cost.disk / 1e9:.3g} GB of disk, but {room / 1e9:.3g} GB are free; "
                "make room or choose another place"
            )


def warn_of_wrapped_echoes(scene: Scene, *, stacklevel: int = 2) -> None:
    """Warn if strong echoes come from beyond the ambiguous range, and say how many frequencies are needed.

    `stacklevel` counts the functions up to the line to which the warning belongs, this one included.
    """
    ambiguous, longest = scene.band.ambiguous_range, longest_strong_echo(scene)
    if longest > ambiguous:
        needed = int(np.ceil((scene.band.stop - scene.band.start) * 2.0 * longest / speed_of_light)) + 1
        warnings.warn(
            f"scene {scene.name!r}: strong echoes come from up to {longest:.2g} m, but {scene.band.points} frequencies "
            f"are unambiguous to {ambiguous:.2g} m alone; use at least {needed} in the same band",
            stacklevel=stacklevel,
        )


def longest_strong_echo(scene: Scene) -> float:
    """Range [m] of the farthest strong echo, by a ray simulation with the two outermost antennas; 0 if there is none.

    It is the least range at which this echo can stand: with few frequencies its lobe is as long as the scene.
    Surfaces that are splines are left out, as rays cannot follow them.
    """
    from mirrorfold.simulation.rays.sweep import scattered_field

    straight = tuple(surface for surface in scene.surface if surface.kind != "curve")
    if not straight:
        return 0.0
    array = scene.array
    if array.elements > 2:
        array = replace(array, elements=2, pitch=array.pitch * (array.elements - 1), missing=())
    step = (scene.band.stop - scene.band.start) / (scene.band.points - 1) / LONGER
    steps = min(LONGER * (scene.band.points - 1), SEARCH_STEPS)
    middle = scene.band.middle
    band = Band(start=middle - 0.5 * steps * step, stop=middle + 0.5 * steps * step, points=steps + 1)
    s = scattered_field(replace(scene, surface=straight, array=array, band=band), bounces=3, seed=0)
    profile = np.abs(np.fft.ifft(s * hann(steps + 1)[:, None, None], axis=0)).max(axis=(1, 2))
    if not profile.any():
        return 0.0
    strong = np.flatnonzero(profile > ratio_of(STRONG_DB) * profile.max())
    # The last samples hold the spectral leakage of range zero, wrapped around.
    strong = strong[strong < steps - LOBE] - LOBE
    return float(strong.max(initial=0) * speed_of_light / (2.0 * (steps + 1) * step))
