"""Rays against triangles, by Intel's Embree library."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array, Index
from mirrorfold.errors import InputError

BATCH = 1 << 17
"""Number of rays that are cast at a time: their single-precision copies then fit the cache."""

NOT_INSTALLED = (
    "three-dimensional scenes need the packages trimesh, embreex and scikit-image; install 'mirrorfold[mesh]'"
)


class Caster:
    """Casts rays at triangles.

    Parameters
    ----------
    vertices : (v, 3) array [m]
    faces : (f, 3) array of int

    Raises
    ------
    InputError
        If the ray caster is not installed.
    """

    def __init__(self, vertices: Array, faces: Index) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError:
            raise InputError(NOT_INSTALLED) from None
        self._empty = not len(faces)
        if self._empty:
            return
        self._scene = EmbreeScene(robust=True)
        # Single precision rounds places some metres away to tenths of a micrometre, far below `SLACK` of `chains`.
        self._mesh = TriangleMesh(self._scene, vertices[faces].astype(np.float32))

    def first_hit(
        self, origin: Array, direction: Array, *, start_at: float = 0.0, end_at: float = np.inf
    ) -> tuple[Index, Array]:
        """The first triangle that each ray meets.

        Parameters
        ----------
        origin, direction : (n, 3) arrays [m]
        start_at, end_at : float
            Begin and end of the part of each ray that is followed, in units of the length of its direction.

        Returns
        -------
        face : (n,) array of int
            Number of the triangle; -1 where a ray meets nothing.
        along : (n,) array
            Distance of the meeting point from the origin, in units of the length of the direction; infinite where a ray
            meets nothing.
        """
        face, along = np.full(len(origin), -1, dtype=np.int64), np.full(len(origin), np.inf)
        if self._empty:
            return face, along
        for first in range(0, len(origin), BATCH):
            part = slice(first, first + BATCH)
            begin = (origin[part] + start_at * direction[part]).astype(np.float32)
            vector = direction[part].astype(np.float32)
            reach = np.full(len(begin), min(end_at - start_at, 1e6), dtype=np.float32)
            found = self._scene.run(begin, vector, reach, query="INTERSECT", output=True)
            met = found["primID"] >= 0
            face[part] = np.where(met, found["primID"], -1)
            along[part] = np.where(met, found["tfar"] + start_at, np.inf)
        return face, along

    def blocked(self, origin: Array, target: Array, *, slack: float) -> NDArray[np.bool_]:
        """Whether a triangle lies between each origin and its target, (n, 3) [m], more than `slack` [m] from both."""
        result = np.zeros(len(origin), dtype=bool)
        if self._empty:
            return result
        for first in range(0, len(origin), BATCH):
            part = slice(first, first + BATCH)
            span = target[part] - origin[part]
            length = np.linalg.norm(span, axis=1)
            vector = span / np.maximum(length, 1e-12)[:, None]
            reach = length - 2.0 * slack
            begin = (origin[part] + slack * vector).astype(np.float32)
            found = self._scene.run(begin, vector.astype(np.float32), reach.astype(np.float32), query="OCCLUDED")
            result[part] = (found >= 0) & (reach > 0.0) if found.dtype.kind == "i" else found & (reach > 0.0)
        return result
