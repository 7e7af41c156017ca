"""From a scene to the sweep that a radar in it would measure."""

from __future__ import annotations

import inspect
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.arguments import boolean, number, one_of, path_of, whole_number
from mirrorfold.common.noise import complex_noise
from mirrorfold.common.slabs import POLARIZATIONS, Polarization
from mirrorfold.common.threads import part_of
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene, as_scene
from mirrorfold.scenes.visibility import MOST_BOUNCES
from mirrorfold.simulation.horns import point_sources
from mirrorfold.simulation.limits import angle_doubts, check_clearance, check_extent
from mirrorfold.sweep import add_noise, make_sweep

if TYPE_CHECKING:
    from mirrorfold.common.types import Progress
    from mirrorfold.scenes.solids import Scene3D
    from mirrorfold.simulation.fullwave.estimate import FullWaveEstimate
    from mirrorfold.simulation.raster.estimate import ScanEstimate
    from mirrorfold.simulation.rays.tiles import RayEstimate

SOLVERS = ("rays", "fullwave")
"""The solvers that `simulate` knows."""


def simulate(
    scene: Scene | Scene3D | str | Path,
    *,
    solver: str = "rays",
    bounces: int = 3,
    seed: int = 0,
    snr_db: float | None = None,
    force: bool = False,
    tolerance: float = 1e-3,
    direct: bool = False,
    check_residual: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    checkpoint: str | Path | None = None,
    resume: bool = False,
    memory_limit: float | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Simulate the sweep of a scene.

    In a three-dimensional scene the radar is a raster scanner, and the sweep holds S11 of every beam. In a
    two-dimensional scene every transmitter radiates the field ``exp(-j k d) / sqrt(d)`` at the distance d, the far
    field of a line source without its constant factor. A sample of the sweep is the scattered field at the receiver;
    the direct wave from transmitter to receiver is left out. The full-wave solver uses the exact field of a line
    source, ``sqrt(pi k / 2) exp(-j pi / 4) H0^(2)(k d)``, which has the same far field, so that the sweeps of both
    solvers have the same scale. For example, an infinitely long smooth mirror returns ``R exp(-j k d) / sqrt(d)``, with
    d the length of the path by way of the mirror and R its reflection coefficient.

    Parameters
    ----------
    scene : Scene, Scene3D, path or dict
        A scene, the path of a scene file, or the content of one; see `parse_scene`.
    solver : {"rays", "fullwave"}, default "rays"
        "rays": geometrical optics, with specular paths by way of mirrors and diffuse scatterers at fixed random places.
        "fullwave": integral equations of perfect conductors and dielectric walls, which include all multiple
        scattering, diffraction and shadowing.
    bounces : int, default 3, at most 1000
        Rays only. Largest number of mirrors between an antenna and a scatterer, on the way out and again on the way
        back. In two dimensions, purely specular returns, which need no scatterer, are followed over twice as many.
    seed : int, default 0
        Seed of the diffuse scatterers (rays) or of the random profiles of rough surfaces (full-wave), and of the noise.
    snr_db : float [dB], optional
        Mean power of the samples over the power of the added noise, per sample; no noise by default. Where the
        scene returns nothing, the noise has the mean power one.
    force : bool, default False
        Rays in three dimensions only. Continue even if returns wrap around or the scan is too coarse for the beam.
    tolerance : float, default 1e-3
        Full-wave only. Relative root-mean-square error of the samples.
    direct : bool, default False
        Full-wave only. Add the direct wave from transmitter to receiver, except for pairs at the same place, where it
        is infinite.
    check_residual : bool, default False
        Full-wave only. Measure how well the solution fulfils the full system of equations at mid-band, for random
        strengths of the transmitters; stored in the attribute `residual`.
    workers : int, default 1
        Full-wave only. Number of processes that share the frequencies. With more than one, a script needs
        ``if __name__ == "__main__":``.
    scheduler : str, optional
        Full-wave only. Address of a Dask scheduler, whose workers share the frequencies instead.
    checkpoint : path, optional
        Full-wave only. Folder that keeps the result of each frequency, to resume from; remove it when the sweep is
        saved.
    resume : bool, default False
        Full-wave only. Continue from the results in that folder; the sweep is the same, byte for byte, as without the
        interruption.
    memory_limit : float [B], optional
        Rays only. Total memory that the process may hold; by default what is free. In two dimensions the scatterers are
        processed in tiles if necessary, which changes the sweep by rounding only. A simulation that does not fit in
        tiles either is refused before it starts.
    progress : callable, optional
        Called as ``progress(done, total)`` as frequencies, or beams of a raster scan, are finished.

    Returns
    -------
    xarray.Dataset
        The sweep, variable ``s(frequency, tx, rx)`` or ``s(frequency, azimuth, elevation)``; of a scene with both
        polarizations ``s(polarization, frequency, tx, rx)``.

    Raises
    ------
    InputError
        If an argument or the scene is wrong, or if nothing in the scene returns anything and no noise is asked for.

    Examples
    --------
    >>> from mirrorfold.scenes.floor_plan import parse_scene
    >>> scene = parse_scene({
    ...     "name": "mirror at one metre",
    ...     "array": {"elements": 1, "pitch": 0.5e-3},
    ...     "band": {"start": 290e9, "stop": 300e9, "points": 2},
    ...     "surface": [{"name": "mirror", "kind": "segment", "start": [-1, 1], "end": [1, 1]}],
    ... })
    >>> round(float(abs(simulate(scene)["s"][0, 0, 0])), 2)
    0.71
    """
    scene = as_scene(scene)
    one_of("solver", solver, SOLVERS)
    bounces, seed = whole_number("bounces", bounces, highest=MOST_BOUNCES), whole_number("seed", seed)
    tolerance = number("tolerance", tolerance)
    workers = whole_number("workers", workers, lowest=1)
    force, direct, resume = boolean("force", force), boolean("direct", direct), boolean("resume", resume)
    check_residual = boolean("check_residual", check_residual)
    snr_db = None if snr_db is None else number("snr_db", snr_db, "dB")
    memory_limit = None if memory_limit is None else number("memory_limit", memory_limit, "B", above=0.0)
    checkpoint = None if checkpoint is None else path_of("checkpoint", checkpoint, "the path of a folder")
    of_rays = {"bounces": bounces, "force": force, "memory_limit": memory_limit}
    of_fullwave: dict[str, Any] = {
        "tolerance": tolerance, "direct": direct, "check_residual": check_residual, "workers": workers,
        "scheduler": scheduler, "checkpoint": checkpoint, "resume": resume,
    }  # fmt: skip
    _check_solver_options(solver, of_fullwave if solver == "rays" else of_rays)
    _check_scene(scene, solver)
    if not isinstance(scene, Scene):
        from mirrorfold.simulation.raster.sweep import simulate_raster

        return simulate_raster(
            scene,
            bounces=bounces,
            seed=seed,
            snr_db=snr_db,
            force=force,
            memory_limit=memory_limit,
            progress=progress,
        )

    sources, gather = point_sources(scene)
    if solver == "rays":
        s, settings = _by_rays(sources, bounces=bounces, seed=seed, memory_limit=memory_limit, progress=progress)
    else:
        s, settings = _by_fullwave(sources, seed=seed, progress=progress, **of_fullwave)
    s = gather(s)
    returns_something = bool(s.any())
    if not returns_something:
        if snr_db is None:
            lacking = "no surface in it returns anything to the array" if scene.surface else "it has no surfaces"
            raise InputError(
                f"scene {scene.name!r}: there is nothing to simulate, {lacking}; "
                "add a surface that the array sees, or give snr_db for a sweep of noise alone"
            )
        s = complex_noise(np.random.default_rng(seed), *s.shape) * np.float32(np.sqrt(0.5))
    waves = _polarizations(scene)
    chosen = ", ".join(f"{name}={settings[name]:g}" for name in ("bounces", "tolerance", "seed") if name in settings)
    sweep = make_sweep(
        s,
        frequency=scene.band.frequency,
        tx_position=scene.array.tx_position,
        rx_position=scene.array.rx_position,
        polarization=None if waves == ("TE",) else waves if len(waves) > 1 else waves[0],
        title=scene.name,
        processing=[f"simulated by {solver}, {chosen}"],
        solver=solver,
        **settings,
    )
    del s  # of which the sweep has a copy
    if snr_db is None:
        return sweep
    if not returns_something:
        return sweep.assign_attrs(processing=[*sweep.attrs["processing"], "nothing returned: noise of mean power 1"])
    return add_noise(sweep, snr_db=snr_db, seed=seed)


def _by_rays(
    scene: Scene, *, bounces: int, seed: int, memory_limit: float | None, progress: Progress | None
) -> tuple[NDArray[np.complex64], dict[str, Any]]:
    """The samples of a scene of point sources by geometrical optics, and the attributes that say how they were made."""
    from mirrorfold.simulation.rays.sweep import scattered_field

    check_clearance(scene)
    waves = _polarizations(scene)
    fields = [
        scattered_field(
            replace(scene, polarization=one),
            bounces=bounces,
            seed=seed,
            memory_limit=memory_limit,
            progress=part_of(progress, part, len(waves)),
        )
        for part, one in enumerate(waves)
    ]
    return _stacked(fields), {"bounces": bounces, "seed": seed, "source_field": "exp(-jkd)/sqrt(d)"}


def _by_fullwave(
    scene: Scene, *, seed: int, checkpoint: Path | None, resume: bool, progress: Progress | None, **given: Any
) -> tuple[NDArray[np.complex64], dict[str, Any]]:
    """As `_by_rays`, by integral equations; `given` holds the other options of the full-wave solver."""
    from mirrorfold.simulation.fullwave.sweep import fullwave_field

    if resume and checkpoint is None:
        raise InputError("resume needs the folder of the unfinished sweep; give it as checkpoint")
    waves, fields, facts = _polarizations(scene), list[NDArray[np.complex64]](), dict[str, float]()
    for part, one in enumerate(waves):
        field, found = fullwave_field(
            replace(scene, polarization=one),
            seed=seed,
            checkpoint=_folder(checkpoint, one, waves),
            resume=resume,
            progress=part_of(progress, part, len(waves)),
            **given,
        )
        fields.append(field)
        facts = {name: max(value, facts.get(name, value)) for name, value in found.items()}
    return _stacked(fields), {
        "tolerance": given["tolerance"],
        "seed": seed,
        "direct": given["direct"],
        **facts,
        "source_field": "sqrt(pi k/2) exp(-j pi/4) H0(2)(kd), far away exp(-jkd)/sqrt(d)",
    }


def _stacked(fields: list[NDArray[np.complex64]]) -> NDArray[np.complex64]:
    """The fields of all polarizations; that of one alone is not copied."""
    return fields[0] if len(fields) == 1 else np.stack(fields)


def _polarizations(scene: Scene) -> tuple[Polarization, ...]:
    """The polarizations to simulate, one after the other: two for a scene with polarization "both"."""
    return POLARIZATIONS if scene.polarization == "both" else (scene.polarization,)


def _folder(checkpoint: Path | None, one: Polarization, of: tuple[Polarization, ...]) -> Path | None:
    """Folder for the results of one polarization: the checkpoint itself, or a folder in it if there are two."""
    if checkpoint is None:
        return None
    return checkpoint if len(of) == 1 else checkpoint / one


def _check_scene(scene: Scene | Scene3D, solver: str) -> None:
    """Refuse a scene that is too large, or in space if the solver has two dimensions; warn of angles in radians."""
    check_extent(scene)
    for doubt in angle_doubts(scene):
        warnings.warn(doubt, stacklevel=3)
    if solver == "fullwave" and not isinstance(scene, Scene):
        raise InputError(f"scene {scene.name!r}: the solver 'fullwave' has two dimensions; use 'rays'")


def _check_solver_options(solver: str, of_other: dict[str, Any]) -> None:
    """Refuse options of the other solver that the user has changed from their defaults."""
    usual = inspect.signature(simulate).parameters
    for name, value in of_other.items():
        if value != usual[name].default:
            other = "fullwave" if solver == "rays" else "rays"
            raise InputError(f"{name} is an option of the solver {other!r}, not of {solver!r}; leave it out")


def estimate(
    scene: Scene | Scene3D | str | Path,
    *,
    solver: str = "rays",
    bounces: int = 3,
    seed: int = 0,
    tolerance: float = 1e-3,
    workers: int = 1,
    memory_limit: float | None = None,
) -> FullWaveEstimate | ScanEstimate | RayEstimate:
    """Time, memory and size of a simulation, estimated without running it.

    Returns
    -------
    FullWaveEstimate, ScanEstimate or RayEstimate
        Facts to read as attributes or as items. All have `frequencies` and `memory_gb`. A raster scan also has `beams`,
        `echoes`, `longest_return_m`, `needed_frequencies` and `seconds`; the full-wave solver `unknowns`, `minutes` and
        `disk_gb`; rays in two dimensions `scatterers`, `paths`, `tiles` and `parts_gb`.

    Raises
    ------
    InputError
        If the scene cannot be simulated, or does not fit into the memory limit.
    """
    scene, bounces = as_scene(scene), whole_number("bounces", bounces, highest=MOST_BOUNCES)
    one_of("solver", solver, SOLVERS)
    seed, workers = whole_number("seed", seed), whole_number("workers", workers, lowest=1)
    tolerance = number("tolerance", tolerance)
    memory_limit = None if memory_limit is None else number("memory_limit", memory_limit, "B", above=0.0)
    _check_scene(scene, solver)
    if not isinstance(scene, Scene):
        from mirrorfold.simulation.raster.estimate import estimate as estimate_scan

        return estimate_scan(scene, bounces=bounces, seed=seed)
    if solver != "fullwave":
        from mirrorfold.simulation.rays.tiles import estimate_rays

        check_clearance(scene)
        return estimate_rays(point_sources(scene)[0], bounces=bounces, seed=seed, memory_limit=memory_limit)
    from mirrorfold.simulation.fullwave.estimate import FullWaveEstimate
    from mirrorfold.simulation.fullwave.sweep import estimate_sweep

    costs = []  # no comprehension: in Python 3.11 it is a function more, which the place of a warning would count
    for one in _polarizations(scene):
        costs.append(estimate_sweep(replace(scene, polarization=one), tolerance=tolerance, seed=seed))
    seconds, memory = sum(cost.seconds_per_frequency for cost in costs), max(cost.memory for cost in costs)
    return FullWaveEstimate(
        kind="estimate",
        unknowns=max(cost.unknowns for cost in costs),
        skeletons=max(cost.skeletons for cost in costs),
        frequencies=scene.band.points,
        workers=workers,
        cpu_seconds_per_frequency=seconds,
        minutes=seconds * scene.band.points / workers / 60.0,
        memory_per_worker_gb=memory / 1e9,
        memory_gb=workers * memory / 1e9,
        disk_gb=sum(cost.disk for cost in costs) / 1e9,
        remarks=[],
    )
