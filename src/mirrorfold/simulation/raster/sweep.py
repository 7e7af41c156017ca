"""The sweep of a raster scanner: every echo once, then every beam.

By way of a chain of plane mirrors a scatterer is seen at its mirror image, straight ahead. A list of such images with
amplitude and distance, walked back through the scene once each, makes the measurement of every beam: an echo at the
distance rho from the beam's axis contributes ``a (2 / pi w^2) exp(-2 rho^2 / w^2) exp(-2 j k r)``, the Gaussian beam's
intensity there and the way to the scatterer itself and back. Faces that a beam meets at a right angle, directly or by
way of mirrors, send back a glint. Transmission and reception by two different chains is left out: a narrow beam holds
both only next to a mirror. Beam width and losses are those of the middle of the band.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.beams import beam_angles, beam_direction
from mirrorfold.common.forecasts import expect
from mirrorfold.common.types import Array, Mask, Progress
from mirrorfold.errors import InputError
from mirrorfold.scenes.solids import Scene3D
from mirrorfold.simulation.raster.chains import TracedScene, find_chains, traced_scene, walk_back
from mirrorfold.simulation.raster.meshes import solids
from mirrorfold.simulation.raster.speckle import Speckle, diffuse_share, freeze, image_frame
from mirrorfold.simulation.raster.spreading import DelayGrid, spread
from mirrorfold.sweep import add_noise, make_raster_sweep

BEAM_EDGE = 2.2
"""Echoes further from a beam's axis than this many beam radii are left out: 84 dB below its middle."""

SMALLEST_COSINE = 0.02
"""Surfaces seen more obliquely than this, 89 degrees, return nothing."""

SMALLEST_GLINT = 0.02
"""Ways shorter than this [m] lead through faces that touch the scanner."""

SAME_WAY = 1e-3
"""A way comes back by the direction that it left in to within this angle [rad], a fraction of any beam."""

PENCIL = 1e-3
"""Radius of the pencil of rays that a glint needs [m]."""

FAN = 81
"""Rays of the fan that finds the chains, along each angle: 0.4 degrees apart in a field of 30."""

STEP_PER_BEAM = 2.0
"""Largest scan step in beam radii at the focus: things between two beams are seen by neither beyond it."""


@dataclass(frozen=True, eq=False)
class Echoes3D:
    """Mirror images of scatterers.

    Attributes
    ----------
    position : (n, 3) array [m]
        From the scanner, unfolded.
    range : (n,) array [m]
    amplitude : (n,) complex array [m^2]
        Without the beam's intensity [1/m^2].
    bounces : (n,) array of int
    width : (n,) array [m]
        Radius at which a beam's response to each falls to ``exp(-2)``: the beam's own for scatterers.
    """

    position: Array
    range: Array
    amplitude: NDArray[np.complex128]
    bounces: NDArray[np.int64]
    width: Array


def find_echoes(scene: Scene3D, *, bounces: int, seed: int, density: float = 1.0) -> tuple[Echoes3D, dict[str, int]]:
    """Every scatterer by way of every chain of mirrors that shows it to the scanner.

    Parameters
    ----------
    scene : Scene3D
    bounces : int
        Largest number of mirrors on the way.
    seed : int
    density : float
        Of scatterers, relative to the default.

    Returns
    -------
    Echoes3D
    dict
        `scatterers` and `chains`: how many there are.
    """
    parts = solids(scene)
    empty = Echoes3D(np.empty((0, 3)), np.empty(0), np.empty(0, complex), np.empty(0, np.int64), np.empty(0))
    if not parts:
        return empty, {"scatterers": 0, "chains": 0}
    traced = traced_scene(parts)
    speckle = freeze(scene, parts, seed=seed, density=density)
    origin = np.array(scene.scanner.origin)
    frequency = 0.5 * (scene.band.start + scene.band.stop)
    fan = [np.linspace(a[0] - _margin(scene), a[-1] + _margin(scene), FAN) for a in scene.scanner.angles]
    directions = beam_direction(fan[0][:, None], fan[1]).reshape(-1, 3)
    chains = find_chains(scene, traced, origin, directions, bounces=bounces, frequency=frequency)
    found = [_through(scene, traced, speckle, chain, frequency) for chain in chains]
    found += [_glint(scene, traced, chain, frequency) for chain in chains if chain]
    joined = Echoes3D(*(np.concatenate(column) for column in zip(*found, strict=True)))
    return joined, {"scatterers": len(speckle.depth), "chains": len(chains)}


