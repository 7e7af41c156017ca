"""Families of full-wave scenes with mirrors that are not flat conductors: a half-transparent wall, a round pillar.

The scenes are drawn by `glass` and `curved`, which also draw those for rays, and scaled to the wavelength like all
full-wave scenes, see `waves`. A dielectric wall is not scaled in thickness, as its thickness and permittivity determine
what it transmits.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mirrorfold.scenes.families import curved, glass
from mirrorfold.scenes.families.family import Surface
from mirrorfold.scenes.families.radars import RADARS
from mirrorfold.scenes.families.waves import Generator, family, fitting, near

FILLET, STEPS = 0.1, 24
"""Radius of a rounded corner over the length of its legs, and number of steps around it. Corners are rounded as in TM
the solver takes no sharp vertices."""

PANE_OUTLINE = 1200.0
"""Total length of all surfaces [wavelengths] if one of them is a dielectric wall, which has most of the unknowns."""

FINE = near("230 GHz", 257)
"""Radar for the pillar: objects appear small in a pillar, and its range resolution of 0.75 cm separates them."""

SHORT = replace(
    near("122 GHz", 121),
    name="122 GHz, 10 cm, 121 frequencies",
    what="116-128 GHz, 87 antennas 1.15 mm apart (10 cm); 1.5 m unambiguous",
    array=RADARS["122 GHz"].array | {"elements": 87},
)
"""Radar for the pane: that of the ray family, at whose frequencies glass is half transparent, with a shorter array, as
the rooms are smaller."""


def rounded(surface: Surface) -> Surface:
    """A right-angled corner of two equal legs as a smooth curve without a sharp vertex; other surfaces unchanged."""
    if surface["kind"] != "polyline":
        return surface
    first, vertex, last = np.array(surface["points"])
    legs = first - vertex, last - vertex
    radius = FILLET * np.linalg.norm(legs[0])
    away, along = (leg / np.linalg.norm(leg) for leg in legs)
    center = vertex + radius * (away + along)
    turn = np.linspace(0.0, 0.5 * np.pi, STEPS + 1)[:, None]
    bow = center - radius * (np.cos(turn) * along + np.sin(turn) * away)
    steps = np.linspace(0.0, 1.0, STEPS, endpoint=False)[:, None]
    points = np.concatenate([first + steps * (bow[0] - first), bow, last + steps[::-1] * (bow[-1] - last)])
    return {name: value for name, value in surface.items() if name != "points"} | {
        "kind": "curve",
        "points": points.tolist(),
    }


@fitting(only_curved=True)
def wave_pillar(random: Generator) -> list[Surface]:
    """A screen hides one or two of a corner, an arc and a disc; a round pillar shows them, and no flat mirror does."""
    return curved.pillar(random, FINE)


@fitting(outline=PANE_OUTLINE)
def wave_glass_door(random: Generator) -> list[Surface]:
    """A pane or board of 4-10 mm at 22-66 degrees shows a hidden object, and another one stands behind it."""
    drawn = glass.half_transparent(random, distance=(0.8, 1.0), length=(0.55, 0.75), depth=(0.35, 0.8), most=1)
    return [rounded(surface) for surface in drawn]


FAMILIES = (
    family("pillar", wave_pillar, FINE),
    family("glass door", wave_glass_door, SHORT, polarization="both"),
)
