"""The declaration of a family of random scenes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np

from mirrorfold.common.arguments import boolean, number, one_of, whole_number, wrong_kind
from mirrorfold.errors import InputError
from mirrorfold.scenes.families.radars import Radar

Engine = Literal["rays", "fullwave", "raster"]

OWN = "solver", "seed", "snr_db"
"""Options of `mirrorfold.simulate` that a benchmark sets by itself: other values would be those of every scene."""

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
        Further options of `mirrorfold.simulate`, not solver, seed and snr_db.
    """

    name: str
    what: str
    engine: Engine
    make: Callable[[np.random.Generator, Radar], list[Surface]]
    bounces: int = 1
    snr_db: float | None = None
    radar: str | Radar | None = None
    curved: bool = False
    polarization: Literal["TE", "TM", "both"] = "TE"
    options: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what would fail scene by scene, or be taken for something else."""
        if not isinstance(self.name, str) or not self.name:
            raise wrong_kind("family: name", self.name, "a text that is not empty", reader="")
        one_of(f"family {self.name!r}: engine", self.engine, get_args(Engine))
        whole_number(f"family {self.name!r}: bounces", self.bounces, lowest=0)
        if not callable(self.make):
            raise wrong_kind(f"family {self.name!r}: make", self.make, "a function make(random, radar)", reader="")
        if self.snr_db is not None:
            number(f"family {self.name!r}: snr_db", self.snr_db, "dB")
        if not isinstance(self.radar, str | Radar | None):
            raise wrong_kind(f"family {self.name!r}: radar", self.radar, "the name of a radar, or a Radar", reader="")
        boolean(f"family {self.name!r}: curved", self.curved)
        one_of(f"family {self.name!r}: polarization", self.polarization, ("TE", "TM", "both"))
        if not isinstance(self.options, dict):
            raise wrong_kind(f"family {self.name!r}: options", self.options, "a dict of options of simulate", reader="")
        if own := [name for name in OWN if name in self.options]:
            raise InputError(
                f"family {self.name!r}: options hold {', '.join(own)}, which a benchmark sets from the engine, the "
                "scene's seed and the snr_db of the family; leave them out"
            )