def _margin(scene: Scene3D) -> float:
    """How far beyond the scanned directions the beam reaches in its far field [degree]."""
    wavelength = 2.0 * speed_of_light / (scene.band.start + scene.band.stop)
    return float(np.degrees(BEAM_EDGE * wavelength / (np.pi * scene.scanner.spot_radius)))


def _through(
    scene: Scene3D, traced: TracedScene, speckle: Speckle, chain: tuple[int, ...], frequency: float
) -> tuple[Array, Array, NDArray[np.complex128], NDArray[np.int64], Array]:
    """The fields of `Echoes3D` for the scatterers seen through one chain."""
    origin = np.array(scene.scanner.origin)
    to_image = image_frame(traced.quads, chain)
    virtual = to_image.inverse(origin)
    sight = virtual - speckle.foot
    distance = np.linalg.norm(sight, axis=1)
    cosine = np.einsum("nd,nd->n", sight, speckle.normal) / distance
    facing = np.flatnonzero(cosine > SMALLEST_COSINE)
    facing = facing[_in_view(scene, to_image(speckle.foot[facing]) - origin)]
    seen, mirrors = walk_back(scene, traced, origin, chain, speckle.foot[facing], frequency=frequency)
    facing, mirrors, cosine = facing[seen], mirrors[seen], cosine[facing[seen]]
    # Waves cross the inside of a wall straight and as fast as in air: depths are those which a radar image shows.
    inward = -speckle.depth[facing] / cosine
    place = speckle.foot[facing] + inward[:, None] * sight[facing] / distance[facing, None]
    share = np.zeros(len(facing))
    owner, inside = speckle.owner[facing], speckle.depth[facing] > 0.0
    for index in np.unique(owner):
        for within in (False, True):
            here = (owner == index) & (inside == within)
            share[here] = diffuse_share(scene.surface[index], frequency, cosine[here], inside=within)
    wavelength = speed_of_light / frequency
    amplitude = wavelength * speckle.strength[facing] * cosine * np.sqrt(share / np.pi) * mirrors**2
    position = to_image(place) - origin
    range_ = np.linalg.norm(position, axis=1)
    return position, range_, amplitude, np.full(len(facing), len(chain)), scene.scanner.radius(range_, wavelength)


def _glint(
    scene: Scene3D, traced: TracedScene, chain: tuple[int, ...], frequency: float
) -> tuple[Array, Array, NDArray[np.complex128], NDArray[np.int64], Array]:
    """The fields of `Echoes3D` for the scanner's own mirror image in a chain, if the way there leads straight back.

    With D the length of the way, the beam meets its own image halfway, where both have the radius w and wavefronts of
    radius D/2. Off by a, they couple as ``2/w^2 / (alpha + beta) exp(-a^2 alpha beta / (alpha + beta))`` with ``alpha =
    2/w^2`` and ``beta = 2 j k / D``; in the limit of short waves that is ``lambda D / 4`` times the beam's intensity.
    Faces count where the whole of a small pencil of rays finds the way: edges and corners return nothing.
    """
    nothing = (np.empty((0, 3)), np.empty(0), np.empty(0, complex), np.empty(0, np.int64), np.empty(0))
    origin = np.array(scene.scanner.origin)
    to_image = image_frame(traced.quads, chain)
    way = to_image(origin) - origin
    length = float(np.linalg.norm(way))
    returns = to_image.linear.T @ way
    if length < SMALLEST_GLINT or np.linalg.norm(returns + way) > SAME_WAY * length:
        return nothing
    if not _in_view(scene, 0.5 * way[None])[0]:
        return nothing
    aside = np.linalg.svd(way[None])[2][1:]
    pencil = origin + PENCIL * np.concatenate([np.zeros((1, 3)), aside, -aside])
    seen, mirrors = walk_back(scene, traced, origin, chain, pencil, frequency=frequency)
    if not seen.all():
        return nothing
    wavelength = speed_of_light / frequency
    width = float(scene.scanner.radius(0.5 * length, wavelength))
    alpha, beta = 2.0 / width**2, 4.0j * np.pi / (wavelength * length)
    wide = float(np.sqrt(2.0 / (alpha * beta / (alpha + beta)).real))
    amplitude = mirrors[:1] * alpha / (alpha + beta) * 0.5 * np.pi * wide**2
    return 0.5 * way[None], np.array([0.5 * length]), amplitude, np.array([len(chain)]), np.array([wide])


