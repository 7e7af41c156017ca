"""From a scene to the sweep that a radar in it would measure."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mirrorfold.errors import InputError
from mirrorfold.scene import Scene, load_scene
from mirrorfold.sweep import add_noise, make_sweep

if TYPE_CHECKING:
    from mirrorfold.solids import Scene3D

SOLVERS = ("rays",)
"""The solvers that `simulate` knows."""

Progress = Callable[[int, int], None]
"""Called with the number of frequencies done and their total."""


def simulate(
    scene: Scene | Scene3D | str | Path,
    *,
    solver: str = "rays",
    bounces: int = 3,
    seed: int = 0,
    snr_db: float | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Simulate the sweep of a scene.

    A three-dimensional scene is seen by a raster scanner; its sweep is S11 of every beam. In a two-dimensional one
    every source radiates the field ``exp(-j k d) / sqrt(d)``, the far field of a line source without its constant
    factor, and a sample of the sweep is the field scattered to the receiver; the direct wave from transmitter to
    receiver is left out. An endless smooth mirror thus returns ``R exp(-j k d) / sqrt(d)``, with d the length of
    the path over the mirror and R its reflection coefficient.

    Parameters
    ----------
    scene : Scene, Scene3D or path
        A scene, or the path of a scene file.
    solver : {"rays"}, default "rays"
        Hybrid of frozen diffuse scatterers and specular image paths.
    bounces : int, default 3
        Largest number of mirrors between an antenna and what scatters, on each way. Purely specular returns, which
        go there and come back, are followed over twice as many.
    seed : int, default 0
        Of the diffuse scatterers and of the noise.
    snr_db : float [dB], optional
        Mean power of the samples over the power of the added noise, per sample; no noise by default. Where the
        scene returns nothing, the noise has the mean power one.
    force : bool, default False
        In three dimensions, go on where returns wrap around or the scan is too coarse for the beam.
    progress : callable, optional
        Called as ``progress(done, total)`` while frequencies or beams are done.

    Returns
    -------
    xarray.Dataset
        The sweep, variable ``s(frequency, tx, rx)`` or ``s(frequency, azimuth, elevation)``.

    Raises
    ------
    InputError
        If an argument or the scene is wrong, or if nothing in the scene returns anything and no noise is asked for.

    Examples
    --------
    >>> from mirrorfold.scene import parse_scene
    >>> scene = parse_scene({
    ...     "name": "mirror at one metre",
    ...     "array": {"elements": 1, "pitch": 0.5e-3},
    ...     "band": {"start": 290e9, "stop": 300e9, "points": 2},
    ...     "surface": [{"name": "mirror", "kind": "segment", "start": [-1, 1], "end": [1, 1]}],
    ... })
    >>> round(float(abs(simulate(scene)["s"][0, 0, 0])), 6)
    0.707107
    """
    scene = load_scene(scene) if isinstance(scene, str | Path) else scene
    if solver not in SOLVERS:
        raise InputError(f"solver is {solver!r}, expected one of: {', '.join(SOLVERS)}")
    for name, value in (("bounces", bounces), ("seed", seed)):
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 0:
            raise InputError(f"{name} is {value!r}, expected a whole number of at least 0")
    if snr_db is not None and not np.isfinite(snr_db):
        raise InputError(f"snr_db is {snr_db!r}, expected a finite number of decibels, or None for no noise")
    if not isinstance(scene, Scene):
        from mirrorfold.simulation.raster import simulate_raster

        return simulate_raster(
            scene, bounces=int(bounces), seed=int(seed), snr_db=snr_db, force=force, progress=progress
        )

    from mirrorfold.simulation.rays import scattered_field

    s = scattered_field(scene, bounces=int(bounces), seed=int(seed), progress=progress)
    returns_something = bool(s.any())
    if not returns_something:
        if snr_db is None:
            found = "no surface in it returns anything to the array" if scene.surface else "it has no surfaces"
            raise InputError(
                f"scene {scene.name!r}: there is nothing to simulate, {found}; "
                "add a surface that the array sees, or give snr_db for a sweep of noise alone"
            )
        s = _unit_noise(s.shape, int(seed))
    sweep = make_sweep(
        s,
        frequency=scene.band.frequency,
        tx_position=scene.array.tx_position,
        rx_position=scene.array.rx_position,
        title=scene.name,
        processing=[f"simulated by {solver}, bounces={bounces}, seed={seed}"],
        solver=solver,
        bounces=int(bounces),
        seed=int(seed),
        source_field="exp(-jkd)/sqrt(d)",
    )
    if snr_db is None:
        return sweep
    if not returns_something:
        return sweep.assign_attrs(processing=[*sweep.attrs["processing"], "nothing returned: noise of mean power 1"])
    return add_noise(sweep, snr_db=float(snr_db), seed=int(seed))


def estimate(scene: Scene | Scene3D | str | Path, *, bounces: int = 3, seed: int = 0) -> dict[str, Any]:
    """What simulating a raster scan would take, without doing it; see `mirrorfold.simulation.raster.estimate`.

    Raises
    ------
    InputError
        If the scene has two dimensions.
    """
    scene = load_scene(scene) if isinstance(scene, str | Path) else scene
    if isinstance(scene, Scene):
        raise InputError(f"scene {scene.name!r}: has two dimensions; only a raster scan is estimated beforehand")
    from mirrorfold.simulation import raster

    return raster.estimate(scene, bounces=bounces, seed=seed)


def _unit_noise(shape: tuple[int, ...], seed: int) -> np.ndarray:
    """White complex Gaussian noise of mean power one, complex64."""
    noise = np.random.default_rng(seed).standard_normal((*shape, 2), dtype=np.float32)
    return noise.view(np.complex64)[..., 0] * np.float32(np.sqrt(0.5))
