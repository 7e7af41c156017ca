"""The truth of a three-dimensional scene: what the scan can see of its surfaces, and the contrast of its patches."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.beams import beam_angles, beam_direction
from mirrorfold.common.geometry import reflect
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.scenes.solids import Patch, Scene3D
from mirrorfold.scenes.surfaces import surface_named
from mirrorfold.scenes.visibility import BOUNCES, SMALLEST_COSINE, SMALLEST_RADIUS
from mirrorfold.scoring.figures import NEAR
from mirrorfold.scoring.mirrors import Face
from mirrorfold.scoring.transparent import WallImages
from mirrorfold.scoring.truth import Truth
from mirrorfold.simulation.raster.chains import find_chains, trace_back, traced_scene
from mirrorfold.simulation.raster.meshes import Solid, solids
from mirrorfold.simulation.raster.panels import HalfTransparentPanel, half_transparent_panel
from mirrorfold.simulation.raster.rounds import round_faces, shown_in
from mirrorfold.simulation.raster.speckle import sample, unfolding

TRUTH_SPACING = 0.005
"""Mean distance between samples of the true surfaces [m]: a quarter of the distance of a good point."""

RING, GUARD = 0.10, 0.02
"""A patch is compared with its surroundings up to the distance `RING` [m], without a strip along its edge, where
the beam falls on both: half of `GUARD` [m] inside of it, `GUARD` outside."""

FAN = 81
"""Number of rays along each side of the scan that search for mirrors: in a scan of 80 degrees, one for each degree."""


def truth(scene: Scene3D, *, bounces: int = BOUNCES) -> Truth:
    """Samples of all surfaces but the patches, and which can be seen by way of at most `bounces` mirrors."""
    parts = solids(scene)
    place, normals, owner = _samples(parts)
    direct, reachable = visible_truth(scene, parts, place, normals, bounces=bounces)
    names = {solid.surface: scene.surface[solid.surface].name for solid in parts}
    # The samples lie at random: some have their neighbours at twice the mean distance.
    return Truth(names, place, normals, owner, direct, reachable, size=TRUTH_SPACING**2, reach=TRUTH_SPACING)


def faces(scene: Scene3D) -> list[Face]:
    """The flat faces of surfaces that detected mirrors are compared with."""
    return [
        Face(scene.surface[solid.surface].name, quad.center, quad.normal, np.stack([quad.right, quad.up]))
        for solid in solids(scene)
        for quad in solid.quads
    ]


def _samples(parts: list[Solid]) -> tuple[Array, Array, Index]:
    """Samples of all surfaces: places (n, 3) [m], outward normals (n, 3), and index of the surface (n,)."""
    found = [(np.empty((0, 3)), np.empty((0, 3)), np.empty(0, dtype=np.int64))]
    for solid in parts:
        for side in solid.quads or (None,):
            place, normals, _ = sample(solid, side, TRUTH_SPACING, np.random.default_rng(0))
            found.append((place, normals, np.full(len(place), solid.surface)))
    place, normals, owner = map(np.concatenate, zip(*found, strict=True))
    return place, normals, owner


def visible_truth(
    scene: Scene3D, parts: list[Solid], place: Array, normals: Array, *, bounces: int
) -> tuple[Mask, Mask]:
    """Which samples of the truth the scan can see: directly; and directly or by way of mirrors, each (n,) bool."""
    direct = np.zeros(len(place), dtype=bool)
    reachable = direct.copy()
    if not parts:
        return direct, reachable
    traced = traced_scene(scene, parts)
    origin = np.array(scene.scanner.origin)
    frequency = scene.band.middle
    limit = scene.band.ambiguous_range
    azimuth, elevation = scene.scanner.angles
    sides = (np.linspace(axis[0], axis[-1], FAN) for axis in (azimuth, elevation))
    fan = beam_direction(*np.meshgrid(*sides, indexing="ij"))

    def scanned(places: Array) -> Mask:
        az, el = beam_angles(places - origin)
        return (az >= azimuth[0]) & (az <= azimuth[-1]) & (el >= elevation[0]) & (el <= elevation[-1])

    for chain in find_chains(scene, traced, origin, fan.reshape(-1, 3), bounces=bounces, frequency=frequency):
        to_image = unfolding(traced.quads, chain)
        sight = to_image.inverse(origin) - place
        distance = np.linalg.norm(sight, axis=1)
        facing = np.einsum("nd,nd->n", sight, normals) >= SMALLEST_COSINE * distance
        which = np.flatnonzero(scanned(to_image(place)) & facing & (distance <= limit) & ~reachable)
        which = which[trace_back(scene, traced, origin, chain, place[which], frequency=frequency)[0]]
        reachable[which] = True
        direct[which] |= not chain
    for face in round_faces(scene, frequency) if bounces else ():
        if face.shape.radius < SMALLEST_RADIUS:
            continue
        seen, places, _ = shown_in(
            scene, traced, face, place, normals, frequency=frequency, smallest_cosine=SMALLEST_COSINE
        )
        range_ = np.linalg.norm(places - origin, axis=1) + np.linalg.norm(place - places, axis=1)
        reachable |= seen & scanned(places) & (range_ <= limit)
    return direct, reachable


def walls_of_space(scene: Scene3D, places: Array) -> WallImages | None:
    """What the half-transparent panels show, and which places (p, 3) [m] lie behind them.

    None if there is no such panel, or no other surface.
    """
    parts = solids(scene)
    found = [(solid, half_transparent_panel(scene, solid, 0)) for solid in parts]
    panels, others = [panel for _, panel in found if panel], [solid for solid, panel in found if not panel]
    if not panels or not others:
        return None
    objects = _samples(others)[0]
    origin = np.array(scene.scanner.origin)
    met, incidence = np.zeros(len(places), dtype=bool), np.full(len(places), np.nan)
    for panel in panels:
        which, cosine = panel.met(np.broadcast_to(origin, places.shape), places)
        met[which], incidence[which] = True, np.arccos(np.clip(cosine, 0.0, 1.0))
    images = [reflect(objects, *_face_towards(panel, origin)) for panel in panels]
    return WallImages(objects, np.concatenate(images), met, incidence)


def _face_towards(panel: HalfTransparentPanel, place: Array) -> tuple[Array, Array]:
    """Center [m] and normal of the face of a panel that is turned towards a place, (3,) each."""
    normal = panel.middle.normal * np.sign((place - panel.middle.center) @ panel.middle.normal)
    return panel.middle.center + 0.5 * panel.thickness * normal, normal


def patch_contrasts(scene: Scene3D, points: Array, amplitude: Array) -> dict[str, float | None]:
    """The contrast of every patch [dB], by its name, see `patch_contrast`."""
    patches = [surface for surface in scene.surface if isinstance(surface, Patch)]
    return {patch.name: patch_contrast(scene, patch, points, amplitude) for patch in patches}


def patch_contrast(scene: Scene3D, patch: Patch, points: Array, amplitude: Array) -> float | None:
    """Mean power of the points on a patch over that of the points around it [dB]; None if there are none on either.

    The scene need not hold the patch: as a control, a scene without it is judged in the same region.
    """
    below = surface_named(scene, patch.on)
    solid = next(s for s in solids(scene) if scene.surface[s.surface].name == patch.on)
    back = below.frame.inverse
    place, normals, _ = _samples([solid])
    covered = patch.covers(back(place), normals @ back.linear.T)
    on_patch, off_patch = cKDTree(place[covered]), cKDTree(place[~covered])
    inside, outside = on_patch.query(points)[0], off_patch.query(points)[0]
    on = (inside < NEAR) & (outside > 0.5 * GUARD)
    around = (inside > GUARD) & (inside < RING) & (outside < NEAR)
    if not on.any() or not around.any():
        return None
    power = amplitude.astype(float) ** 2
    return float(10.0 * np.log10(power[on].mean() / power[around].mean()))
