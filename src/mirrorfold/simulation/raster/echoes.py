"""The echoes of a raster scan: mirror images of all scatterers, with amplitude and distance, once for all beams.

A scatterer that is seen by way of a chain of plane mirrors gives an echo at its mirror image, straight ahead of the
scanner. A plane face that a beam meets at a right angle, directly or by way of mirrors, sends back a specular echo, a
glint. Cylinders and spheres are mirrors, too, which spread the beam, see `mirrorfold.simulation.raster.rounds`; only
chains of one round mirror and nothing else are simulated. Mixed paths, out by one chain and back by another, are left
out: a narrow beam contains both only next to a mirror.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.beams import beam_angles, beam_direction
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.scenes.solids import Scene3D
from mirrorfold.simulation.limits import check_scanner
from mirrorfold.simulation.raster.chains import TracedScene, find_chains, trace_back, traced_scene
from mirrorfold.simulation.raster.meshes import solids
from mirrorfold.simulation.raster.panels import there_and_back
from mirrorfold.simulation.raster.rounds import RoundFace, facing_place, round_faces, shown_in, spread
from mirrorfold.simulation.raster.speckle import Speckle, diffuse_share, draw_scatterers, specular_amplitude, unfolding
from mirrorfold.simulation.rays.scatterers import named

BEAM_EDGE = 2.2
"""Distance from the axis of a beam, in beam radii, beyond which echoes are left out: 84 dB below the axis."""

SMALLEST_COSINE = 0.02
"""Least cosine of the angle to the normal, 89 degrees, at which a surface returns anything."""

SMALLEST_GLINT = 0.02
"""Shortest path of a glint [m]: shorter ones belong to faces that touch the scanner."""

SAME_WAY = 1e-3
"""Largest angle [rad] between the directions in which a glint's path leaves and returns: a fraction of any beam."""

PENCIL = 1e-3
"""Radius [m] of the pencil of rays that must all find the path of a glint."""

FAN = 81
"""Number of rays, along each angle, of the fan that finds the chains: 0.4 degrees apart in a field of 30 degrees."""


@dataclass(frozen=True, eq=False)
class Echoes3D:
    """Echoes at the mirror images of scatterers, or of the scanner itself (glints).

    Attributes
    ----------
    position : (n, 3) array [m]
        Place of each echo relative to the scanner, in the unfolded view: the mirror image.
    range : (n,) array [m]
        Distance of each echo from the scanner.
    amplitude : (n,) complex array [m^2]
        Contribution to S11 over the intensity of the beam [1/m^2].
    bounces : (n,) array of int
        Number of mirrors on the way.
    width, narrow : (n,) arrays [m]
        Distances from a beam's axis at which the response of the beam to each echo falls to ``exp(-2)``, along `across`
        and orthogonal to it. For scatterers both are the radius of the beam, unless a round mirror spreads the beam.
    across : (n, 3) array
        Unit vectors orthogonal to the line of sight; zero where both radii are equal.
    """

    position: Array
    range: Array
    amplitude: NDArray[np.complex128]
    bounces: NDArray[np.int64]
    width: Array
    narrow: Array
    across: Array

    @classmethod
    def even(cls, position: Array, range_: Array, amplitude: NDArray[np.complex128], bounces: NDArray[np.int64],
             width: Array) -> Echoes3D:  # fmt: skip
        """Echoes to which the response of a beam falls off equally in all directions."""
        return cls(position, range_, amplitude, bounces, width, width, np.zeros(position.shape))

    @classmethod
    def joined(cls, parts: Sequence[Echoes3D]) -> Echoes3D:
        """The echoes of several parts in one object."""
        return cls(*(np.concatenate([getattr(part, item.name) for part in parts]) for item in fields(cls)))


