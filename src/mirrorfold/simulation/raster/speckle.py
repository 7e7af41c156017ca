"""Diffuse scatterers, frozen on the surfaces of a three-dimensional scene and inside its walls.

A piece of surface dS turns the intensity I that meets it under the angle t into the radiant intensity ``I dS Q(t)
cos(t) cos(t') / pi``: Lambert's law with the scattered share Q. A beam that carries unit power receives back, by
reciprocity, ``lambda^2 I`` times that, so that a scatterer contributes ``lambda I cos(t) sqrt(Q dS / pi) g`` to S11,
where g is a complex Gaussian number of its own, the same for every beam and frequency: neighbouring beams see the
same speckle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.geometry import Isometry
from mirrorfold.common.slabs import Polarization
from mirrorfold.common.types import Array, Index
from mirrorfold.scenes.materials import coherent_factor, scattering_depth
from mirrorfold.scenes.solids import Finish, Scene3D
from mirrorfold.simulation.raster.meshes import Quad, Solid, vertex_normals
from mirrorfold.simulation.rays.scatterers import VOLUME_SHARE

WALL_SPACING, BODY_SPACING = 0.006, 0.004
"""Mean distance of scatterers [m] on flat and on curved surfaces: a range cell of 5 mm and a beam of 2 cm radius then
hold some ten each, and Gaussian numbers make fully developed speckle of fewer."""


@dataclass(frozen=True, eq=False)
class Speckle:
    """Scatterers of a scene.

    Attributes
    ----------
    foot : (n, 3) array [m]
        On the surface: where the wave enters.
    depth : (n,) array [m]
        How far inside each scatterer is; zero on the face.
    normal : (n, 3) array
        Outward unit normal at the foot.
    owner : (n,) array of int
        Index of the surface or patch that says how it scatters.
    strength : (n,) complex array [m]
        ``sqrt(dS) g``.
    """

    foot: Array
    depth: Array
    normal: Array
    owner: Index
    strength: NDArray[np.complex128]


def specular_amplitude(
    finish: Finish, frequency: float, cosine: Array, polarization: Polarization = "TE"
) -> NDArray[np.complex128]:
    """Reflection coefficient of a surface, (...): Fresnel's, less what roughness, texture and loss take."""
    angle = np.arccos(np.clip(cosine, 0.0, 1.0))
    kept = np.sqrt(1.0 - finish.diffuse_fraction) * 10.0 ** (-finish.loss_db / 20.0)
    coefficient = finish.substance.reflection(frequency, angle, polarization)
    return np.asarray(coefficient * _coherent(finish, frequency, angle) * kept)


def kept_share(finish: Finish) -> float:
    """Share of the reflected power that texture and loss leave to the specular direction."""
    return (1.0 - finish.diffuse_fraction) * 10.0 ** (-finish.loss_db / 10.0)


def diffuse_share(finish: Finish, frequency: float, cosine: Array, *, inside: bool) -> Array:
    """Q: share of the arriving power that is scattered on the face, or `inside`, (...).

    That of E parallel to the face serves both polarizations: what returns comes from facets that face the scanner and
    send both back alike (Kirchhoff's approximation: Ulaby, Moore and Fung, Microwave Remote Sensing II, 1982, 12-4).
    """
    angle = np.arccos(np.clip(cosine, 0.0, 1.0))
    reflected = np.abs(finish.substance.reflection(frequency, angle)) ** 2
    kept = 10.0 ** (-finish.loss_db / 10.0)
    if inside:
        return np.asarray(VOLUME_SHARE * (1.0 - reflected) * kept)
    coherent = _coherent(finish, frequency, angle) ** 2 * (1.0 - finish.diffuse_fraction)
    return np.asarray(reflected * (1.0 - coherent) * kept)


def _coherent(finish: Finish, frequency: float, angle: Array) -> Array:
    if finish.roughness is None:
        return np.ones_like(angle)
    return coherent_factor(
        finish.roughness.rms_height, frequency, angle, correlation_length=finish.roughness.correlation_length
    )


def scatters(finish: Finish) -> tuple[bool, bool]:
    """Whether a surface scatters diffusely on its face, and inside."""
    rough = finish.roughness is not None and finish.roughness.rms_height > 0.0
    return rough or finish.diffuse_fraction > 0.0, finish.volume_depth > 0.0


