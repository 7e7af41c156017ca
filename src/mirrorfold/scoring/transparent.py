"""In the mirror, or through it: how often a reconstruction is right about what stands behind half-transparent walls."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from mirrorfold.common.geometry import crossing, reflect, segment_normal
from mirrorfold.common.records import Number
from mirrorfold.common.types import Array, Mask
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.materials import permittivity
from mirrorfold.scenes.visibility import CHORD, facets

if TYPE_CHECKING:
    from mirrorfold.scenes.solids import Scene3D

NEAR = 0.06
"""An echo is taken for that of an object, or of its mirror image, that is this close [m] to where the echo is shown:
twice what a thick pane delays it."""

SPACING = 0.002
"""Surfaces are sampled this densely [m]."""

NEEDED = {"x_initial", "y_initial", "surface", "chain"}
"""Columns of points without which nothing can be said; other methods' reconstructions may lack them."""


class Sides(NamedTuple):
    """What a reconstruction makes of echoes behind half-transparent walls.

    Attributes
    ----------
    right : float or None
        Of the echoes that are not doubtful, the share that is rightly taken for reflected, or for passed.
    doubtful : float or None
        Share of the echoes whose probability to have passed lies between 0.1 and 0.9.
    distance : float or None
        Median distance [m] of echoes that passed, and were taken for such, from the nearest object.
    """

    right: Number = None
    doubtful: Number = None
    distance: Number = None


class Behind(NamedTuple):
    """Echoes of a reconstruction behind half-transparent walls of which it is known what they are, (n,) each.

    Attributes
    ----------
    initial : (n, d) array [m]
        Where the image shows them.
    passed : array
        Probability that they passed; NaN where that was not asked.
    taken : bool array
        Which are taken for passed ones: they stay where the image shows them, but for the delay in the wall.
    truth : bool array
        Which did pass.
    incidence : array [rad]
        Angle at which their line of sight meets the wall.
    before, after : arrays [m]
        Distance from the nearest object in the image, and where they were put.
    """

    initial: Array
    passed: Array
    taken: Mask
    truth: Mask
    incidence: Array
    before: Array
    after: Array

    def take(self, which: Mask) -> Behind:
        """Some of them."""
        return Behind._make(each[which] for each in self)


class Walls(NamedTuple):
    """Half-transparent walls of a scene, and what else stands in it, in d dimensions.

    Attributes
    ----------
    objects : (n, d) array [m]
        Samples of all other surfaces.
    images : (m, d) array [m]
        Of these in the walls.
    met : (p,) bool array
        Which places are seen through walls ...
    incidence : (p,) array [rad]
        ... and under which angles.
    """

    objects: Array
    images: Array
    met: Mask
    incidence: Array


def panes(scene: Scene | Scene3D) -> dict[str, tuple[float, float]]:
    """Permittivity, in the middle of the band, and thickness [m] of each half-transparent wall, by its name."""
    middle = 0.5 * (scene.band.start + scene.band.stop)
    walls = [(surface, getattr(surface, "thickness", None)) for surface in scene.surface]
    return {
        wall.name: (float(permittivity(wall.material, middle).real), thickness)
        for wall, thickness in walls
        if thickness is not None
    }


def walls_of_plan(scene: Scene, places: Array) -> Walls | None:
    """The half-transparent walls of a floor plan, and which places (p, 2) [m] are seen through them.

    None where there is no such wall, or nothing else.
    """
    walls = [surface for surface in scene.surface if getattr(surface, "thickness", None) is not None]
    others = [surface.sample(SPACING)[0] for surface in scene.surface if surface not in walls]
    if not walls or not others:
        return None
    objects = np.concatenate(others)
    radar = 0.5 * (scene.array.tx_position.mean(axis=0) + scene.array.rx_position.mean(axis=0))[:2]
    met, incidence, images = np.zeros(len(places), dtype=bool), np.full(len(places), np.nan), []
    sight = (places - radar) / np.linalg.norm(places - radar, axis=1)[:, None]
    for start, end in np.concatenate([facets(wall, CHORD) for wall in walls]):
        along, place = crossing(radar, places, start, end)
        here, normal = (along < 1.0) & (place >= 0.0) & (place <= 1.0), segment_normal(start, end)
        incidence[here] = np.arccos(np.clip(np.abs(sight[here] @ normal), 0.0, 1.0))
        met |= here
        images.append(reflect(objects, start, normal))
    return Walls(objects, np.concatenate(images), met, incidence)


def behind(objects: xr.Dataset, scene: Scene | Scene3D) -> Behind | None:
    """What the echoes behind half-transparent walls truly are: reflected by the wall, or passed through it.

    That follows from where the image shows them: near the mirror image of an object, or near one. None where there is
    no half-transparent wall, or nothing behind it, or the points do not say where the image shows them.
    """
    axes = "xy" if isinstance(scene, Scene) else "xyz"
    if not set(objects.variables) >= NEEDED | {f"{axis}_initial" for axis in axes}:
        return None
    own = objects["surface"].values == "object"
    if not own.any():
        return None
    initial, place = (np.column_stack([objects[f"{axis}{which}"] for axis in axes])[own] for which in ("_initial", ""))
    if isinstance(scene, Scene):
        walls = walls_of_plan(scene, initial)
    else:
        from mirrorfold.scoring.volumes import walls_of_space

        walls = walls_of_space(scene, initial)
    if walls is None:
        return None
    tree = cKDTree(walls.objects)
    shown, there = cKDTree(walls.images).query(initial)[0], tree.query(initial)[0]
    known = walls.met & (np.minimum(shown, there) < NEAR)
    if not known.any():
        return None
    asked = objects["passed"].values[own] if "passed" in objects else np.full(len(initial), np.nan)
    through = objects["chain"].values[own] == ""
    after = tree.query(place)[0]
    return Behind(initial, asked, through, there < shown, walls.incidence, there, after).take(known)


def doubted(passed: Array) -> Mask:
    """Which echoes are left open by their probability to have passed, (n,)."""
    return np.asarray((passed > 0.1) & (passed < 0.9))


def sides(objects: xr.Dataset, scene: Scene | Scene3D) -> Sides:
    """How often a reconstruction tells passed echoes from reflected ones; all None where no wall was asked about."""
    found = behind(objects, scene)
    if found is None or not (asked := np.isfinite(found.passed)).any():
        return Sides()
    passed, truth, taken, after = found.passed[asked], found.truth[asked], found.taken[asked], found.after[asked]
    through = truth & taken
    doubtful = doubted(passed)
    return Sides(
        right=None if doubtful.all() else float(np.mean((passed > 0.5)[~doubtful] == truth[~doubtful])),
        doubtful=float(doubtful.mean()),
        distance=float(np.median(after[through])) if through.any() else None,
    )
