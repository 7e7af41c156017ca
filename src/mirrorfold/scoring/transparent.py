"""In the mirror, or through it: how often a reconstruction is right about what stands behind half-transparent walls."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from mirrorfold.common.geometry import crossing, reflect, segment_normal
from mirrorfold.common.records import Number
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.visibility import CHORD, facets

NEAR = 0.06
"""An echo is one of a thing that stands this close [m] to where it would be, twice the delay of a thick pane."""

SPACING = 0.002
"""Surfaces are sampled this densely [m]."""


class Sides(NamedTuple):
    """What a reconstruction makes of echoes behind half-transparent walls.

    Attributes
    ----------
    right : float or None
        Share of them that are taken for reflected, or for passed, as they are; of those with a probability.
    doubtful : float or None
        Share of them with a probability between 0.1 and 0.9.
    distance : float or None
        Median distance [m] of what passed from the surface that sent it.
    """

    right: Number = None
    doubtful: Number = None
    distance: Number = None


def sides(objects: xr.Dataset, scene: Scene) -> Sides:
    """The same for the points of a reconstruction; None where no wall was asked about.

    What an echo is follows from where the image shows it: near a thing, or near the mirror image of one.
    """
    walls = [surface for surface in scene.surface if getattr(surface, "thickness", None) is not None]
    if "passed" not in objects or not walls:
        return Sides()
    asked = objects.isel(point=np.isfinite(objects["passed"].values) & (objects["surface"].values == "object"))
    others = [surface.sample(SPACING)[0] for surface in scene.surface if surface not in walls]
    if not asked.sizes["point"] or not others:
        return Sides()
    things = np.concatenate(others)
    initial = np.column_stack([asked["x_initial"], asked["y_initial"]])
    radar = 0.5 * (scene.array.tx_position.mean(axis=0) + scene.array.rx_position.mean(axis=0))[:2]
    behind, images = np.zeros(len(initial), dtype=bool), []
    for start, end in np.concatenate([facets(wall, CHORD) for wall in walls]):
        along, place = crossing(radar, initial, start, end)
        behind |= (along < 1.0) & (place >= 0.0) & (place <= 1.0)
        images.append(reflect(things, start, segment_normal(start, end)))
    shown = cKDTree(np.concatenate(images)).query(initial)[0]
    there = cKDTree(things).query(initial)[0]
    known = behind & (np.minimum(shown, there) < NEAR)
    if not known.any():
        return Sides()
    passed, truth = asked["passed"].values[known], (there < shown)[known]
    through = known & (there < shown) & (asked["wall"].values != "")
    place = np.column_stack([asked["x"], asked["y"]])[through]
    return Sides(
        right=float(np.mean((passed > 0.5) == truth)),
        doubtful=float(np.mean((passed > 0.1) & (passed < 0.9))),
        distance=float(np.median(cKDTree(things).query(place)[0])) if through.any() else None,
    )