def freeze(scene: Scene3D, solids: list[Solid], *, seed: int, density: float = 1.0) -> Speckle:
    """Scatterers on all surfaces of a scene.

    Parameters
    ----------
    scene : Scene3D
    solids : list of Solid
        Of the same scene.
    seed : int
        A surface keeps its speckle whatever else the scene holds, and below a patch too.
    density : float
        Scatterers per area, relative to the default.
    """
    parts: list[tuple[Array, Array, Array, Index, NDArray[np.complex128]]] = []
    for solid in solids:
        surface = scene.surface[solid.surface]
        patches = scene.patches(surface.name)
        back = surface.frame.inverse
        for side, quad in enumerate(solid.quads or (None,)):
            for inside in (False, True):
                finishes = [surface, *(patch for _, patch in patches)]
                if not any(scatters(finish)[inside] for finish in finishes):
                    continue
                generator = np.random.default_rng([seed, solid.surface, side, inside])
                spacing = (BODY_SPACING if quad is None else WALL_SPACING) / np.sqrt(density)
                foot, normal, area = sample(solid, quad, spacing, generator)
                uniform = generator.uniform(size=len(foot))
                gaussian = generator.standard_normal((len(foot), 2)) @ np.array([1.0, 1.0j]) * np.sqrt(0.5)
                owner = np.full(len(foot), solid.surface)
                for index, patch in patches:
                    owner[patch.covers(back(foot), normal @ back.linear.T)] = index
                depth = np.zeros(len(foot))
                acts = np.zeros(len(foot), dtype=bool)
                for index in np.unique(owner):
                    here = owner == index
                    acts[here] = scatters(scene.surface[index])[inside]
                    if inside:
                        finish = scene.surface[index]
                        depth[here] = scattering_depth(finish.volume_profile, finish.volume_depth, uniform[here])
                strength = np.sqrt(area) * gaussian
                parts.append((foot[acts], depth[acts], normal[acts], owner[acts], strength[acts]))
    if not parts:
        return Speckle(np.empty((0, 3)), np.empty(0), np.empty((0, 3)), np.empty(0, np.int64), np.empty(0, complex))
    return Speckle(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def sample(
    solid: Solid, quad: Quad | None, spacing: float, generator: np.random.Generator
) -> tuple[Array, Array, float]:
    """Random points on one face of a solid, or on all of it, evenly spread.

    Returns
    -------
    points, normals : (n, 3) arrays
        The normals are outward and have length one.
    area : float [m^2]
        That each point stands for.
    """
    return _on_mesh(solid, spacing, generator) if quad is None else _on_quad(quad, spacing, generator)


def _on_quad(quad: Quad, spacing: float, generator: np.random.Generator) -> tuple[Array, Array, float]:
    """One point at a random place in each cell of a grid; normals; the area that each stands for."""
    counts = [max(1, int(np.ceil(2.0 * np.linalg.norm(edge) / spacing))) for edge in (quad.right, quad.up)]
    cells = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 2)
    place = 2.0 * (cells + generator.uniform(size=cells.shape)) / counts - 1.0
    foot = quad.center + place[:, :1] * quad.right + place[:, 1:] * quad.up
    area = 4.0 * float(np.linalg.norm(np.cross(quad.right, quad.up)))
    return foot, np.tile(quad.normal, (len(foot), 1)), area / len(foot)


def _on_mesh(solid: Solid, spacing: float, generator: np.random.Generator) -> tuple[Array, Array, float]:
    """Points in equal steps of accumulated area, with smooth normals; the area that each stands for."""
    corners = solid.vertices[solid.faces]
    normals = vertex_normals(solid.vertices, solid.faces)[solid.faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    total = np.cumsum(area)
    count = max(1, int(np.ceil(total[-1] / spacing**2)))
    face = np.searchsorted(total, (np.arange(count) + generator.uniform(size=count)) / count * total[-1])
    face = np.minimum(face, len(area) - 1)
    first, second = generator.uniform(size=(2, count))
    flip = first + second > 1.0
    first[flip], second[flip] = 1.0 - first[flip], 1.0 - second[flip]
    weights = np.stack([1.0 - first - second, first, second], axis=1)
    foot = np.einsum("nk,nkd->nd", weights, corners[face])
    normal = np.einsum("nk,nkd->nd", weights, normals[face])
    return foot, normal / np.linalg.norm(normal, axis=1, keepdims=True), total[-1] / count


def image_frame(quads: list[Quad], chain: tuple[int, ...]) -> Isometry:
    """The map from the true scene to where a chain of mirrors shows it to the radar, first mirror first."""
    result = Isometry.identity(3)
    for index in chain:
        result = result @ Isometry.reflection(quads[index].center, quads[index].normal)
    return result
