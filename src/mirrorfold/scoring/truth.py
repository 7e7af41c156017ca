"""The truth that a reconstruction is compared with: samples of the true surfaces, and which of them can be seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.types import Array, Index, Mask


@dataclass(frozen=True)
class Truth:
    """Samples of all true surfaces of a scene, in d = 2 or 3 dimensions.

    Surfaces that are judged have `names`, by their index in the scene. A sample stands at `place` (n, d) [m], where the
    surface of the index `owner` (n,) has the unit normal `normals` (n, d). The radar sees `direct` (n,) ones directly,
    and `reachable` (n,) ones directly or by way of mirrors. A sample stands for a length or area `size` [m] or [m^2],
    and the surface is taken to go on from it along its tangent up to `reach` [m], half way to the next one or more.
    """

    names: dict[int, str]
    place: Array
    normals: Array
    owner: Index
    direct: Mask
    reachable: Mask
    size: float
    reach: float

    @property
    def hidden(self) -> list[int]:
        """Indices of the surfaces of which nothing is in line of sight."""
        in_sight = set(self.owner[self.direct].tolist())
        return [index for index in self.names if index not in in_sight]

    def distances(self, points: Array, of: Mask | None = None) -> tuple[Array, Index]:
        """Distance [m] of points (m, d) from the nearest surface, (m,), and the index of its nearest sample, (m,).

        Only samples in the mask `of` (n,) count, by default all; without samples, the distance is infinite. Around a
        sample, the surface is taken to be flat up to `reach`, so that the spacing of the samples does not matter.
        """
        index = np.arange(len(self.place)) if of is None else np.flatnonzero(of)
        if not len(index) or not len(points):
            return np.full(len(points), np.inf), np.zeros(len(points), dtype=np.intp)
        distance, nearest = cKDTree(self.place[index]).query(points)
        nearest = index[nearest]
        across = np.abs(np.einsum("nd,nd->n", points - self.place[nearest], self.normals[nearest]))
        aside = np.sqrt(np.maximum(distance**2 - across**2, 0.0))
        return np.hypot(across, np.maximum(aside - self.reach, 0.0)), nearest
