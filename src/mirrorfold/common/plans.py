"""A floor plan that somebody has drawn: lines in metres, from a CAD program or a survey."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mirrorfold.common.types import Array


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """Walls where they stand, in the radar's coordinates: x to the right, y where it looks.

    Attributes
    ----------
    lines : tuple of (n, 2) arrays [m]
        Polylines, each of at least two points; a closed one ends where it begins.
    images : (mirrors, 2, 2) array [m], optional
        Ends of the mirrors where they appear in the unfolded image, in files that mirrorfold has written.
    source : str
        Names the file in messages.
    """

    lines: tuple[Array, ...]
    images: Array | None = None
    source: str = "plan"
    walls: Array = field(init=False, repr=False)
    """The straight pieces of all lines, (pieces, 2, 2) [m]."""

    def __post_init__(self) -> None:
        pieces = [np.stack([line[:-1], line[1:]], axis=1) for line in self.lines]
        walls = np.concatenate([np.empty((0, 2, 2)), *pieces])
        object.__setattr__(self, "walls", walls[np.linalg.norm(walls[:, 1] - walls[:, 0], axis=1) > 0.0])
