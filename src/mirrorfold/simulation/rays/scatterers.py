"""Diffuse scatterers at fixed random places on every rough surface, and inside every wall with a `volume_depth`.

A scatterer turns the incident field E into the wave ``sigma E exp(-j k d) / sqrt(d)`` at the distance d. Its mean
strength, for the angle of incidence ti and the scattering angle ts, both from the normal, is

``|sigma|^2 = l cos(ti) Q(ti) cos(ts) Q(ts) / (2 C)``,  ``C = integral of Q cos over [0, pi/2]``,

with l the length of outline that the scatterer represents, and Q(t) the scattered share of the power incident at angle
t. This law is symmetric in both angles, hence reciprocal. It is a product of one factor for the way in and one for the
way out. It conserves energy at every angle of incidence: the power scattered into the half circle is ``l cos(ti)
Q(ti)``. If Q does not depend on the angle, it is Lambert's law, ``l Q cos(ti) cos(ts) / 2``; for slight roughness of
short correlation length it is the first-order perturbation result, proportional to ``cos(ti)^2 cos(ts)^2`` (Rice, Comm.
Pure Appl. Math. 4, 1951).

*A rough face* scatters the power that its roughness takes from the specular beam, ``Q = |R|^2 (1 - rho^2)``, with
Fresnel's coefficient R and the coherent factor rho. *The inside* of a wall scatters back the share `VOLUME_SHARE` of
the power that enters, ``1 - |R|^2``. In the model, waves cross the inside straight and as fast as in air: the depths of
its scatterers are therefore those that a radar image shows.

In TM, whose amplitudes are those of H, scattered waves have the opposite sign of those in TE, as reflected waves have:
whatever of a conductor is met once, smooth or rough, returns both polarizations alike. For slight roughness this sign
is the same at all angles, at Brewster's angle too (Rice 1951).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mirrorfold.common.slabs import Polarization
from mirrorfold.common.types import Array, Complex
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.materials import Substance, coherent_factor, material, scattering_depth
from mirrorfold.scenes.surfaces import Roughness, Surface
from mirrorfold.simulation.rays.outline import Outline
from mirrorfold.simulation.rays.paths import Points

VOLUME_SHARE = 0.1
"""Share of the power entering a wall that its inside scatters back. With this value, a porous board such as drywall
returns several times more from its inside than from a face of 50 um rms height at 0.3 THz."""

ANGLES, ANGLE_WEIGHTS = np.polynomial.legendre.leggauss(64)
"""Nodes and weights of the Gauss-Legendre quadrature over the angle, on [-1, 1]; the integrands are smooth."""


class Faced(Protocol):
    """Any surface with a material and a roughness, in a floor plan or in space."""

    @property
    def material(self) -> str | Substance:
        """Material of the surface: a name, or permittivity and conductivity."""
        ...

    @property
    def roughness(self) -> Roughness | None:
        """Roughness of the face; None for a smooth one."""
        ...


def specular_coefficient(
    surface: Faced, frequency: ArrayLike, cosine: ArrayLike, polarization: Polarization = "TE"
) -> NDArray[np.complex128]:
    """Amplitude reflection coefficient of a surface: Fresnel's coefficient times the coherent factor of its roughness.

    Parameters
    ----------
    surface : Surface
    frequency : (...) array [Hz]
    cosine : (...) array
        Cosine of the angle of incidence.
    polarization : {"TE", "TM"}

    Returns
    -------
    (...) complex array, broadcast from frequency and cosine.
    """
    angle = np.arccos(np.clip(cosine, 0.0, 1.0))
    coefficient = material(surface.material).reflection(frequency, angle, polarization)
    return np.asarray(coefficient * roughness_factor(surface, frequency, angle))


def named(polarization: str) -> Polarization:
    """The polarization of a scene as the literal "TE" or "TM"; scenes with "both" are split before they get here."""
    return "TM" if polarization == "TM" else "TE"


def roughness_factor(surface: Faced, frequency: ArrayLike, angle: ArrayLike) -> Array:
    """Factor by which roughness reduces the specular amplitude of a surface, broadcast (...) array; 1 if smooth."""
    if surface.roughness is None:
        return np.ones(np.broadcast_shapes(np.shape(frequency), np.shape(angle)))
    return coherent_factor(
        surface.roughness.rms_height,
        frequency,
        angle,
        correlation_length=surface.roughness.correlation_length,
    )


@dataclass(frozen=True)
class DiffuseLaw:
    """How strongly the face of a surface, or the inside of a wall, scatters; the formulas stand above.

    Attributes
    ----------
    surface : Surface
    inside : bool
        True for the inside of the wall, False for its face.
    polarization : {"TE", "TM"}
    """

    surface: Surface
    inside: bool
    polarization: Polarization = "TE"

    def share(self, frequency: ArrayLike, angle: ArrayLike) -> Array:
        """Q, the scattered share of the power that is incident at `angle` [rad], (...) array."""
        made_of = material(self.surface.material)
        reflected = np.abs(made_of.reflection(frequency, angle, self.polarization)) ** 2
        if self.inside:
            return np.asarray(VOLUME_SHARE * (1.0 - reflected))
        return np.asarray(reflected * (1.0 - roughness_factor(self.surface, frequency, angle) ** 2))

    def factor(self, frequency: Array, cosine: Array) -> Array | Complex:
        """Factor of one way in ``sigma`` for unit length of outline, ``sqrt(cos(t) Q(t)) / (2 C)^(1/4)``; in TM, j
        times that.

        Parameters
        ----------
        frequency : (f, 1) array [Hz]
        cosine : (p,) array
            Cosine of the angle t between the path and the normal.

        Returns
        -------
        (f, p) array, dimensionless; complex in TM
        """
        nodes = 0.25 * np.pi * (ANGLES + 1.0)
        total = 0.25 * np.pi * (self.share(frequency, nodes) * np.cos(nodes)) @ ANGLE_WEIGHTS
        angle = np.arccos(np.clip(cosine, 0.0, 1.0))
        found = np.sqrt(np.cos(angle) * self.share(frequency, angle)) / (2.0 * total[:, None]) ** 0.25
        return np.asarray(1.0j * found if self.polarization == "TM" else found)


@dataclass(frozen=True, eq=False)
class Scatterers:
    """Positions, random strengths and scattering laws of all scatterers.

    Attributes
    ----------
    points : Points
        Positions and normals. A rough surface has separate scatterers for its two sides, since nothing passes through
        it.
    weight : (s,) complex array [m^(1/4)]
        Random amplitude of each scatterer for one way, apart from the factor of its law. The square of it is a complex
        Gaussian number whose mean power is the length of outline that the scatterer represents. So a resolution cell
        shows fully developed speckle, however few scatterers it holds.
    law : (s,) array of int
        Index into `laws`.
    laws : tuple of DiffuseLaw
    """

    points: Points
    weight: NDArray[np.complex128]
    law: NDArray[np.int64]
    laws: tuple[DiffuseLaw, ...]

    def __len__(self) -> int:
        return self.weight.size

    def tiles(self, count: int) -> Iterator[Scatterers]:
        """The scatterers in `count` tiles of nearly equal size, one after the other."""
        ends = np.linspace(0, len(self), count + 1).astype(int)
        for first, last in pairwise(ends):
            some = slice(first, last)
            points = Points(self.points.position[some], self.points.normal[some], self.points.enclosing_face[some])
            yield Scatterers(points, self.weight[some], self.law[some], self.laws)


def draw_scatterers(scene: Scene, outline: Outline, *, spacing: float, seed: int) -> Scatterers:
    """Scatterers on all rough surfaces of a scene and inside its walls.

    Parameters
    ----------
    scene : Scene
    outline : Outline
        Outline of the same scene.
    spacing : float [m]
        Largest mean distance of neighbouring scatterers along the outline; the mean power does not depend on it.
    seed : int

    Raises
    ------
    InputError
        If a surface into which no wave enters is given a volume depth.
    """
    laws: list[DiffuseLaw] = []
    parts: list[tuple[Array, Array, NDArray[np.int64], NDArray[np.complex128], NDArray[np.int64]]] = []
    for obstacle, index in enumerate(outline.surface):
        surface = scene.surface[index]
        # One random generator per obstacle: a change of another surface does not change the speckle of this one.
        generator = np.random.default_rng([seed, obstacle])
        for law in _laws(surface, scene):
            laws.append(law)
            for side in (1.0, -1.0):
                foot, normal, length = _points_along(outline, obstacle, side, spacing, generator)
                depth = np.zeros(len(foot))
                if law.inside:
                    reach = surface.volume_depth
                    if obstacle >= len(outline.facets) and side > 0.0:
                        # Behind the convex side of an arc the wall cannot extend deeper than the center of the arc.
                        reach = min(reach, outline.arcs[obstacle - len(outline.facets), 2])
                    depth = scattering_depth(surface.volume_profile, reach, generator.uniform(size=len(foot)))
                gaussian = generator.standard_normal((len(foot), 2)) @ np.array([1.0, 1.0j]) * np.sqrt(0.5)
                parts.append(
                    (
                        foot - depth[:, None] * normal,
                        normal,
                        np.full(len(foot), obstacle if law.inside else -1),
                        np.sqrt(gaussian * np.sqrt(length)),
                        np.full(len(foot), len(laws) - 1),
                    )
                )
    if not parts:
        return Scatterers(Points.free(np.empty((0, 2))), np.empty(0, complex), np.empty(0, np.int64), ())
    position, normals, enclosing_face, weight, which = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Scatterers(Points(position, normals, enclosing_face), weight, which, tuple(laws))


def _laws(surface: Surface, scene: Scene) -> list[DiffuseLaw]:
    """The laws by which a surface scatters: on its face, inside, both, or none for a smooth surface."""
    laws, polarization = [], named(scene.polarization)
    if surface.roughness is not None and surface.roughness.rms_height > 0.0:
        laws.append(DiffuseLaw(surface, False, polarization))
    if surface.volume_depth > 0.0:
        law = DiffuseLaw(surface, True, polarization)
        if not law.share(scene.band.start, 0.0) > 0.0:
            raise InputError(
                f"surface {surface.name!r}: volume_depth is {surface.volume_depth:g} m, but no wave enters the "
                f"material {surface.material!r}; choose another one such as 'plasterboard', or remove volume_depth"
            )
        laws.append(law)
    return laws


def _points_along(
    outline: Outline, obstacle: int, side: float, spacing: float, generator: np.random.Generator
) -> tuple[Array, Array, float]:
    """Points on one side of an obstacle, one at a random place in each of n equal cells.

    Returns the points (n, 2) [m], their unit normals (n, 2), and the length of a cell [m]. `side` is +1 for the left
    side of a facet or the convex side of an arc, -1 for the other side.
    """
    if obstacle < len(outline.facets):
        start, end = outline.facets[obstacle]
        length = float(np.linalg.norm(end - start))
    else:
        x, y, radius, first, span = outline.arcs[obstacle - len(outline.facets)]
        length = float(radius * span)
    cells = max(1, int(np.ceil(length / spacing)))
    along = (np.arange(cells) + generator.uniform(size=cells)) / cells
    if obstacle < len(outline.facets):
        normal = np.array([start[1] - end[1], end[0] - start[0]]) / length
        return start + along[:, None] * (end - start), np.tile(side * normal, (cells, 1)), length / cells
    angle = first + span * along
    outward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.array([x, y]) + radius * outward, side * outward, length / cells
