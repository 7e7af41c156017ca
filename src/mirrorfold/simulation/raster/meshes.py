"""The surfaces of a three-dimensional scene as triangles, and the flat rectangles among them, which can be mirrors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.geometry import Isometry, unit
from mirrorfold.common.memory import check_room
from mirrorfold.common.reading import check_file
from mirrorfold.common.types import Array, Index
from mirrorfold.errors import InputError
from mirrorfold.scenes.solids import Box, Cylinder, Mannequin, Mesh, Panel, Patch, Scene3D, Sphere, Surface3D
from mirrorfold.simulation.raster.caster import NOT_INSTALLED, Caster
from mirrorfold.simulation.raster.mannequin import mannequin_mesh

MESH_GROWTH = 18.0
"""Memory to load and check a mesh over the size of its file: measured on binary STL, the densest format."""

LARGEST_MESH = 100.0
"""Largest extent of a mesh [m]: a larger one was probably made in another unit."""

CURVE_CELL = 0.012
"""Length of the facets on cylinders and, within `BALL_DIVISIONS`, on spheres [m]."""

BALL_DIVISIONS = 3, 6
"""Fewest and most times that the 20 triangles of an icosahedron are divided into four each: 82 000 at most."""

_QUAD = np.array([[0, 1, 2], [0, 2, 3]])


@dataclass(frozen=True, eq=False)
class Quad:
    """A flat rectangle that reflects on the side of its normal, ``right x up``.

    Attributes
    ----------
    center, right, up : (3,) arrays [m]
        The center, and half of either edge: the corners are ``center +- right +- up``.
    surface : int
        Number of its surface in the scene.
    """

    center: Array
    right: Array
    up: Array
    surface: int

    @property
    def normal(self) -> Array:
        """Unit normal, (3,)."""
        return unit(np.cross(self.right, self.up))

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (n, 3) [m] of its plane lie inside the rectangle, (n,)."""
        offset = points - self.center
        across = np.abs(offset @ self.right) / (self.right @ self.right)
        along = np.abs(offset @ self.up) / (self.up @ self.up)
        return np.asarray((across <= 1.0) & (along <= 1.0))

    def nearest(self, point: Array) -> Array:
        """The point of the rectangle that is nearest to a point (3,) [m]."""
        edges = np.stack([self.right, self.up])
        share = np.clip(edges @ (point - self.center) / np.sum(edges**2, axis=1), -1.0, 1.0)
        return np.asarray(self.center + share @ edges)


@dataclass(frozen=True, eq=False)
class Solid:
    """One surface of the scene, without its patches.

    Attributes
    ----------
    surface : int
        Number of the surface in the scene.
    quads : tuple of Quad
        Its flat faces, which face outward; empty for a shape that is not made of flat rectangles only. A panel has
        two, back to back.
    vertices : (v, 3) array [m]
    faces : (f, 3) array of int
        Vertices of each triangle, counter-clockwise seen from outside.
    """

    surface: int
    quads: tuple[Quad, ...]
    vertices: Array
    faces: Index


def solids(scene: Scene3D) -> list[Solid]:
    """All surfaces of a scene except its patches, as triangles in the scene's coordinates.

    Raises
    ------
    InputError
        If a mesh file cannot be used.
    """
    return [_solid(surface, i) for i, surface in enumerate(scene.surface) if not isinstance(surface, Patch)]


def _solid(surface: Surface3D, index: int) -> Solid:
    frame = surface.frame
    if isinstance(surface, Panel):
        right, up = 0.5 * surface.width * frame.linear[:, 0], 0.5 * surface.height * frame.linear[:, 2]
        # Columns of the frame are right, front and up, so that right x up points to the back: -right for the front.
        quads = tuple(Quad(frame.shift, side * right, up, index) for side in (-1.0, 1.0))
        if surface.thickness is not None:
            half = 0.5 * surface.thickness
            quads = tuple(replace(quad, center=quad.center + half * quad.normal) for quad in quads)
        corners = frame.shift + np.array([-right - up, right - up, right + up, -right + up])
        return Solid(index, quads, corners, _QUAD)
    if isinstance(surface, Box) and surface.rounding == 0.0:
        quads = tuple(_box_side(surface, frame, axis, sign, index) for axis in range(3) for sign in (-1.0, 1.0))
        corners = np.concatenate(
            [q.center + np.array([-q.right - q.up, q.right - q.up, q.right + q.up, -q.right + q.up]) for q in quads]
        )
        return Solid(index, quads, corners, np.concatenate([_QUAD + 4 * i for i in range(6)]))
    vertices, faces = _mesh(surface)
    return Solid(index, (), frame(vertices), faces)


def _box_side(box: Box, frame: Isometry, axis: int, sign: float, index: int) -> Quad:
    half = 0.5 * np.array(box.size)
    outward = sign * half[axis] * frame.linear[:, axis]
    right = half[(axis + 1) % 3] * frame.linear[:, (axis + 1) % 3]
    up = sign * half[(axis + 2) % 3] * frame.linear[:, (axis + 2) % 3]
    return Quad(frame.shift + outward, right, up, index)