def _in_view(scene: Scene3D, position: Array) -> Mask:
    """Whether any beam reaches points (n, 3) seen from the scanner."""
    azimuth, elevation = beam_angles(position)
    range_ = np.linalg.norm(position, axis=1)
    wavelength = 2.0 * speed_of_light / (scene.band.start + scene.band.stop)
    reach = beam_reach(scene.scanner.radius(range_, wavelength), range_)
    inside = np.ones(len(position), dtype=bool)
    for angle, axis in zip((azimuth, elevation), scene.scanner.angles, strict=True):
        inside &= (angle >= axis[0] - reach) & (angle <= axis[-1] + reach)
    return inside


def beam_reach(width: Array, range_: Array) -> Array:
    """Angle [degree] from its axis up to which a beam of that radius reaches echoes at that range, both [m]."""
    return np.degrees(np.arcsin(np.minimum(BEAM_EDGE * width / range_, 1.0)))


def simulate_raster(
    scene: Scene3D,
    *,
    bounces: int,
    seed: int,
    snr_db: float | None = None,
    force: bool = False,
    density: float = 1.0,
    memory_limit: float | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """The Sweep ``s(frequency, azimuth, elevation)`` that a raster scanner measures in a scene.

    Parameters
    ----------
    scene : Scene3D
    bounces : int
        Largest number of mirrors on the way to a scatterer.
    seed : int
        Of the scatterers and of the noise.
    snr_db : float [dB], optional
        Mean power of the samples, without leakage, over that of the noise. Where nothing returns, the noise has the
        mean power one.
    force : bool
        Go on where the frequencies are too few for the longest return, or the scan step too wide for the beam.
    density : float
        Scatterers per area, relative to the default.
    memory_limit : float [B], optional
        Of all that the process may hold.
    progress : callable (done, total), optional

    Raises
    ------
    InputError
        If returns would wrap around, the scan would miss things between its beams, or nothing returns at all.
    """
    if not force:
        check_step(scene)
    azimuth, elevation = scene.scanner.angles
    beams = f"scene {scene.name!r}: {azimuth.size} x {elevation.size} beams of {scene.band.points} frequencies"
    samples = {"sweep": 8.0 * azimuth.size * elevation.size * scene.band.points}
    expect(samples | {"its copy": samples["sweep"]}, beams, "give fewer, or raise the limit", limit=memory_limit)
    echoes, counts = find_echoes(scene, bounces=bounces, seed=seed, density=density)
    if not echoes.range.size and snr_db is None:
        raise InputError(
            f"scene {scene.name!r}: there is nothing to simulate, no surface returns anything to the scanner; "
            "add one that it sees, or give surfaces a roughness, diffuse_fraction or volume_depth"
        )
    if not force:
        check_points(scene, echoes)
    if echoes.range.size:
        s = measure(scene, echoes, progress=progress)
    else:
        shape = (azimuth.size, elevation.size, scene.band.points, 2)
        noise = np.random.default_rng(seed).standard_normal(shape, dtype=np.float32).view(np.complex64)
        s = np.moveaxis(noise[..., 0] * np.float32(np.sqrt(0.5)), -1, 0)
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
        **counts,
    )
    if snr_db is not None and echoes.range.size:
        sweep = add_noise(sweep, snr_db=snr_db, seed=seed)
    leakage = scene.scanner.leakage
    if leakage is not None:
        phase = -4.0j * np.pi * scene.band.frequency / speed_of_light * leakage.range
        sweep["s"].values[:] += (10.0 ** (leakage.level_db / 20.0) * np.exp(phase)).astype(np.complex64)[:, None, None]
    return sweep


