"""A straight mirror, and the resolution cell about its line."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.geometry import cross2, reflect, segment_normal
from mirrorfold.detection.image_view import PolarImage

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Mirror:
    """A straight mirror detected in an image.

    Attributes
    ----------
    start, end : (2,) arrays [m]
        Its ends, in the coordinates of the image (a mirror seen through another is a ghost itself).
    strength : float
        Median amplitude of its echoes, normalised as in the PolarImage.
    angle_error : float [degree]
    offset_error : float [m]
        Standard errors of the fitted line's direction and of its position at the middle.
    fill : float
        Share of its length that its echoes fill.
    """

    start: Array
    end: Array
    strength: float = 1.0
    angle_error: float = 0.0
    offset_error: float = 0.0
    fill: float = 1.0

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def direction(self) -> Array:
        """Unit vector from start to end, (2,)."""
        return (self.end - self.start) / self.length

    @property
    def normal(self) -> Array:
        """Unit normal, to the left of `direction`, (2,)."""
        return np.asarray(segment_normal(self.start, self.end))

    @property
    def middle(self) -> Array:
        """Midpoint (2,) [m]."""
        return 0.5 * (self.start + self.end)

    def reflected(self, other: Mirror) -> Mirror:
        """The mirror image of this mirror in `other`."""
        return replace(
            self,
            start=reflect(self.start, other.start, other.normal),
            end=reflect(self.end, other.start, other.normal),
        )

    def along(self, points: Array) -> Array:
        """Position [m] of points (..., 2) along the mirror, from its start."""
        return np.asarray((points - self.start) @ self.direction)

    def beside(self, points: Array) -> Array:
        """Signed distance [m] of points (..., 2) from the mirror's line, positive on the side of `normal`."""
        return np.asarray((points - self.start) @ self.normal)


def line_cell(polar: PolarImage, points: Array, direction: Array) -> tuple[Array, Array]:
    """Extent of the resolution cell at points (n, 2), across and along a line of the given direction, each (n,) [m]."""
    range_, u = polar.to_polar(points)
    sight = (points - polar.radar) / range_[:, None]
    cosine = np.abs(sight @ direction)
    sine = np.abs(cross2(sight, direction))
    cross = polar.cross_cell(range_, u)
    return np.hypot(polar.range_cell * sine, cross * cosine), np.hypot(polar.range_cell * cosine, cross * sine)