def find_echoes(scene: Scene3D, *, bounces: int, seed: int, density: float = 1.0) -> tuple[Echoes3D, dict[str, int]]:
    """All echoes of a scene: every scatterer by way of every chain of mirrors that shows it, and the glints.

    Parameters
    ----------
    scene : Scene3D
    bounces : int
        Largest number of mirrors of a chain.
    seed : int
        Seed of the scatterers.
    density : float
        Scatterers per area, relative to the default.

    Returns
    -------
    Echoes3D
    dict
        Numbers of `scatterers` and of `chains`.

    Raises
    ------
    InputError
        If the scanner stands on a surface.
    """
    parts = solids(scene)
    empty = _no_echoes()
    if not parts:
        return empty, {"scatterers": 0, "chains": 0}
    check_scanner(scene, parts)
    traced = traced_scene(scene, parts)
    speckle = draw_scatterers(scene, parts, seed=seed, density=density)
    origin = np.array(scene.scanner.origin)
    frequency = scene.band.middle
    fan = [np.linspace(a[0] - _margin(scene), a[-1] + _margin(scene), FAN) for a in scene.scanner.angles]
    directions = beam_direction(fan[0][:, None], fan[1]).reshape(-1, 3)
    chains = find_chains(scene, traced, origin, directions, bounces=bounces, frequency=frequency)
    found = [_over_chain(scene, traced, speckle, chain, frequency) for chain in chains]
    found += [_glint(scene, traced, chain, frequency) for chain in chains if chain]
    for face in round_faces(scene, frequency) if bounces else ():
        found += [_over_round(scene, traced, speckle, face, frequency), _round_glint(scene, traced, face, frequency)]
    return Echoes3D.joined(found), {"scatterers": len(speckle.depth), "chains": len(chains)}


def _no_echoes() -> Echoes3D:
    """No echoes."""
    return Echoes3D.even(np.empty((0, 3)), np.empty(0), np.empty(0, complex), np.empty(0, np.int64), np.empty(0))


def _margin(scene: Scene3D) -> float:
    """Angle [degree] beyond the scanned directions that the outermost beams still reach in their far field."""
    wavelength = speed_of_light / scene.band.middle
    return float(np.degrees(BEAM_EDGE * wavelength / (np.pi * scene.scanner.spot_radius)))


def _over_chain(
    scene: Scene3D, traced: TracedScene, speckle: Speckle, chain: tuple[int, ...], frequency: float
) -> Echoes3D:
    """Echoes of the scatterers that are seen by way of one chain of plane mirrors."""
    origin = np.array(scene.scanner.origin)
    to_image = unfolding(traced.quads, chain)
    virtual = to_image.inverse(origin)
    sight = virtual - speckle.foot
    distance = np.linalg.norm(sight, axis=1)
    cosine = np.einsum("nd,nd->n", sight, speckle.normal) / distance
    facing = np.flatnonzero(cosine > SMALLEST_COSINE)
    facing = facing[_in_view(scene, to_image(speckle.foot[facing]) - origin)]
    seen, waves = trace_back(scene, traced, origin, chain, speckle.foot[facing], frequency=frequency)
    facing, cosine = facing[seen], cosine[facing[seen]]
    # In the model, waves cross the inside of a wall straight and as fast as in air: depths are as a radar image shows.
    inward = -speckle.depth[facing] / cosine
    place = speckle.foot[facing] + inward[:, None] * sight[facing] / distance[facing, None]
    scattered = _scatterer_amplitude(scene, speckle, facing, cosine, frequency)
    position = to_image(place) - origin
    range_ = np.linalg.norm(position, axis=1)
    parts = [_no_echoes()]
    for wave in there_and_back([one.take(seen) for one in waves]):
        here = np.flatnonzero(np.abs(wave.amplitude) > 0.0)
        far = range_[here] + wave.extra[here]
        at = position[here] * (far / range_[here])[:, None] + wave.aside[here]
        width = scene.scanner.radius(far, speed_of_light / frequency)
        found = scattered[here] * wave.amplitude[here]
        parts.append(Echoes3D.even(at, far, found, np.full(here.size, len(chain)), width))
    return Echoes3D.joined(parts)


