"""Diffuse scatterers at fixed random places on the surfaces of a three-dimensional scene and inside its walls.

A piece of surface dS that is lit with the intensity I at the angle of incidence t scatters the radiant intensity ``I dS
Q(t) cos(t) cos(t') / pi`` into the angle t': Lambert's law with the scattered share Q. By reciprocity, a beam of unit
power that lights the surface with the intensity I receives ``lambda^2 I`` times the radiant intensity that returns
along it, with t' = t. So a scatterer contributes ``lambda I cos(t) sqrt(Q dS / pi) g`` to S11. Here g is a complex
Gaussian random number of the scatterer, the same for every beam and frequency: neighbouring beams see the same speckle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.geometry import Isometry
from mirrorfold.common.slabs import Polarization
from mirrorfold.common.types import Array, Index
from mirrorfold.scenes.materials import scattering_depth
from mirrorfold.scenes.solids import Finish, Scene3D
from mirrorfold.simulation.raster.meshes import Quad, Solid, vertex_normals
from mirrorfold.simulation.rays.scatterers import VOLUME_SHARE, roughness_factor, specular_coefficient

WALL_SPACING, BODY_SPACING = 0.006, 0.004
"""Mean distance of scatterers [m] on flat and on curved surfaces. A resolution cell of 5 mm range and a beam of 2 cm
radius then holds some ten scatterers, and with Gaussian strengths fewer suffice for fully developed speckle."""


@dataclass(frozen=True, eq=False)
class Speckle:
    """The diffuse scatterers of a scene.

    Attributes
    ----------
    foot : (n, 3) array [m]
        Point of the surface on or behind which each scatterer lies: where the wave enters.
    depth : (n,) array [m]
        Depth of each scatterer inside the wall; zero on the face.
    normal : (n, 3) array
        Outward unit normal at the foot.
    owner : (n,) array of int
        Number of the surface or patch whose finish determines the scattering.
    strength : (n,) complex array [m]
        ``sqrt(dS) g``, as above.
    """

    foot: Array
    depth: Array
    normal: Array
    owner: Index
    strength: NDArray[np.complex128]


def specular_amplitude(
    finish: Finish, frequency: float, cosine: Array, polarization: Polarization = "TE"
) -> NDArray[np.complex128]:
    """Amplitude reflection coefficient, (...): Fresnel's, reduced by roughness, `diffuse_fraction` and `loss_db`."""
    return specular_coefficient(finish, frequency, cosine, polarization) * np.sqrt(kept_share(finish))


def kept_share(finish: Finish) -> float:
    """Share of the reflected power that `diffuse_fraction` and `loss_db` leave in the specular direction."""
    return (1.0 - finish.diffuse_fraction) * power_ratio_of(-finish.loss_db)


def diffuse_share(finish: Finish, frequency: float, cosine: Array, *, inside: bool) -> Array:
    """Q: share of the incident power that is scattered on the face or, if `inside`, inside the wall, (...).

    It is computed for E parallel to the face (TE) and used for both polarizations: waves return from facets that face
    the scanner, which reflect both alike (Kirchhoff's approximation: Ulaby, Moore and Fung, Microwave Remote Sensing
    II, 1982, 12-4).
    """
    angle = np.arccos(np.clip(cosine, 0.0, 1.0))
    reflected = np.abs(finish.substance.reflection(frequency, angle)) ** 2
    kept = power_ratio_of(-finish.loss_db)
    if inside:
        return np.asarray(VOLUME_SHARE * (1.0 - reflected) * kept)
    coherent = roughness_factor(finish, frequency, angle) ** 2 * (1.0 - finish.diffuse_fraction)
    return np.asarray(reflected * (1.0 - coherent) * kept)


def scatters(finish: Finish) -> tuple[bool, bool]:
    """Whether a surface scatters diffusely on its face, and inside."""
    rough = finish.roughness is not None and finish.roughness.rms_height > 0.0
    return rough or finish.diffuse_fraction > 0.0, finish.volume_depth > 0.0


def draw_scatterers(scene: Scene3D, solids: list[Solid], *, seed: int, density: float = 1.0) -> Speckle:
    """Draw the scatterers on all surfaces of a scene and inside its walls.

    Parameters
    ----------
    scene : Scene3D
    solids : list of Solid
        Of the same scene.
    seed : int
        Seed of the random places and strengths. Those of a surface do not depend on other surfaces, nor on its patches.
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
    """Random points, evenly spread over one face of a solid, or over the whole solid if `quad` is None.

    Returns
    -------
    points, normals : (n, 3) arrays
        Points [m] and outward unit normals.
    area : float [m^2]
        Area that each point represents.
    """
    return _on_mesh(solid, spacing, generator) if quad is None else _on_quad(quad, spacing, generator)


def _on_quad(quad: Quad, spacing: float, generator: np.random.Generator) -> tuple[Array, Array, float]:
    """Points at one random place in each cell of a grid, their normals, and the area [m^2] that each represents."""
    counts = [max(1, int(np.ceil(2.0 * np.linalg.norm(edge) / spacing))) for edge in (quad.right, quad.up)]
    cells = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 2)
    place = 2.0 * (cells + generator.uniform(size=cells.shape)) / counts - 1.0
    foot = quad.center + place[:, :1] * quad.right + place[:, 1:] * quad.up
    area = 4.0 * float(np.linalg.norm(np.cross(quad.right, quad.up)))
    return foot, np.tile(quad.normal, (len(foot), 1)), area / len(foot)


def _on_mesh(solid: Solid, spacing: float, generator: np.random.Generator) -> tuple[Array, Array, float]:
    """Points in equal steps of accumulated area, interpolated normals, and the area [m^2] that each represents."""
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


def unfolding(quads: list[Quad], chain: tuple[int, ...]) -> Isometry:
    """The isometry from true places to the mirror images that the radar sees over a chain of mirrors.

    `chain` holds numbers of quads, in the order in which a ray from the radar meets them.
    """
    result = Isometry.identity(3)
    for index in chain:
        result = result @ Isometry.reflection(quads[index].center, quads[index].normal)
    return result
