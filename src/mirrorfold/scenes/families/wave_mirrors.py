"""Families of full-wave scenes with mirrors that are not flat conductors: a half-transparent wall, a round pillar.

They are those that `glass` and `curved` draw for rays, sized to the wavelength as all scenes of full waves are, see
`waves`. A dielectric wall keeps its thickness and its permittivity, which say what it lets through.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mirrorfold.scenes.families import curved, glass
from mirrorfold.scenes.families.family import Surface
from mirrorfold.scenes.families.radars import RADARS
from mirrorfold.scenes.families.waves import Generator, family, fitting, near

FILLET, STEPS = 0.1, 24
"""Radius of a rounded corner over the length of a leg, and points around it: in TM the solver takes no sharp ones."""

PANE_OUTLINE = 1200.0
"""Length of all surfaces [wavelengths] where one of them is a dielectric wall, on which most of the unknowns lie."""

FINE = near("230 GHz", 257)
"""A pillar shows objects small: range cells of 0.75 cm tell them apart."""

SHORT = replace(
    near("122 GHz", 121),
    name="122 GHz, 10 cm, 121 frequencies",
    what="116-128 GHz, 87 antennas 1.15 mm apart (10 cm); 1.5 m unambiguous",
    array=RADARS["122 GHz"].array | {"elements": 87},
)
"""The radar of the family for rays, by which glass is half transparent, with a shorter array: the rooms are smaller."""


def rounded(surface: Surface) -> Surface:
    """A corner of two equal legs at a right angle as a curve without a sharp vertex; other surfaces as they are."""
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
