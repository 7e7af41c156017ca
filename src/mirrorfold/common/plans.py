"""A floor plan drawn by hand: lines in metres, from a CAD program or a survey."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field

import numpy as np

from mirrorfold.common.smooth_lines import straight_and_curved
from mirrorfold.common.types import Array

FAR = 30.0
"""Walls that reach farther beyond a picture than this multiple of its size do not belong to its scene."""


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """Walls at their true places, in the coordinates of the radar: x to the right, y in the direction of view.

    Attributes
    ----------
    lines : tuple of (n, 2) arrays [m]
        Polylines, each of at least two points; a closed one ends where it begins.
    images : (mirrors, 2, 2) or (mirrors, 3, 2) array [m], optional
        The mirrors as the unfolded image shows them, in files that mirrorfold has written: the ends of lines, or three
        points of arcs.
    source : str
        Name of the file, for messages.
    """

    lines: tuple[Array, ...]
    images: Array | None = None
    source: str = "plan"
    walls: Array = field(init=False, repr=False)
    """The straight pieces of all lines, (pieces, 2, 2) [m]."""
    curves: Array = field(init=False, repr=False)
    """The arcs among the lines, three points each, (arcs, 3, 2) [m]."""

    def __post_init__(self) -> None:
        parts = [straight_and_curved(line) for line in self.lines]
        object.__setattr__(self, "walls", np.concatenate([np.empty((0, 2, 2)), *(straight for straight, _ in parts)]))
        object.__setattr__(self, "curves", np.concatenate([np.empty((0, 3, 2)), *(arcs for _, arcs in parts)]))

    @property
    def count(self) -> int:
        """Number of straight pieces and arcs."""
        return len(self.walls) + len(self.curves)

    def lies_beyond(self, low: Array, high: Array) -> bool:
        """Whether every wall reaches far beyond the picture from `low` to `high` (x, y) [m]; gives a warning if so."""
        farther = [
            float(np.linalg.norm(np.maximum(np.maximum(low - wall, wall - high), 0.0), axis=-1).max())
            for wall in (*self.walls, *self.curves)
        ]
        beyond = min(farther, default=np.inf) > FAR * float(np.max(high - low))
        if beyond:
            warnings.warn(
                f"{self.source}: all walls reach far beyond what is shown; a plan is in metres, unless a DXF file says "
                "another unit by $INSUNITS: are its numbers millimetres?",
                stacklevel=2,
            )
        return beyond
