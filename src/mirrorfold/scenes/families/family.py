"""What a family of random scenes is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from mirrorfold.scenes.families.radars import Radar

Surface = dict[str, Any]
"""A surface as a scene file states it: ``{"name": ..., "kind": ..., ...}``."""


@dataclass(frozen=True, kw_only=True)
class Family:
    """A family of random scenes: what is in them, and how their sweeps are simulated.

    Attributes
    ----------
    name : str
    what : str
        One line: what the scenes hold, and the ranges that they are drawn from.
    engine : {"rays", "fullwave", "raster"}
        What simulates the sweep: rays or the integral equation in a floor plan, or a raster scan of a scene in space.
    make : callable
        Called as ``make(random, radar)`` with a `numpy.random.Generator` and a `Radar`; returns the surfaces of one
        scene. A surface whose name begins with corner, arc, disc or target is meant to be hidden from the radar. Each
        function draws numbers of its own: its name is a part of the seed.
    bounces : int, default 1
        By how many mirrors, at most, the hidden surfaces must be reachable.
    snr_db : float [dB], optional
        Signal over noise per sample; no noise by default.
    radar : str or Radar, optional
        The radar that alone sees the family, one of `RADARS` by its name or another; any of them by default.
    curved : bool, default False
        Whether the hidden surfaces must be out of reach of flat mirrors, so that only a curved one shows them.
    polarization : {"TE", "TM", "both"}, default "TE"
        Of the radar, in a floor plan.
    options : dict
        Further options of `mirrorfold.simulate`.
    """

    name: str
    what: str
    engine: Literal["rays", "fullwave", "raster"]
    make: Callable[[np.random.Generator, Radar], list[Surface]]
    bounces: int = 1
    snr_db: float | None = None
    radar: str | Radar | None = None
    curved: bool = False
    polarization: Literal["TE", "TM", "both"] = "TE"
    options: dict[str, Any] = field(default_factory=dict)
