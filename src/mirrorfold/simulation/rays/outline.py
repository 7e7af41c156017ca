"""The outlines of a scene as rays meet them: straight facets and circular arcs, opaque but for walls with a thickness.

Arcs are kept as exact arcs. Divided into chords, each chord would cost a test, and a convex surface would shadow itself
at every joint.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.surfaces import Arc, Circle, Polyline, Segment

TOUCH = 1e-6
"""An outline within this distance [m] of the end of a ray does not block the ray, as the end lies on the outline: a
thousandth of a wavelength at 300 GHz, and far above the rounding of coordinates."""


Obstacles = tuple[Array, Array, Array, float]
"""The `shades`, the `arcs`, the `beyond` and the `wavelength` of an `Outline`."""


@dataclass(frozen=True, eq=False)
class Outline:
    """Facets and arcs. Together they are the obstacles, numbered with the facets first and the arcs after them.

    Attributes
    ----------
    facets : (f, 2, 2) array [m]
        Start and end of each straight facet.
    arcs : (a, 5) array
        Center x, y [m], radius [m], first angle [rad] and angular span [rad], counter-clockwise.
    surface : (f + a,) array of int
        Number of the surface of the scene that each obstacle belongs to.
    slabs : tuple of int
        Numbers of the facets of half-transparent walls: they are mirrors, but block no ray.
    wavelength : float [m]
        Wavelength in the penumbras of shadows and mirrors, see `penumbras`; 0 if all edges are sharp.
    """

    facets: Array
    arcs: Array
    surface: NDArray[np.int64]
    slabs: tuple[int, ...] = ()
    wavelength: float = 0.0

    @cached_property
    def obstacles(self) -> Obstacles:
        """The obstacles as kernels take them."""
        return self.shades, self.arcs, self.beyond, self.wavelength

    @property
    def sharp_obstacles(self) -> Obstacles:
        """The same without penumbras."""
        return self.shades, self.arcs, self.beyond, 0.0

    @cached_property
    def shades(self) -> Array:
        """The facets that block rays, (f, 2, 2) [m]; NaN for those of half-transparent walls."""
        if not self.slabs:
            return self.facets
        shades = self.facets.copy()
        shades[list(self.slabs)] = np.nan
        return shades

    @cached_property
    def beyond(self) -> Array:
        """Far ends of the facets that continue each facet beyond its start and its end, (f, 2, 2) [m]; NaN for none."""
        found = np.full((len(self.facets), 2, 2), np.nan)
        for i, facet in enumerate(self.facets):
            for other in np.delete(self.facets, i, axis=0):
                apart = np.linalg.norm(facet[:, None] - other, axis=-1) < TOUCH
                for end, of_other in zip(*np.nonzero(apart), strict=True):
                    found[i, end] = other[1 - of_other]
        return found


def outline_of(scene: Scene, *, penumbras: bool = False) -> Outline:
    """The outline of a two-dimensional scene, with penumbras at the middle of its band if these are wanted.

    Raises
    ------
    InputError
        If a surface is neither straight nor circular, or coincides with a part of another surface.
    """
    facets: list[tuple[int, Array]] = []
    arcs: list[tuple[int, tuple[float, ...]]] = []
    for index, surface in enumerate(scene.surface):
        if isinstance(surface, Segment):
            facets.append((index, np.array([surface.start, surface.end])))
        elif isinstance(surface, Polyline):
            corners = np.array(surface.points)
            facets += [(index, corners[i : i + 2]) for i in range(len(corners) - 1)]
        elif isinstance(surface, Arc):
            first, last = sorted((np.radians(surface.start_angle), np.radians(surface.stop_angle)))
            arcs.append((index, (*surface.center, surface.radius, first, last - first)))
        elif isinstance(surface, Circle):
            arcs.append((index, (*surface.center, surface.radius, 0.0, 2.0 * np.pi)))
        else:
            raise InputError(
                f"surface[{index}] {surface.name!r} is a {surface.kind}, which rays cannot follow; "
                "expected a segment, polyline, arc or circle"
            )
    for pair in (_first_overlap(facets, _facets_overlap), _first_overlap(arcs, _arcs_overlap)):
        if pair is not None:
            one, other = (f"surface[{index}] {scene.surface[index].name!r}" for index in pair)
            raise InputError(
                f"scene {scene.name!r}: {one} and {other} lie on one another and would both reflect; remove one"
            )
    thick = [getattr(scene.surface[index], "thickness", None) is not None for index, _ in facets]
    return Outline(
        facets=np.array([facet for _, facet in facets]).reshape(-1, 2, 2),
        arcs=np.array([arc for _, arc in arcs]).reshape(-1, 5),
        surface=np.array([index for index, _ in [*facets, *arcs]], dtype=np.int64),
        slabs=tuple(np.flatnonzero(thick).tolist()),
        wavelength=speed_of_light / scene.band.middle if penumbras else 0.0,
    )


def _first_overlap(pieces: list[tuple[int, Any]], overlap: Callable[[Array, Array], Array]) -> tuple[int, int] | None:
    """Numbers of the first two surfaces with pieces that overlap; None if there are none.

    `pieces` are pairs of the number of a surface and the shape of one of its pieces; `overlap` compares one shape with
    many.
    """
    owner = np.array([index for index, _ in pieces], dtype=np.int64)
    shapes = np.array([shape for _, shape in pieces])
    for n in range(len(pieces) - 1):
        found = np.flatnonzero(overlap(shapes[n], shapes[n + 1 :]) & (owner[n + 1 :] != owner[n]))
        if found.size:
            return int(owner[n]), int(owner[n + 1 + found[0]])
    return None


def _facets_overlap(facet: Array, others: Array) -> Array:
    """Mask (n,) of the other facets (n, 2, 2) [m] that share more than a point with a facet (2, 2) [m]."""
    length = np.linalg.norm(facet[1] - facet[0])
    along = (facet[1] - facet[0]) / length
    ways = others - facet[0]
    aside = np.abs(ways @ [-along[1], along[0]]).max(axis=1)
    first, last = np.sort(ways @ along, axis=1).T
    return np.asarray((aside < TOUCH) & (np.minimum(last, length) - np.maximum(first, 0.0) > TOUCH))


def _arcs_overlap(arc: Array, others: Array) -> Array:
    """Mask (n,) of the other arcs (n, 5) that share more than a point with an arc (5,), both as in `Outline`."""
    later = (others[:, 3] - arc[3]) % (2.0 * np.pi)
    apart = TOUCH / arc[2]
    meet = (later < arc[4] - apart) | (later + others[:, 4] > 2.0 * np.pi + apart)
    return np.asarray((np.abs(others[:, :3] - arc[:3]) < TOUCH).all(axis=1) & meet)


@njit(error_model="numpy", nogil=True)
def crossings_facet(px: float, py: float, qx: float, qy: float, facet: Array) -> int:
    """How often (0 or 1) the segment p -> q crosses a facet, its ends included; touching at p or q is no crossing."""
    ax, ay = facet[0, 0], facet[0, 1]
    sx, sy = facet[1, 0] - ax, facet[1, 1] - ay
    dx, dy = qx - px, qy - py
    denominator = dx * sy - dy * sx
    if denominator == 0.0:
        return 0
    along_facet = ((ax - px) * dy - (ay - py) * dx) / denominator
    if not 0.0 <= along_facet <= 1.0:
        return 0
    along_ray = ((ax - px) * sy - (ay - py) * sx) / denominator
    margin = TOUCH / np.sqrt(dx * dx + dy * dy)
    return 1 if margin < along_ray < 1.0 - margin else 0


@njit(error_model="numpy", nogil=True)
def _crossings_arc(px: float, py: float, qx: float, qy: float, arc: Array) -> int:
    """How often (0, 1 or 2) the segment p -> q crosses an arc; touching the arc at p or q is no crossing."""
    dx, dy = qx - px, qy - py
    ox, oy = px - arc[0], py - arc[1]
    radius = arc[2]
    length = np.sqrt(dx * dx + dy * dy)
    if length <= TOUCH:
        return 0
    dx, dy = dx / length, dy / length
    nearest = -(ox * dx + oy * dy)
    half_chord2 = radius * radius - (ox * dy - oy * dx) ** 2
    if not half_chord2 > 0.0:
        return 0
    half_chord = np.sqrt(half_chord2)
    count = 0
    for sign in (-1.0, 1.0):
        distance = nearest + sign * half_chord
        if TOUCH < distance < length - TOUCH:
            angle = np.arctan2(oy + distance * dy, ox + distance * dx)
            if (angle - arc[3]) % (2.0 * np.pi) <= arc[4]:
                count += 1
    return count


@njit(error_model="numpy", nogil=True)
def shadowed(px: float, py: float, qx: float, qy: float, facets: Array, arcs: Array, enclosing_face: int) -> bool:
    """Whether an obstacle blocks the straight segment p -> q.

    Parameters
    ----------
    px, py, qx, qy : float [m]
    facets, arcs : (f, 2, 2) and (a, 5) arrays
        As in `Outline`.
    enclosing_face : int
        Number of the obstacle that the segment has to cross exactly once, because p lies inside the wall whose face
        this obstacle is; -1 for none.
    """
    for i in range(facets.shape[0]):
        if crossings_facet(px, py, qx, qy, facets[i]) != (1 if i == enclosing_face else 0):
            return True
    return shadowed_by_arcs(px, py, qx, qy, arcs, enclosing_face - facets.shape[0])


@njit(error_model="numpy", nogil=True)
def shadowed_by_arcs(px: float, py: float, qx: float, qy: float, arcs: Array, enclosing: int) -> bool:
    """Whether an arc blocks the straight segment p -> q, which must cross the arc `enclosing`, if not below 0, once."""
    for i in range(arcs.shape[0]):  # noqa: SIM110 - Numba compiles no generators
        if _crossings_arc(px, py, qx, qy, arcs[i]) != (1 if i == enclosing else 0):
            return True
    return False
