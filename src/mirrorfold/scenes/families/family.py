"""The declaration of a family of random scenes."""

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
        One line: what the scenes contain, and the ranges from which they are drawn.
    engine : {"rays", "fullwave", "raster"}
        How the sweep is simulated: rays or integral equations in a floor plan, or a raster scan of a scene in space.
    make : callable
        Called as ``make(random, radar)`` with a `numpy.random.Generator` and a `Radar`; returns the surfaces of one
        scene. A surface whose name begins with corner, arc, disc or target must be hidden from the radar. The name of
        the function is part of the seed, so that every function draws other random numbers.
    bounces : int, default 1
        Largest number of mirrors by way of which the hidden surfaces must be reachable.
    snr_db : float [dB], optional
        Signal-to-noise ratio per sample; no noise by default.
    radar : str or Radar, optional
        The only radar for the scenes of the family: the name of one of `RADARS`, or another radar. By default any of
        them.
    curved : bool, default False
        Whether flat mirrors must not show the hidden surfaces, so that only a curved mirror does.
    polarization : {"TE", "TM", "both"}, default "TE"
        Polarization of the radar.
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