def measure(scene: Scene3D, echoes: Echoes3D, *, progress: Progress | None = None) -> NDArray[np.complex64]:
    """Samples (frequencies, azimuths, elevations) of all beams; frequency varies fastest in memory."""
    azimuth, elevation = scene.scanner.angles
    frequency = scene.band.frequency
    grid = DelayGrid(frequency.size)
    width = echoes.width
    az, el = beam_angles(echoes.position)
    reach = beam_reach(width, echoes.range)
    # Meridians converge: a beam of the same width covers more azimuth further up.
    wider = reach / np.maximum(np.cos(np.radians(np.minimum(np.abs(el) + reach, 89.0))), 1e-2)
    columns = np.searchsorted(azimuth, [az - wider, az + wider])
    rows = np.searchsorted(elevation, [el - reach, el + reach])
    delay = 2.0 * echoes.range / speed_of_light
    turns = delay * float(frequency[1] - frequency[0])
    phase = -2.0 * np.pi * (delay * frequency[grid.center] % 1.0)
    amplitude = (echoes.amplitude * np.exp(1j * phase) * 2.0 / (np.pi * width**2)).astype(np.complex64)
    steps = turns % 1.0 * grid.size
    direction = echoes.position / echoes.range[:, None]
    out = np.zeros((azimuth.size, elevation.size, frequency.size), dtype=np.complex64)

    def column(i: int) -> None:
        lit = np.flatnonzero((columns[0] <= i) & (i < columns[1]) & (rows[0] < rows[1]))
        if lit.size:
            cells = np.zeros((elevation.size, grid.size), dtype=np.complex64)
            beams = beam_direction(azimuth[i], elevation)
            spread(direction[lit], echoes.range[lit], width[lit], steps[lit], amplitude[lit],
                   rows[0, lit], rows[1, lit] - 1, beams, cells)  # fmt: skip
            grid.to_band(cells, out[i])

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for done, _ in enumerate(pool.map(column, range(azimuth.size)), start=1):
            if progress is not None:
                progress(done, azimuth.size)
    return np.moveaxis(out, -1, 0)


def needed_points(scene: Scene3D, echoes: Echoes3D) -> int:
    """Frequencies that the longest return needs, ``1 + 2 B R / c``, leakage included."""
    farthest = float(echoes.range.max(initial=0.0))
    if scene.scanner.leakage is not None:
        farthest = max(farthest, scene.scanner.leakage.range)
    return 1 + int(np.ceil(2.0 * (scene.band.stop - scene.band.start) * farthest / speed_of_light))


def check_points(scene: Scene3D, echoes: Echoes3D) -> None:
    """Refuse a band whose frequencies are too few for the longest return.

    Raises
    ------
    InputError
        With the number that is needed.
    """
    needed = needed_points(scene, echoes)
    if scene.band.points < needed:
        raise InputError(
            f"scene {scene.name!r}: band.points is {scene.band.points}, but the longest return comes from "
            f"{echoes.range.max(initial=0.0):.2f} m and would wrap around to a wrong place; use at least {needed} "
            "frequencies, fewer bounces, or --force to go on"
        )


def check_step(scene: Scene3D) -> None:
    """Refuse a scan step so wide that things between two beams are seen by neither.

    Raises
    ------
    InputError
        With the largest step that does.
    """
    largest = float(np.degrees(STEP_PER_BEAM * scene.scanner.spot_radius / scene.scanner.focus_distance))
    for name, angles in zip(("azimuth", "elevation"), scene.scanner.angles, strict=True):
        step = float(np.diff(angles).max())
        if step > largest:
            raise InputError(
                f"scene {scene.name!r}: the scan step in {name} is {step:.3g} degrees, wider than the beam; use at "
                f"most {largest:.3g} degrees, {1 + int(np.ceil(np.ptp(angles) / largest))} points, or --force to go on"
            )
