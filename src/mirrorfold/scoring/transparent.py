"""How often a reconstruction decides rightly whether echoes behind half-transparent walls were reflected or passed.

An echo that the image shows behind such a wall is the mirror image of an object before the wall, or an object behind
the wall, seen through it. The truth is known where the echo lies near one of both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from mirrorfold.common.geometry import crossing, reflect, segment_normal
from mirrorfold.common.types import Array, Mask, Names
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.materials import permittivity
from mirrorfold.scenes.visibility import CHORD, facets
from mirrorfold.scoring.floor_plans import TRUTH_SPACING
from mirrorfold.tree.half_transparent.doubts import doubtful

if TYPE_CHECKING:
    from mirrorfold.scenes.solids import Scene3D

NEAR = 0.06
"""An echo is that of an object, or of a mirror image of one, if that is within this distance [m] of the echo: twice the
delay of a thick pane. The delay belongs to the wall, whatever the radar. Echoes of a radar whose resolution cell is
larger stray by more; those that do are not judged."""

NEEDED = {"x_initial", "y_initial", "surface", "chain"}
"""Columns of points that are needed; reconstructions by other methods may lack them."""


class EchoesBehind(NamedTuple):
    """Echoes of a reconstruction behind half-transparent walls for which the truth is known, (n,) each.

    The image shows them at `initial` (n, d) [m], `passed` is the probability that they passed, NaN where that was not
    tested, and `incidence` [rad] the angle at which their line of sight meets the wall. The reconstruction has `taken`
    some for passed: their chain is empty, so they are not folded; in `truth`, others may have passed. Distances from
    the nearest object are `before` for the echo in the image, and `after` for its place in the reconstruction [m].
    """

    initial: Array
    passed: Array
    taken: Mask
    truth: Mask
    incidence: Array
    before: Array
    after: Array

    def take(self, which: Mask) -> EchoesBehind:
        """Some of the echoes, by mask."""
        return EchoesBehind._make(each[which] for each in self)


class WallImages(NamedTuple):
    """What half-transparent walls of a scene show, in d dimensions.

    These are samples of all other surfaces, `objects` (n, d) [m], and their mirror `images` (m, d) [m] in the walls.
    Given places are `met` (p,) if they lie behind a wall, seen from the radar; `incidence` (p,) [rad] is the angle
    at which their lines of sight meet it.
    """

    objects: Array
    images: Array
    met: Mask
    incidence: Array


def panes(scene: Scene | Scene3D) -> dict[str, tuple[float, float]]:
    """Permittivity (real part, middle of the band) and thickness [m] of each half-transparent wall, by its name."""
    middle = scene.band.middle
    walls = [(surface, getattr(surface, "thickness", None)) for surface in scene.surface]
    return {
        wall.name: (float(permittivity(wall.material, middle).real), thickness)
        for wall, thickness in walls
        if thickness is not None
    }


def walls_of_plan(scene: Scene, places: Array) -> WallImages | None:
    """What the half-transparent walls of a floor plan show, and which places (p, 2) [m] lie behind them.

    None if there is no such wall, or no other surface.
    """
    walls = [surface for surface in scene.surface if getattr(surface, "thickness", None) is not None]
    others = [surface.sample(TRUTH_SPACING)[0] for surface in scene.surface if surface not in walls]
    if not walls or not others:
        return None
    objects = np.concatenate(others)
    radar = scene.array.middle[:2]
    met, incidence, images = np.zeros(len(places), dtype=bool), np.full(len(places), np.nan), []
    sight = (places - radar) / np.linalg.norm(places - radar, axis=1)[:, None]
    for start, end in np.concatenate([facets(wall, CHORD) for wall in walls]):
        along, place = crossing(radar, places, start, end)
        here, normal = (along < 1.0) & (place >= 0.0) & (place <= 1.0), segment_normal(start, end)
        incidence[here] = np.arccos(np.clip(np.abs(sight[here] @ normal), 0.0, 1.0))
        met |= here
        images.append(reflect(objects, start, normal))
    return WallImages(objects, np.concatenate(images), met, incidence)


def behind(objects: xr.Dataset, scene: Scene | Scene3D) -> EchoesBehind | None:
    """Echoes behind half-transparent walls, with the truth: reflected by the wall, or passed through it.

    An echo was reflected if the image shows it nearer to the mirror image of an object, and passed if it is nearer to
    an object. Echoes that several mirrors show are left out, see `_shown_by_several`. None if there is no
    half-transparent wall, or no echo behind it near either, or if the points do not say where the image shows them.
    """
    axes = "xy" if isinstance(scene, Scene) else "xyz"
    if not set(objects.variables) >= NEEDED | {f"{axis}_initial" for axis in axes}:
        return None
    own = objects["surface"].values == "object"
    initial, place = (np.column_stack([objects[f"{axis}{which}"] for axis in axes])[own] for which in ("_initial", ""))
    if isinstance(scene, Scene):
        walls = walls_of_plan(scene, initial)
    else:
        from mirrorfold.scoring.volumes import walls_of_space

        walls = walls_of_space(scene, initial)
    if walls is None:
        return None
    tree = cKDTree(walls.objects)
    # Distances beyond `NEAR` are infinite: to look for them would take long, and they say nothing.
    shown, there = (known.query(initial, distance_upper_bound=NEAR)[0] for known in (cKDTree(walls.images), tree))
    known = walls.met & (np.minimum(shown, there) < NEAR)
    known &= ~_shown_by_several(objects["chain"].values[own].astype(str), place, there, scene)
    if not known.any():
        return None
    asked = objects["passed"].values[own] if "passed" in objects else np.full(len(initial), np.nan)
    through = objects["chain"].values[own] == ""
    after = tree.query(place)[0]
    return EchoesBehind(initial, asked, through, there < shown, walls.incidence, there, after).take(known)


def _shown_by_several(chain: Names, place: Array, there: Array, scene: Scene | Scene3D) -> Mask:
    """Which echoes of a floor plan two or more mirrors show, although the image shows them near an object, (n,).

    By its chain, such an echo lands at a `place` (n, d) [m] nearer to a surface, which may be the wall itself, than it
    is to the object in the image: `there` (n,) [m].
    """
    several = np.char.count(chain, "/") > 0
    if isinstance(scene, Scene) and several.any():
        surfaces = np.concatenate([surface.sample(TRUTH_SPACING)[0] for surface in scene.surface])
        several[several] = cKDTree(surfaces).query(place[several])[0] < there[several]
        return np.asarray(several)
    return np.zeros_like(several)


def side_shares(objects: xr.Dataset, scene: Scene | Scene3D) -> dict[str, Any]:
    """How often a reconstruction decides rightly between passed and reflected, as the facts of `SidesRight`; empty if
    it tested no echo.
    """
    found = behind(objects, scene)
    if found is None or not (asked := np.isfinite(found.passed)).any():
        return {}
    passed, truth, taken, after = found.passed[asked], found.truth[asked], found.taken[asked], found.after[asked]
    through = truth & taken
    unsure = doubtful(passed)
    return {
        "sides_right": None if unsure.all() else float(np.mean((passed > 0.5)[~unsure] == truth[~unsure])),
        "sides_doubtful": float(unsure.mean()),
        "passed_m": float(np.median(after[through])) if through.any() else None,
    }
