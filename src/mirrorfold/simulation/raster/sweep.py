"""The sweep of a raster scanner: all echoes are found once, and then summed for every beam.

Each echo is a mirror image with an amplitude a and a range r (`mirrorfold.simulation.raster.echoes`). At the distance
rho from the axis of a beam of radius w it contributes ``a (2 / pi w^2) exp(-2 rho^2 / w^2) exp(-2 j k r)`` to S11: the
intensity of the Gaussian beam at the echo, and the phase of the way out and back. Beam radii and losses are those at
the middle of the band.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.beams import beam_angles, beam_direction
from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.forecasts import expect
from mirrorfold.common.noise import complex_noise
from mirrorfold.common.slabs import POLARIZATIONS
from mirrorfold.common.threads import counted, for_each, part_of
from mirrorfold.common.types import Progress
from mirrorfold.errors import InputError
from mirrorfold.scenes.solids import Scene3D
from mirrorfold.simulation.raster.echoes import Echoes3D, beam_reach, find_echoes
from mirrorfold.simulation.raster.spreading import DelayGrid, spread_echoes
from mirrorfold.sweep import add_noise, make_raster_sweep
from mirrorfold.sweep.polarization import join_polarizations

STEP_PER_BEAM = 2.0
"""Largest scan step in beam radii at the focus: with larger steps, neither of two beams sees an object between them."""


def simulate_raster(
    scene: Scene3D,
    *,
    bounces: int,
    seed: int,
    snr_db: float | None,
    force: bool,
    memory_limit: float | None,
    progress: Progress | None,
) -> xr.Dataset:
    """The sweep ``s(frequency, azimuth, elevation)`` that a raster scanner measures in a scene.

    For a scene with both polarizations it is ``s(polarization, frequency, azimuth, elevation)``, with the same
    scatterers.

    Parameters
    ----------
    scene : Scene3D
    bounces : int
        Largest number of mirrors on the way to a scatterer.
    seed : int
        Seed of the scatterers and of the noise.
    snr_db : float [dB], optional
        Mean power of the samples, without leakage, over that of the noise. Where nothing returns, the noise has the
        mean power one.
    force : bool
        Continue even if the frequencies are too few for the longest return, or the scan step is too wide for the beam.
    memory_limit : float [B], optional
        Total memory that the process may hold.
    progress : callable (done, total), optional

    Raises
    ------
    InputError
        If returns would wrap around, the scan would miss objects between its beams, or nothing returns at all.
    """
    if not force:
        check_step(scene)
    azimuth, elevation = scene.scanner.angles
    beams = f"scene {scene.name!r}: {azimuth.size} x {elevation.size} beams of {scene.band.points} frequencies"
    waves = POLARIZATIONS if scene.polarization == "both" else (scene.polarization,)
    samples = {"sweep": 8.0 * len(waves) * azimuth.size * elevation.size * scene.band.points}
    expect(samples | {"its copy": samples["sweep"]}, beams, "give fewer, or raise the limit", limit=memory_limit)
    settings: dict[str, Any] = {"bounces": bounces, "seed": seed, "force": force, "noise_alone": snr_db is not None}
    parts = {
        one: _without_noise(replace(scene, polarization=one), **settings, progress=part_of(progress, n, len(waves)))
        for n, one in enumerate(waves)
    }
    sweeps: dict[str, xr.Dataset] = {one: sweep for one, (sweep, _) in parts.items()}
    sweep = join_polarizations(sweeps) if len(waves) > 1 else parts[waves[0]][0]
    if snr_db is not None and all(returned for _, returned in parts.values()):
        sweep = add_noise(sweep, snr_db=snr_db, seed=seed)
    leakage = scene.scanner.leakage
    if leakage is not None:
        phase = -4.0j * np.pi * scene.band.frequency / speed_of_light * leakage.range
        sweep["s"].values[:] += (ratio_of(leakage.level_db) * np.exp(phase)).astype(np.complex64)[:, None, None]
    return sweep


def _without_noise(
    scene: Scene3D, *, bounces: int, seed: int, force: bool, noise_alone: bool, progress: Progress | None
) -> tuple[xr.Dataset, bool]:  # fmt: skip
    """The sweep in one polarization without noise and leakage, and whether the scene returns anything.

    If it returns nothing and `noise_alone` is set, the sweep is noise of mean power one.
    """
    azimuth, elevation = scene.scanner.angles
    echoes, counts = find_echoes(scene, bounces=bounces, seed=seed)
    if not echoes.range.size and not noise_alone:
        raise InputError(
            f"scene {scene.name!r}: there is nothing to simulate, no surface returns anything to the scanner; "
            "add one that it sees, or give surfaces a roughness, diffuse_fraction or volume_depth"
        )
    if not force:
        check_points(scene, echoes)
    if echoes.range.size:
        s = measure(scene, echoes, progress=progress)
    else:
        noise = complex_noise(np.random.default_rng(seed), azimuth.size, elevation.size, scene.band.points)
        s = np.moveaxis(noise * np.float32(np.sqrt(0.5)), -1, 0)
    sweep = make_raster_sweep(
        s,
        frequency=scene.band.frequency,
        azimuth=azimuth,
        elevation=elevation,
        origin=scene.scanner.origin,
        title=scene.name,
        processing=[f"simulated by rays, bounces={bounces}, seed={seed}"],
        solver="rays",
        bounces=bounces,
        seed=seed,
        spot_radius=scene.scanner.spot_radius,
        focus_distance=scene.scanner.focus_distance,
        **({} if scene.polarization == "TE" else {"polarization": scene.polarization}),
        **counts,
    )
    return sweep, bool(echoes.range.size)


def measure(scene: Scene3D, echoes: Echoes3D, *, progress: Progress | None = None) -> NDArray[np.complex64]:
    """Samples of all beams, (frequencies, azimuths, elevations) complex64; frequency varies fastest in memory."""
    azimuth, elevation = scene.scanner.angles
    frequency = scene.band.frequency
    grid = DelayGrid(frequency.size)
    width = echoes.width
    az, el = beam_angles(echoes.position)
    reach = beam_reach(width, echoes.range)
    # A beam of the same width covers more azimuth at higher elevation, since meridians converge.
    wider = reach / np.maximum(np.cos(np.radians(np.minimum(np.abs(el) + reach, 89.0))), 1e-2)
    columns = np.searchsorted(azimuth, [az - wider, az + wider])
    rows = np.searchsorted(elevation, [el - reach, el + reach])
    delay = 2.0 * echoes.range / speed_of_light
    turns = delay * float(frequency[1] - frequency[0])
    phase = -2.0 * np.pi * (delay * frequency[grid.center] % 1.0)
    amplitude = (echoes.amplitude * np.exp(1j * phase) * 2.0 / (np.pi * width * echoes.narrow)).astype(np.complex64)
    steps = turns % 1.0 * grid.size
    direction = echoes.position / echoes.range[:, None]
    out = np.zeros((azimuth.size, elevation.size, frequency.size), dtype=np.complex64)

    def column(i: int) -> None:
        lit = np.flatnonzero((columns[0] <= i) & (i < columns[1]) & (rows[0] < rows[1]))
        if lit.size:
            cells = np.zeros((elevation.size, grid.size), dtype=np.complex64)
            beams = beam_direction(azimuth[i], elevation)
            spread_echoes(direction[lit], echoes.range[lit], width[lit], echoes.narrow[lit], echoes.across[lit],
                   steps[lit], amplitude[lit], rows[0, lit], rows[1, lit] - 1, beams, cells)  # fmt: skip
            grid.to_band(cells, out[i])

    for_each(column, range(azimuth.size), counted(progress, azimuth.size))
    return np.moveaxis(out, -1, 0)


def needed_points(scene: Scene3D, echoes: Echoes3D) -> int:
    """Number of frequencies needed so that the longest return, at the range R, does not wrap around: ``1 + 2 B R / c``.

    The leakage of the scanner counts as a return.
    """
    farthest = float(echoes.range.max(initial=0.0))
    if scene.scanner.leakage is not None:
        farthest = max(farthest, scene.scanner.leakage.range)
    return 1 + int(np.ceil(2.0 * (scene.band.stop - scene.band.start) * farthest / speed_of_light))


def check_points(scene: Scene3D, echoes: Echoes3D) -> None:
    """Refuse a band with too few frequencies for the longest return.

    Raises
    ------
    InputError
        The message states the number that is needed.
    """
    needed = needed_points(scene, echoes)
    if scene.band.points < needed:
        raise InputError(
            f"scene {scene.name!r}: band.points is {scene.band.points}, but the longest return comes from "
            f"{echoes.range.max(initial=0.0):.2f} m and would wrap around to a wrong place; use at least {needed} "
            "frequencies, fewer bounces, or --force to go on"
        )


def check_step(scene: Scene3D) -> None:
    """Refuse a scan step so wide that neither of two neighbouring beams sees an object between them.

    Raises
    ------
    InputError
        The message states the largest step that suffices.
    """
    largest = float(np.degrees(STEP_PER_BEAM * scene.scanner.spot_radius / scene.scanner.focus_distance))
    for name, angles in zip(("azimuth", "elevation"), scene.scanner.angles, strict=True):
        step = float(np.diff(angles).max())
        if step > largest:
            raise InputError(
                f"scene {scene.name!r}: the scan step in {name} is {step:.3g} degrees, wider than the beam; use at "
                f"most {largest:.3g} degrees, {1 + int(np.ceil(np.ptp(angles) / largest))} points, or --force to go on"
            )
