"""Chains of plane mirrors: which chains a fan of rays finds, and which scatterers are seen over each of them.

The beam of the scanner pivots about one point, so that what is visible does not depend on where the beam points. Each
scatterer is therefore tested once per chain: the path is followed back from the scatterer over the mirrors to the
scanner.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mirrorfold.common.geometry import reflect, unit
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.scenes.solids import Scene3D
from mirrorfold.simulation.raster.caster import Caster
from mirrorfold.simulation.raster.meshes import Quad, Solid
from mirrorfold.simulation.raster.panels import (
    HalfTransparentPanel,
    Wave,
    after_passing,
    after_reflection,
    half_transparent_panel,
    one_after_another,
    strength,
)
from mirrorfold.simulation.raster.speckle import specular_amplitude
from mirrorfold.simulation.rays.scatterers import named

WEAKEST_CHAIN = 1e-4
"""Least share of the power that the mirrors of a chain must reflect, one way. Chains that take more than 40 dB one way,
80 dB from an echo out and back, are left out."""

SLACK = 2e-4
"""A surface within this distance [m] of an end of a ray does not block it: many times the ray caster's precision."""


@dataclass(frozen=True, eq=False)
class TracedScene:
    """All surfaces of a scene that rays can meet.

    Attributes
    ----------
    caster : Caster
        Ray caster of all triangles.
    quads : list of Quad
        All flat faces: those that can be mirrors.
    first_quad : (f,) array of int
        For every triangle the number of its quad, -1 on curved surfaces. The two faces of a panel share its triangles,
        which have the number of the first face.
    panels : list of HalfTransparentPanel
        Half-transparent panels; they have no triangles, and block no rays of the caster.
    """

    caster: Caster
    quads: list[Quad]
    first_quad: Index
    panels: list[HalfTransparentPanel]

    def blocked(self, origin: Array, target: Array) -> Mask:
        """Whether anything, half-transparent panels included, lies between origins and targets (n, 3) [m], (n,)."""
        blocked = self.caster.blocked(origin, target, slack=SLACK)
        for panel in self.panels:
            blocked[panel.met(origin, target)[0]] = True
        return blocked


def traced_scene(scene: Scene3D, solids: list[Solid]) -> TracedScene:
    """Collect the triangles, flat faces and half-transparent panels of all solids."""
    quads: list[Quad] = []
    panels: list[HalfTransparentPanel] = []
    vertices, faces = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)]
    numbers, offset = [np.empty(0, dtype=np.int64)], 0
    for solid in solids:
        if (panel := half_transparent_panel(scene, solid, len(quads))) is not None:
            panels.append(panel)
            quads.extend(solid.quads)
            continue
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
    caster = Caster(np.concatenate(vertices), np.concatenate(faces))
    return TracedScene(caster, quads, np.concatenate(numbers), panels)


def find_chains(
    scene: Scene3D, traced: TracedScene, origin: Array, directions: Array, *, bounces: int, frequency: float
) -> list[tuple[int, ...]]:
    """Chains of mirrors that rays from the scanner follow, shortest first; the empty chain is the line of sight.

    A ray of the fan is reflected at each flat face that it meets, and appends it to its chain.

    Parameters
    ----------
    scene : Scene3D
    traced : TracedScene
    origin : (3,) array [m]
    directions : (n, 3) array
        The fan: unit vectors.
    bounces : int
        Largest number of mirrors in a chain.
    frequency : float [Hz]
        Frequency at which the losses of the mirrors are computed.
    """
    chains: list[tuple[int, ...]] = [()]
    if not traced.quads:
        return chains
    normals = np.array([quad.normal for quad in traced.quads])
    start = np.tile(origin, (len(directions), 1))
    member = np.zeros(len(directions), dtype=np.int64)
    power = np.ones(len(directions))
    for _ in range(bounces):
        met, quad, along = _met(traced, start, directions)
        if not met.size:
            break
        arriving = directions[met]
        cosine = -np.einsum("nd,nd->n", arriving, normals[quad])
        # A panel met from behind reflects with its second face, which has the next number.
        quad, cosine = np.where(cosine < 0.0, quad + 1, quad), np.abs(cosine)
        left = power[met]
        for number in np.unique(quad):
            here = quad == number
            finish = scene.surface[traced.quads[number].surface]
            coefficient = specular_amplitude(finish, frequency, cosine[here], named(scene.polarization))
            left[here] *= np.abs(coefficient) ** 2
        start = start[met] + along[:, None] * arriving
        directions = unit(arriving + 2.0 * cosine[:, None] * normals[quad])
        kept = left > WEAKEST_CHAIN
        start, directions, power = start[kept], directions[kept], left[kept]
        pairs, member = np.unique(np.stack([member[met][kept], quad[kept]]), axis=1, return_inverse=True)
        member = member.ravel() + len(chains)
        chains += [(*chains[int(before)], int(number)) for before, number in pairs.T]
    return chains


