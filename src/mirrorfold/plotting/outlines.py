"""Outlines of the true solids of a scene: wireframes, sections by a plane, and silhouettes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing

from mirrorfold.common.types import Array, Index

LEVELS = (0.02, 0.5, 0.98)
"""Heights at which round solids are cut by level planes to be drawn, as shares of the solid's height."""

_AROUND = np.array(((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)))

if TYPE_CHECKING:
    from mirrorfold.scenes.solids import Scene3D

SHARES = np.array([[i, k, 6 - i - k] for i in range(7) for k in range(7 - i)]) / 6.0
"""Barycentric coordinates of points on a triangle, spaced by a sixth of an edge."""


def wireframe(scene: Scene3D) -> list[Array]:
    """The surfaces of a scene as polylines (n, 3) [m]: edges of flat faces, and sections of round solids."""
    from mirrorfold.simulation.raster.meshes import solids

    lines: list[Array] = []
    for solid in solids(scene):
        panel = len(solid.quads) == 2  # its two faces, back to back
        for quad in solid.quads[: 1 if panel else None]:
            lines.append(quad.center + _AROUND[:, :1] * quad.right + _AROUND[:, 1:] * quad.up)
        if not solid.quads:
            lines += _sections(solid.vertices, solid.faces)
    return lines


def _sections(vertices: Array, faces: Index) -> list[Array]:
    """Sections of a solid by level planes, and by two upright planes through its middle, as closed polylines [m]."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle, up = 0.5 * (low + high), np.array([0.0, 0.0, 1.0])
    planes = [(low + share * (high - low), up) for share in LEVELS] + [(middle, axis) for axis in np.eye(3)[:2]]
    return [line for point, normal in planes for line in as_polylines(cut_triangles(vertices, faces, point, normal))]


def as_polylines(segments: Array) -> list[Array]:
    """Join line segments (n, 2, d) [m] to polylines where their ends coincide to a micrometre."""
    size = segments.shape[-1]
    points, number = np.unique(np.round(segments.reshape(-1, size), 6), axis=0, return_inverse=True)
    onward: dict[int, set[int]] = {}
    for one, other in number.reshape(-1, 2).tolist():
        if one != other:
            onward.setdefault(one, set()).add(other)
            onward.setdefault(other, set()).add(one)
    lines = []
    for start in onward:
        line = [start]
        while onward[line[-1]]:
            following = onward[line[-1]].pop()
            onward[following].discard(line[-1])
            line.append(following)
        if len(line) > 1:
            lines.append(points[line])
    return lines


def cut(scene: Scene3D, point: Array, normal: Array) -> dict[str, Array]:
    """Sections of the surfaces of a scene by a plane.

    Parameters
    ----------
    scene : Scene3D
    point, normal : (3,) arrays [m]
        A point of the plane, and its normal of any length.

    Returns
    -------
    dict of (n, 2, 3) arrays [m]
        Line segments by the names of the surfaces that the plane meets.
    """
    from mirrorfold.simulation.raster.meshes import solids

    found = {}
    for solid in solids(scene):
        lines = cut_triangles(solid.vertices, solid.faces, point, normal)
        if len(lines):
            found[scene.surface[solid.surface].name] = lines
    return found


def cut_triangles(vertices: Array, faces: Index, point: Array, normal: Array) -> Array:
    """Line segments (n, 2, 3) [m] in which a plane cuts triangles; triangles that it does not cross are left out."""
    height = (vertices - point) @ np.asarray(normal, dtype=float)
    side = height[faces] > 0.0
    crossed = np.flatnonzero(side.any(axis=1) & ~side.all(axis=1))
    start, end = faces[crossed], np.roll(faces[crossed], -1, axis=1)
    met = side[crossed] != np.roll(side[crossed], -1, axis=1)  # two of the three edges
    first, last = start[met], end[met]
    share = height[first] / (height[first] - height[last])
    return np.asarray((vertices[first] + share[:, None] * (vertices[last] - vertices[first])).reshape(-1, 2, 3))


def silhouette(vertices: Array, faces: Index, right: Array, up: Array, u: Array, v: Array) -> NDArray[np.bool_]:
    """Which pixels a solid covers, seen along the axis that is perpendicular to both directions of the picture.

    Parameters
    ----------
    vertices : (n, 3) array [m]
    faces : (f, 3) array of int
        Triangles of the solid; those larger than a few pixels leave holes.
    right, up : (3,) arrays
        Unit vectors of the picture's directions u and v.
    u, v : 1D arrays [m]
        Centres of the pixels, in equal steps.

    Returns
    -------
    (v, u) bool array
    """
    flat = vertices @ np.stack([right, up], axis=1)
    return covered(np.einsum("sk,fkd->fsd", SHARES, flat[faces]).reshape(-1, 2), u, v)


def covered(points: Array, u: Array, v: Array) -> NDArray[np.bool_]:
    """Which pixels (v, u) hold any of the points (n, 2) [m]; gaps of a pixel between them are closed."""
    column = np.rint((points[:, 0] - u[0]) / (u[1] - u[0])).astype(np.intp)
    row = np.rint((points[:, 1] - v[0]) / (v[1] - v[0])).astype(np.intp)
    inside = (column >= 0) & (column < u.size) & (row >= 0) & (row < v.size)
    mask = np.zeros((v.size, u.size), dtype=bool)
    mask[row[inside], column[inside]] = True
    return np.asarray(binary_closing(np.pad(mask, 2), np.ones((3, 3)))[2:-2, 2:-2])