def _scatterer_amplitude(
    scene: Scene3D, speckle: Speckle, which: Index, cosine: Array, frequency: float
) -> NDArray[np.complex128]:
    """Amplitude [m^2] of the scatterers `which` (n,) over the intensity of the beam, without losses at mirrors.

    `cosine` (n,) is that of the angle between each scatterer's normal and its ray. The amplitudes of TM are those of H,
    whose sign turns on return, as in glints: a conductor returns both polarizations alike.
    """
    share = np.zeros(len(which))
    owner, inside = speckle.owner[which], speckle.depth[which] > 0.0
    for index in np.unique(owner):
        for within in (False, True):
            here = (owner == index) & (inside == within)
            share[here] = diffuse_share(scene.surface[index], frequency, cosine[here], inside=within)
    sign = -1.0 if scene.polarization == "TM" else 1.0
    return sign * speed_of_light / frequency * speckle.strength[which] * cosine * np.sqrt(share / np.pi)


def _over_round(scene: Scene3D, traced: TracedScene, speckle: Speckle, face: RoundFace, frequency: float) -> Echoes3D:
    """Echoes of the scatterers that are seen in a round face."""
    origin = np.array(scene.scanner.origin)
    seen, places, mirrors = shown_in(
        scene, traced, face, speckle.foot, speckle.normal, frequency=frequency, smallest_cosine=SMALLEST_COSINE
    )
    which = np.flatnonzero(seen)
    place, foot = places[which], speckle.foot[which]
    before, rest = np.linalg.norm(place - origin, axis=1), np.linalg.norm(foot - place, axis=1)
    cosine = np.sum((place - foot) * speckle.normal[which], axis=1) / rest
    rest = rest + speckle.depth[which] / cosine
    found = spread(scene, face, place, rest, frequency)
    amplitude = _scatterer_amplitude(scene, speckle, which, cosine, frequency) * mirrors[which] ** 2 * found.loss
    range_ = before + rest
    position = (range_ / before)[:, None] * (place - origin)
    echoes = Echoes3D(position, range_, amplitude, np.ones(len(which), np.int64), found.wide, found.narrow,
                      found.direction)  # fmt: skip
    inside = _in_view(scene, position, found.wide)
    return Echoes3D(*(getattr(echoes, item.name)[inside] for item in fields(Echoes3D)))


def _round_glint(scene: Scene3D, traced: TracedScene, face: RoundFace, frequency: float) -> Echoes3D:
    """Glint of a round face: the echo of the scanner's own mirror image in it.

    As `_glint`, but with ``beta = j k (1 / r1 + 1 / R)`` across a face of radius R at the distance r1. There is no
    glint if no beam meets the face at a right angle, or anything stands in between.
    """
    origin = np.array(scene.scanner.origin)
    place = facing_place(face, origin)
    if place is None or not _in_view(scene, place[None] - origin)[0]:
        return _no_echoes()
    way = place - origin
    before = float(np.linalg.norm(way))
    if before < SMALLEST_GLINT or traced.blocked(place[None], origin[None])[0]:
        return _no_echoes()
    wavelength = speed_of_light / frequency
    power, direction = face.shape.bending(way[None] / before, face.shape.outward(place[None]))
    alpha = 2.0 / float(scene.scanner.radius(before, wavelength)) ** 2
    beta = 2.0j * np.pi / wavelength * (1.0 / before + 0.5 * power[0])
    coupled, width = _self_coupling(alpha, beta)
    finish, sent = scene.surface[face.surface], named(scene.polarization)
    amplitude = specular_amplitude(finish, frequency, np.ones(1), sent) * coupled
    if width[0] < width[1]:
        direction = np.cross(way[None] / before, direction)
    return Echoes3D(way[None], np.array([before]), amplitude, np.ones(1, np.int64), np.array([width.max()]),
                    np.array([width.min()]), direction)  # fmt: skip