def _met(traced: TracedScene, start: Array, directions: Array) -> tuple[Index, Index, Array]:
    """Flat faces that rays (n, 3) meet: the first opaque one, and every half-transparent panel in front of it.

    Returns, for each meeting, the number of the ray, the number of the quad (that of the first face for an opaque
    panel), and the distance from the start [m].
    """
    face, along = traced.caster.first_hit(start, directions, start_at=SLACK)
    opaque = np.flatnonzero(face >= 0)
    opaque = opaque[traced.first_quad[face[opaque]] >= 0]
    found = [(opaque, traced.first_quad[face[opaque]], along[opaque])]
    for panel in traced.panels:
        for number in (panel.front, panel.front + 1):
            quad = traced.quads[number]
            with np.errstate(divide="ignore", invalid="ignore"):
                distance = (quad.center - start) @ quad.normal / (directions @ quad.normal)
            before = (directions @ quad.normal < 0.0) & (distance > SLACK) & (distance < along)
            which = np.flatnonzero(before)
            which = which[quad.holds(start[which] + distance[which, None] * directions[which])]
            found.append((which, np.full(which.size, number), distance[which]))
    rays, quads, distances = (np.concatenate(column) for column in zip(*found, strict=True))
    return rays, quads, distances


def trace_back(
    scene: Scene3D,
    traced: TracedScene,
    origin: Array,
    chain: tuple[int, ...],
    points: Array,
    *,
    frequency: float,
) -> tuple[Mask, list[Wave]]:
    """Which points are seen over a chain, and the waves that arrive there, one way.

    The path is followed back from each point: to the last mirror in the direction of its image of the scanner, and so
    on to the scanner itself.

    Parameters
    ----------
    scene : Scene3D
    traced : TracedScene
    origin : (3,) array [m]
        The scanner.
    chain : tuple of int
        Numbers of quads, in the order in which a ray from the scanner meets them.
    points : (n, 3) array [m]
        Points of surfaces that face the image of the scanner in the chain.
    frequency : float [Hz]

    Returns
    -------
    seen : (n,) bool array
    waves : list of Wave
        Their amplitudes are products of the coefficients on the way; meaningless for points that are not seen. There is
        a single wave unless the path meets half-transparent panels.
    """
    images, turns = [origin], [np.eye(3)]
    for number in chain:
        quad = traced.quads[number]
        images.append(reflect(images[-1], quad.center, quad.normal))
        turns.append(turns[-1] @ (np.eye(3) - 2.0 * np.outer(quad.normal, quad.normal)))
    panel_at = {panel.front + side: panel for panel in traced.panels for side in (0, 1)}
    seen = np.ones(len(points), dtype=bool)
    waves = [Wave.straight(len(points))]
    alive = np.arange(len(points))
    target = points

    for level in reversed(range(len(chain))):
        quad, image = traced.quads[chain[level]], images[level + 1]
        normal = quad.normal
        to_image = (image - quad.center) @ normal
        height = (target - quad.center) @ normal
        # The target must be in front of the mirror, and the image behind it.
        front = (height > SLACK) & (to_image < 0.0)
        along = height / np.where(front, height - to_image, 1.0)
        bounce = target + along[:, None] * (image - target)
        front &= quad.holds(bounce)
        front[front] &= ~traced.caster.blocked(target[front], bounce[front], slack=SLACK)
        seen[alive[~front]] = False
        alive, target, bounce = alive[front], target[front], bounce[front]
        cosine = (target - bounce) @ normal / np.maximum(np.linalg.norm(target - bounce, axis=1), 1e-12)
        for which, later in after_passing(scene, traced.panels, bounce, target, turns[level + 1], frequency):
            waves = one_after_another(waves, alive[which], later)
        if (panel := panel_at.get(chain[level])) is not None:
            sight = unit(target - bounce)
            later = after_reflection(scene, panel, normal, sight, cosine, turns[level + 1], frequency)
            waves = one_after_another(waves, alive, later)
        else:
            finish = scene.surface[quad.surface]
            for wave in waves:
                coefficient = specular_amplitude(finish, frequency, cosine, named(scene.polarization))
                wave.amplitude[alive] *= coefficient
        target = bounce
    free = ~traced.caster.blocked(target, np.broadcast_to(origin, target.shape), slack=SLACK)
    seen[alive[~free]] = False
    alive, target = alive[free], target[free]
    start = np.broadcast_to(origin, target.shape)
    for which, later in after_passing(scene, traced.panels, start, target, turns[0], frequency):
        waves = one_after_another(waves, alive[which], later)
    if traced.panels:
        seen &= strength(waves, len(points)) ** 2 > WEAKEST_CHAIN
    return seen, waves
