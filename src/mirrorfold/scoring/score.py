"""How close a reconstruction comes to the truth, in two dimensions and in three.

Only those pieces of the truth count that the radar could have seen, directly or by way of mirrors. `floor_plans` and
`volumes` find out which pieces these are.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, overload

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from mirrorfold.common.arguments import whole_number, wrong_kind
from mirrorfold.common.plausible import unplaced
from mirrorfold.common.records import LEFT_OUT, Number, Record, fact
from mirrorfold.common.types import Array, Mask
from mirrorfold.errors import InputError
from mirrorfold.folding.confident import confident_points
from mirrorfold.folding.earlier import check_groups
from mirrorfold.folding.frames import pick_frame
from mirrorfold.scenes.floor_plan import Scene, as_scene
from mirrorfold.scenes.visibility import BOUNCES, MOST_BOUNCES
from mirrorfold.scoring import floor_plans
from mirrorfold.scoring.cells import point_cells
from mirrorfold.scoring.figures import WIDE, WITHIN_CELLS, Figures, figures, thinned
from mirrorfold.scoring.mirrors import MirrorError, mirror_errors
from mirrorfold.scoring.transparent import panes, side_shares
from mirrorfold.scoring.truth import Truth

if TYPE_CHECKING:
    from mirrorfold.scenes.solids import Scene3D


class Mirrors(Record):
    """Errors of detected mirrors."""

    mirrors: list[MirrorError]


class PlanFigures(Figures):
    """How close points come to the truth in two dimensions."""

    reachable_m: float = fact("length of the truth that can be seen")


class VolumeFigures(Figures):
    """How close points come to the truth in three dimensions."""

    reachable_m2: float = fact("area of the truth that can be seen")


class HiddenPlan(PlanFigures, Mirrors):
    """Points and mirrors out of line of sight, in two dimensions."""

    surfaces: list[str]


class HiddenVolume(VolumeFigures, Mirrors):
    """Points and mirrors out of line of sight, in three dimensions."""

    surfaces: list[str]


class Contrast(Record):
    """How much brighter a patch is than its surroundings."""

    contrast_db: Number = fact("[dB]")


class SidesRight(Record):
    """How often a result decides rightly whether echoes behind half-transparent walls were reflected or passed."""

    sides_right: Number = fact(
        "share of the echoes behind half-transparent walls, but the doubtful, that are rightly taken for reflected, or "
        "passed",
        default=LEFT_OUT,
    )
    sides_doubtful: Number = fact(
        "share of these echoes whose probability to have passed is between 0.1 and 0.9", default=LEFT_OUT
    )
    passed_m: Number = fact("median distance from the truth of what passed through them", default=LEFT_OUT)


class PlanScore(PlanFigures, Mirrors, SidesRight):
    """A score in two dimensions."""

    hidden: HiddenPlan
    surfaces: dict[str, PlanFigures] = fact("each hidden surface by itself")
    files: list[str] = fact("what was written", default=LEFT_OUT)


class VolumeScore(VolumeFigures, Mirrors, SidesRight):
    """A score in three dimensions."""

    hidden: HiddenVolume
    surfaces: dict[str, VolumeFigures] = fact("each hidden surface by itself")
    patches: dict[str, Contrast]
    files: list[str] = fact("what was written", default=LEFT_OUT)


@overload
def score(
    reconstruction: xr.DataTree, scene: Scene, *, bounces: int = BOUNCES, min_confidence: float | None = None
) -> PlanScore: ...
@overload
def score(
    reconstruction: xr.DataTree, scene: Scene3D, *, bounces: int = BOUNCES, min_confidence: float | None = None
) -> VolumeScore: ...
@overload
def score(
    reconstruction: xr.DataTree,
    scene: Scene | Scene3D | str | Path,
    *,
    bounces: int = BOUNCES,
    min_confidence: float | None = None,
) -> PlanScore | VolumeScore: ...


def score(
    reconstruction: xr.DataTree,
    scene: Scene | Scene3D | str | Path,
    *,
    bounces: int = BOUNCES,
    min_confidence: float | None = None,
) -> PlanScore | VolumeScore:
    """Distances between a reconstruction and the true scene.

    Points are first thinned: all points in one cell of a square or cubic grid of one centimetre are replaced by their
    mean, so that the density of the image's pixels does not matter. Scores are made for rooms. Completeness means
    little where resolution cells are smaller than a centimetre, or mirrors are shorter than 15 cm, which count as
    showing nothing.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    scene : Scene, Scene3D or path of a scene file
    bounces : int
        Largest number of reflections on the way to a piece of truth that counts as reachable.
    min_confidence : float, optional
        Points of less confidence do not count; by default the setting of the fold.

    Returns
    -------
    PlanScore or VolumeScore
        Facts to read as attributes or as items. They are those of all points; under `hidden`, of points and surfaces
        out of line of sight: all points that are more than 5 cm and 1.5 resolution cells away from whatever is in line
        of sight, invented ones included, against the surfaces of which nothing is in line of sight; under `surfaces`,
        of each such surface; under `mirrors`, the errors of every detected mirror at its true place. Undefined facts,
        such as the accuracy of no points, are None. `mirrorfold schema score` says what each fact is.

    Raises
    ------
    InputError
        If the first argument is not a reconstruction, or has not the dimensions of the scene.
    """
    if not isinstance(reconstruction, xr.DataTree):
        raise wrong_kind("score", reconstruction, "a reconstruction (xarray.DataTree), as fold and reconstruct return")
    check_groups(reconstruction, "objects", "mirrors")
    bounces = whole_number("bounces", bounces, highest=MOST_BOUNCES)
    reconstruction = pick_frame(reconstruction)
    scene = as_scene(scene)
    objects = confident_points(reconstruction, min_confidence)
    flat = "z" not in objects.variables
    if flat != isinstance(scene, Scene):
        held, given = (2, 3) if flat else (3, 2)
        raise InputError(f"reconstruction: has {held} dimensions and the scene {given}; score it against its own scene")
    points = np.stack([objects[axis].values for axis in ("xy" if flat else "xyz")], axis=-1)
    if (wrong := unplaced(points)) is not None:
        raise InputError(f"reconstruction: holds a point that {wrong}; fold again")
    cells = point_cells(objects, reconstruction.attrs), point_cells(objects, reconstruction.attrs, grown=False)
    sides = side_shares(objects, scene)
    if isinstance(scene, Scene):
        mirrors = mirror_errors(reconstruction, floor_plans.faces(scene), floor_plans.curves(scene), panes(scene))
        truth = floor_plans.truth(scene, bounces=bounces)
        every, hidden, each = _judge(points, cells, truth, PlanFigures, "reachable_m")
        behind = HiddenPlan(mirrors=_deep(mirrors), **hidden, surfaces=list(each))
        return PlanScore(mirrors=mirrors, **every, hidden=behind, surfaces=each, **sides)
    from mirrorfold.scoring import volumes

    mirrors = mirror_errors(reconstruction, volumes.faces(scene), panes=panes(scene))
    whole, unseen, parts = _judge(points, cells, volumes.truth(scene, bounces=bounces), VolumeFigures, "reachable_m2")
    by_mirror = objects["bounces"].values > 0
    contrasts = volumes.patch_contrasts(scene, points[by_mirror], objects["amplitude"].values[by_mirror])
    return VolumeScore(
        mirrors=mirrors,
        **whole,
        hidden=HiddenVolume(mirrors=_deep(mirrors), **unseen, surfaces=list(parts)),
        surfaces=parts,
        patches={name: Contrast(contrast_db=contrast) for name, contrast in contrasts.items()},
        **sides,
    )


SomeFigures = TypeVar("SomeFigures", PlanFigures, VolumeFigures)


def _judge(
    points: Array, cells: tuple[Array | None, Array | None], truth: Truth, kind: type[SomeFigures], size: str
) -> tuple[SomeFigures, SomeFigures, dict[str, SomeFigures]]:
    """The figures of all points; of those that claim to be out of sight; and of these by the surface nearest to them.

    The points (n, d) [m] have `cells`, (n,) [m] each: diagonals of the resolution cells, with and without the widening
    by curved mirrors; None where they are unknown. Those without it decide which points claim to be out of sight: a
    point is not in sight because a curved mirror has made its cell wide. `kind` is `PlanFigures` or `VolumeFigures`,
    and `size` its field for the length or area of the truth that can be seen.
    """
    every, count = thinned(points)
    nearest_point = cKDTree(points).query(every)[1]
    cell, unwidened = (None if one is None else one[nearest_point] for one in cells)
    distance, nearest = truth.distances(every)
    margin = WIDE if unwidened is None else np.maximum(WIDE, WITHIN_CELLS * unwidened)
    claims_hidden = truth.distances(every, truth.direct)[0] > margin
    nearest_surface = truth.owner[nearest] if len(truth.owner) else np.full(len(every), -1)

    def compared(which: Mask, of: Mask) -> SomeFigures:
        reachable = truth.place[truth.reachable & of]
        chosen = None if cell is None else cell[which]
        found = figures(every[which], count[which], distance[which], reachable, chosen)
        return kind(**{**found, size: len(reachable) * truth.size})

    return (
        compared(np.ones(len(every), dtype=bool), np.ones(len(truth.owner), dtype=bool)),
        compared(claims_hidden, np.isin(truth.owner, truth.hidden)),
        {truth.names[i]: compared(claims_hidden & (nearest_surface == i), truth.owner == i) for i in truth.hidden},
    )


def _deep(mirrors: list[MirrorError]) -> list[MirrorError]:
    """The mirrors that are seen by way of other mirrors."""
    return [mirror for mirror in mirrors if mirror.generation > 1]