def _glint(scene: Scene3D, traced: TracedScene, chain: tuple[int, ...], frequency: float) -> Echoes3D:
    """Glint of a chain: the echo of the scanner's own mirror image in it, if the path returns as it left.

    Let D be the length of the path. The beam meets its own mirror image halfway, where both have the radius w and
    wavefronts of radius D/2. If the axes are a distance a apart, the two beams couple as ``2/w^2 / (alpha + beta)
    exp(-a^2 alpha beta / (alpha + beta))`` with ``alpha = 2/w^2`` and ``beta = 2 j k / D``. In the limit of short waves
    this is ``lambda D / 4`` times the intensity of the beam. A glint needs a flat face around the path: all rays of a
    small pencil must find the way, so that edges and corners return nothing.
    """
    nothing = _no_echoes()
    origin = np.array(scene.scanner.origin)
    to_image = unfolding(traced.quads, chain)
    way = to_image(origin) - origin
    length = float(np.linalg.norm(way))
    returns = to_image.linear.T @ way
    if length < SMALLEST_GLINT or np.linalg.norm(returns + way) > SAME_WAY * length:
        return nothing
    if not _in_view(scene, 0.5 * way[None])[0]:
        return nothing
    aside = np.linalg.svd(way[None])[2][1:]
    pencil = origin + PENCIL * np.concatenate([np.zeros((1, 3)), aside, -aside])
    seen, waves = trace_back(scene, traced, origin, chain, pencil, frequency=frequency)
    if not seen.all():
        return nothing
    wavelength = speed_of_light / frequency
    width = float(scene.scanner.radius(0.5 * length, wavelength))
    alpha, beta = 2.0 / width**2, 4.0j * np.pi / (wavelength * length)
    coupled, wide = _self_coupling(alpha, np.full(2, beta))
    half = 0.5 * length
    return Echoes3D.joined([
        Echoes3D.even(
            0.5 * ((1.0 + wave.extra[:1] / length) * way[None] + wave.aside[:1]), half + 0.5 * wave.extra[:1],
            wave.amplitude[:1] * coupled, np.array([len(chain)]), wide[:1],
        )
        for wave in waves
    ])  # fmt: skip


def _self_coupling(alpha: float, beta: NDArray[np.complex128]) -> tuple[complex, Array]:
    """Coupling of a beam with its own mirror image, for beta (2,) along two orthogonal directions, see `_glint`.

    Returns the amplitude on the axis over the intensity of the beam [m^2], and the radii of the response (2,) [m].
    """
    width = np.sqrt(2.0 / (alpha * beta / (alpha + beta)).real)
    return complex(np.prod(np.sqrt(alpha / (alpha + beta)) * width) * 0.5 * np.pi), width


def _in_view(scene: Scene3D, position: Array, width: Array | None = None) -> Mask:
    """Whether any beam reaches points (n, 3) [m] relative to the scanner, (n,).

    The radius of the beam there is `width` (n,) [m], by default that of a straight beam.
    """
    azimuth, elevation = beam_angles(position)
    range_ = np.linalg.norm(position, axis=1)
    wavelength = speed_of_light / scene.band.middle
    reach = beam_reach(scene.scanner.radius(range_, wavelength) if width is None else width, range_)
    inside = np.ones(len(position), dtype=bool)
    for angle, axis in zip((azimuth, elevation), scene.scanner.angles, strict=True):
        inside &= (angle >= axis[0] - reach) & (angle <= axis[-1] + reach)
    return inside


def beam_reach(width: Array, range_: Array) -> Array:
    """Angle [degree] from its axis up to which a beam of radius `width` [m] responds to echoes at `range_` [m]."""
    return np.degrees(np.arcsin(np.minimum(BEAM_EDGE * width / range_, 1.0)))