def _mesh(surface: Surface3D) -> tuple[Array, Index]:
    """Vertices (v, 3) [m] and triangles (f, 3) of a curved surface in its own frame."""
    if isinstance(surface, Mannequin):
        return mannequin_mesh(surface.height, surface.arms, surface.elbows, surface.stride)
    if isinstance(surface, Mesh):
        path = check_file(surface.path, "give the path of an STL, OBJ or PLY file")
        state = path.stat()
        return _mesh_file(path, surface.scale, state.st_mtime_ns, state.st_size)
    if isinstance(surface, Box):
        return _rounded_box(surface.size, surface.rounding)

    creation = _trimesh().creation
    if isinstance(surface, Sphere):
        level = int(np.clip(np.ceil(np.log2(surface.radius / CURVE_CELL)), *BALL_DIVISIONS))
        ball = creation.icosphere(subdivisions=level, radius=surface.radius)
        return np.asarray(ball.vertices, dtype=float), np.asarray(ball.faces, dtype=np.int64)
    assert isinstance(surface, Cylinder)
    sections = max(24, int(2 * np.pi * surface.radius / CURVE_CELL))
    tube = creation.cylinder(radius=surface.radius, sections=sections, segment=np.array([surface.start, surface.end]))
    return np.asarray(tube.vertices, dtype=float), np.asarray(tube.faces, dtype=np.int64)


def _trimesh() -> Any:
    """The module trimesh, imported only when a scene needs it.

    Raises
    ------
    InputError
        If trimesh is not installed.
    """
    try:
        import trimesh
    except ImportError:
        raise InputError(NOT_INSTALLED) from None
    return trimesh


@lru_cache(maxsize=16)
def _rounded_box(size: tuple[float, float, float], rounding: float) -> tuple[Array, Index]:
    """Mesh of a box with round edges, the hull of balls at its corners: a finely divided box, moved onto that hull."""
    core = 0.5 * np.array(size) - rounding
    box = _trimesh().creation.box(extents=size).subdivide_to_size(max(CURVE_CELL, rounding))
    # A second, finer division, so that the mesh follows the round edges.
    box = box.subdivide_to_size(max(0.35 * rounding, 0.004))
    inner = np.clip(box.vertices, -core, core)
    vertices = inner + rounding * unit(box.vertices - inner)
    return np.asarray(vertices, dtype=float), np.asarray(box.faces, dtype=np.int64)


@lru_cache(maxsize=16)
def _mesh_file(path: Path, scale: float, changed: int, size: int) -> tuple[Array, Index]:
    """A closed mesh from a file, its vertices times `scale` [m].

    `changed` [ns] and `size` [bytes] are those of the file: it is read again when it has changed.

    Raises
    ------
    InputError
        If the mesh cannot be read, is open, crosses itself or is too large.
    """
    check_room(MESH_GROWTH * size, f"{path}: its triangles", "simplify the mesh, a million are plenty")
    try:
        mesh: Any = _trimesh().load(path, force="mesh")
    except Exception:  # trimesh raises whatever its many readers raise, and quotes the file, which may be any
        raise InputError(f"{path}: cannot be read as a mesh; give an STL, OBJ or PLY file") from None
    if not len(getattr(mesh, "faces", ())):
        raise InputError(f"{path}: holds no triangles; give a closed surface, not points or lines")
    mesh.merge_vertices()
    extent = float(np.max(mesh.extents)) * scale
    if extent > LARGEST_MESH:
        raise InputError(
            f"{path}: is {extent:g} m large, expected at most {LARGEST_MESH:g} m; "
            f"it is probably made in millimetres: set scale = {scale / 1000:g}"
        )
    if not mesh.is_watertight:
        raise InputError(f"{path}: is an open mesh, its edges do not all join two triangles; close its holes")
    if not mesh.is_winding_consistent or mesh.volume == 0.0:
        raise InputError(f"{path}: has triangles that face both ways; orient them all outward")
    vertices, faces = np.asarray(mesh.vertices, dtype=float) * scale, np.asarray(mesh.faces, dtype=np.int64)
    if mesh.volume < 0.0:
        faces = faces[:, ::-1]
    if crosses_itself(vertices, faces):
        raise InputError(f"{path}: is a mesh that crosses itself; unite its parts to one surface")
    return vertices, faces


def crosses_itself(vertices: Array, faces: Index) -> bool:
    """Whether an edge of a closed mesh runs through a triangle of which neither end of the edge is a corner."""
    caster = Caster(vertices, faces)
    edges = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    start, end = vertices[edges[:, 0]], vertices[edges[:, 1]]
    hit, _ = caster.first_hit(start, end - start, start_at=1e-3, end_at=1.0 - 1e-3)
    through = np.flatnonzero(hit >= 0)
    return bool(np.any(~np.any(faces[hit[through]][:, :, None] == edges[through][:, None, :], axis=(1, 2))))


def vertex_normals(vertices: Array, faces: Index) -> Array:
    """Unit normals at the vertices, (v, 3): the mean normal of the adjoining triangles, weighted by their areas."""
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.stack(
        [np.bincount(faces.ravel(), np.repeat(area[:, i], 3), minlength=len(vertices)) for i in range(3)], axis=1
    )
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
