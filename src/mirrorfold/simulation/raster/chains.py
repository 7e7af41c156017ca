"""Chains of plane mirrors: which a fan of rays can reach, and which scatterers are seen through each.

The radar pivots about one point, so what it can see does not depend on where its beam points: each scatterer is walked
back once by every chain that may show it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.geometry import reflect, unit
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.scenes.solids import Scene3D
from mirrorfold.simulation.raster.caster import Caster
from mirrorfold.simulation.raster.meshes import Quad, Solid
from mirrorfold.simulation.raster.speckle import specular_amplitude

WEAKEST_CHAIN = 1e-4
"""Chains that take more than 80 dB from an echo, there and back, are left out."""

SLACK = 2e-4
"""Rays may touch surfaces within this distance [m] of their ends, many times the ray caster's precision."""


@dataclass(frozen=True, eq=False)
class TracedScene:
    """Everything that rays can meet.

    Attributes
    ----------
    caster : Caster
        Of all triangles.
    quads : list of Quad
        All flat faces: what can be a mirror.
    first_quad : (f,) array of int
        For every triangle the number of its quad, -1 for curved surfaces. The two sides of a panel share its
        triangles; the number is that of the first one.
    """

    caster: Caster
    quads: list[Quad]
    first_quad: Index


def traced_scene(solids: list[Solid]) -> TracedScene:
    """All surfaces together."""
    quads: list[Quad] = []
    vertices, faces, numbers, offset = [], [], [], 0
    for solid in solids:
        vertices.append(solid.vertices)
        faces.append(solid.faces + offset)
        offset += len(solid.vertices)
        if not solid.quads:
            number = np.full(len(solid.faces), -1)
        elif len(solid.faces) == 2:
            number = np.full(2, len(quads))
        else:
            number = len(quads) + np.arange(len(solid.faces)) // 2
        numbers.append(number)
        quads.extend(solid.quads)
    return TracedScene(Caster(np.concatenate(vertices), np.concatenate(faces)), quads, np.concatenate(numbers))


def find_chains(
    scene: Scene3D, traced: TracedScene, origin: Array, directions: Array, *, bounces: int, frequency: float
) -> list[tuple[int, ...]]:
    """Chains of mirrors that rays from the radar follow, shortest first; the empty one is the line of sight.

    Parameters
    ----------
    scene : Scene3D
    traced : TracedScene
    origin : (3,) array [m]
    directions : (n, 3) array
        The fan: unit vectors.
    bounces : int
        Length of the longest chain.
    frequency : float [Hz]
        At which losses are taken.
    """
    chains: list[tuple[int, ...]] = [()]
    if not traced.quads:
        return chains
    normals = np.array([quad.normal for quad in traced.quads])
    start = np.tile(origin, (len(directions), 1))
    member = np.zeros(len(directions), dtype=np.int64)
    amplitude = np.ones(len(directions))
    for _ in range(bounces):
        face, along = traced.caster.first_hit(start, directions, start_at=SLACK)
        met = np.flatnonzero((face >= 0) & (traced.first_quad[face] >= 0))
        if not met.size:
            break
        quad, arriving = traced.first_quad[face[met]], directions[met]
        cosine = -np.einsum("nd,nd->n", arriving, normals[quad])
        # Behind the first side of a panel is its second one.
        quad, cosine = np.where(cosine < 0.0, quad + 1, quad), np.abs(cosine)
        left = amplitude[met]
        for number in np.unique(quad):
            here = quad == number
            finish = scene.surface[traced.quads[number].surface]
            left[here] *= np.abs(specular_amplitude(finish, frequency, cosine[here])) ** 2
        start = start[met] + along[met, None] * arriving
        directions = unit(arriving + 2.0 * cosine[:, None] * normals[quad])
        kept = left > WEAKEST_CHAIN
        start, directions, amplitude = start[kept], directions[kept], left[kept]
        pairs, member = np.unique(np.stack([member[met][kept], quad[kept]]), axis=1, return_inverse=True)
        member = member.ravel() + len(chains)
        chains += [(*chains[int(before)], int(number)) for before, number in pairs.T]
    return chains


def walk_back(
    scene: Scene3D,
    traced: TracedScene,
    origin: Array,
    chain: tuple[int, ...],
    points: Array,
    *,
    frequency: float,
) -> tuple[Mask, NDArray[np.complex128]]:
    """Which points a chain shows, and what its mirrors leave of the amplitude one way.

    Parameters
    ----------
    scene : Scene3D
    traced : TracedScene
    origin : (3,) array [m]
    chain : tuple of int
        Numbers of quads, from the radar on.
    points : (n, 3) array [m]
        On surfaces that face the radar's image in the chain.
    frequency : float [Hz]

    Returns
    -------
    seen : (n,) bool array
    amplitude : (n,) complex array
        Product of the reflection coefficients; meaningless where not seen.
    """
    images = [origin]
    for number in chain:
        quad = traced.quads[number]
        images.append(reflect(images[-1], quad.center, quad.normal))
    seen = np.ones(len(points), dtype=bool)
    amplitude = np.ones(len(points), dtype=complex)
    alive = np.arange(len(points))
    target = points
    for number, image in zip(reversed(chain), reversed(images[1:]), strict=True):
        quad = traced.quads[number]
        normal = quad.normal
        to_image = (image - quad.center) @ normal
        height = (target - quad.center) @ normal
        # The target is in front of the mirror and the image behind it.
        front = (height > SLACK) & (to_image < 0.0)
        along = height / np.where(front, height - to_image, 1.0)
        bounce = target + along[:, None] * (image - target)
        front &= quad.holds(bounce)
        front[front] &= ~traced.caster.blocked(target[front], bounce[front], slack=SLACK)
        seen[alive[~front]] = False
        alive, target, bounce = alive[front], target[front], bounce[front]
        cosine = (target - bounce) @ normal / np.maximum(np.linalg.norm(target - bounce, axis=1), 1e-12)
        amplitude[alive] *= specular_amplitude(scene.surface[quad.surface], frequency, cosine)
        target = bounce
    free = ~traced.caster.blocked(target, np.broadcast_to(origin, target.shape), slack=SLACK)
    seen[alive[~free]] = False
    return seen, amplitude
