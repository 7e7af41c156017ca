"""How well a folded body agrees with the true one: distances, silhouette, arms, section, brightness.

A wall shows a hidden body as it looks from the mirror image of the radar in this wall. Silhouettes and angles of the
arms are therefore compared in this view (`Facing`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from mirrorfold.common.types import Array, Mask
from mirrorfold.plotting.outlines import covered
from mirrorfold.reproducing.parts.raster import Wall, hidden_points, places_of
from mirrorfold.scenes.solids import Scene3D
from mirrorfold.scoring.truth import Truth
from mirrorfold.scoring.volumes import truth

PIXEL = 0.01
"""Pixels of silhouettes [m]: twice the mean distance between samples of the truth."""

SECTION = 0.017
"""Half the thickness of a section [m]: the radius of the beam in its focus."""

UPPER, LOWER, ASIDE = 0.60, 0.40, 0.115
"""As shares of a body's height: the arms hang beside the body between the heights `LOWER` and `UPPER`, farther than
`ASIDE` from its middle."""

FEWEST_OF_ARM, WHOLE = 12, 0.8
"""Least number of points of an arm, and least share of the heights between `LOWER` and `UPPER` that they must span, for
an angle of the arm."""

COVERED = 0.03
"""A sample of the truth is covered if a folded point is this close [m], less than a diameter of the beam."""


@dataclass(frozen=True, eq=False)
class Facing:
    """The view of a hidden object from the direction in which its echoes left it.

    Attributes
    ----------
    middle : (3,) array [m]
        Middle of the object.
    right, ahead : (3,) arrays
        Horizontal unit vectors: to the right in the picture, and from the object to the viewer.
    """

    middle: Array
    right: Array
    ahead: Array

    def flat(self, points: Array) -> Array:
        """Places in the picture, (n, 2) [m], of points (n, 3) [m]: distance to the right of the middle, and height."""
        return np.stack([(points - self.middle) @ self.right, points[:, 2]], axis=1)


def facing(points: Array, wall: Wall, radar: Array) -> Facing:
    """The view of points (n, 3) [m] from the mirror image of the radar in a wall."""
    middle = np.median(points, axis=0)
    way = wall.image(radar[None])[0] - middle
    ahead = np.array([*way[:2], 0.0]) / np.hypot(*way[:2])
    return Facing(middle, np.cross([0.0, 0.0, 1.0], ahead), ahead)


@dataclass(frozen=True, eq=False)
class Folded:
    """The hidden points of a reconstruction, and the truth.

    Attributes
    ----------
    points : (n,) Dataset
        Points seen by way of a mirror: of objects, and on the faces of mirrors that are seen in others.
    known : Truth
        Samples of all true surfaces, with marks on those that are visible directly or by way of one mirror.
    distance : (n,) array [m]
        Distance of each point from the nearest true surface.
    surface : (n,) array of str
        Name of that surface.
    """

    points: xr.Dataset
    known: Truth
    distance: Array
    surface: Array

    @property
    def place(self) -> Array:
        """Folded places of the points, (n, 3) [m]."""
        return places_of(self.points)

    def of(self, name: str) -> Mask:
        """Which points are nearest to the surface of this name, (n,)."""
        return np.asarray(self.surface == name)

    def shown(self, name: str) -> Array:
        """Samples (m, 3) [m] of a surface that are visible directly or by way of one mirror."""
        index = next(i for i, known in self.known.names.items() if known == name)
        return self.known.place[self.known.reachable & (self.known.owner == index)]

    def level_db(self, name: str) -> float:
        """Mean power of the points on a surface [dB]; minus infinity without points."""
        mine = self.of(name)
        power = self.points["amplitude"].values[mine].astype(float) ** 2
        return float(10.0 * np.log10(power.mean())) if mine.any() else -np.inf


def folded(reconstruction: xr.DataTree, scene: Scene3D) -> Folded:
    """The hidden points of a reconstruction, each with the true surface that is nearest to it."""
    points, known = hidden_points(reconstruction), truth(scene, bounces=1)
    distance, nearest = known.distances(places_of(points))
    names = np.array([known.names[int(owner)] for owner in known.owner[nearest]], dtype=object)
    return Folded(points, known, distance, names)


def facts(body: Folded, name: str, view: Facing, step: float) -> dict[str, float]:
    """Numbers of one surface: points, distances [m], share that is covered, overlap of silhouettes, error of the top.

    `step` [degree] is the angle between beams.
    """
    mine = body.of(name)
    distance, shown = body.distance[mine], body.shown(name)
    away = cKDTree(body.place[mine]).query(shown)[0] if mine.any() else np.full(len(shown), np.inf)
    seen, true = silhouettes(body, name, view, step)
    return {
        "points": float(mine.sum()),
        "distance_mean_m": float(distance.mean()) if mine.any() else np.inf,
        "distance_90_m": float(np.quantile(distance, 0.9)) if mine.any() else np.inf,
        "covered": float(np.mean(away < COVERED)),
        "overlap": overlap(seen, true),
        "top_error_m": float(body.place[mine, 2].max() - shown[:, 2].max()) if mine.any() else np.inf,
    }


def silhouettes(body: Folded, name: str, view: Facing, step: float) -> tuple[xr.DataArray, xr.DataArray]:
    """Silhouettes of a folded surface and of the visible part of the true one, in the view, (height, across) bool.

    A folded point covers all pixels that are nearer to it than half the diagonal of the grid of beams at its range.
    """
    true = view.flat(body.shown(name))
    low, high = true.min(axis=0) - 0.1, true.max(axis=0) + 0.1
    u, z = (np.arange(low[i], high[i], PIXEL) for i in (0, 1))
    grid = np.stack(np.broadcast_arrays(u[None, :], z[:, None]), axis=-1)
    found = cKDTree(view.flat(body.place[body.of(name)])).query(grid)[0] <= cell_of(body, name, step)
    coords = {"height": ("height", z, {"units": "m"}), "across": ("across", u, {"units": "m"})}
    dims = ("height", "across")
    return xr.DataArray(found, dims=dims, coords=coords), xr.DataArray(covered(true, u, z), dims=dims, coords=coords)


def cell_of(body: Folded, name: str, step: float) -> float:
    """Half the diagonal [m] of the grid of beams, `step` [degree] apart, at the median range of a surface's ghost."""
    mine = body.of(name)
    seen = np.stack([body.points[f"{axis}_initial"].values[mine] for axis in "xyz"], axis=-1)
    return float(np.median(np.linalg.norm(seen, axis=1))) * float(np.radians(step)) / float(np.sqrt(2.0))


def beam_overlap(true: xr.DataArray, radius: float) -> float:
    """Overlap of a silhouette with itself after it was widened on all sides by the radius of the beam [m]."""
    return float(true.values.sum() / (distance_transform_edt(~true.values) <= radius / PIXEL).sum())


def overlap(one: xr.DataArray, other: xr.DataArray) -> float:
    """Area of the intersection of two silhouettes over that of their union."""
    return float((one.values & other.values).sum() / max((one.values | other.values).sum(), 1))


def arm_angles(points: Array, view: Facing) -> tuple[float, float]:
    """Angles from the vertical of the left and the right arm in the view, outwards [degree]; NaN for an arm left out.

    At the heights where arms hang beside the body, a line is fitted to the points (n, 3) [m] of each arm. Arms that are
    bent in front of the body, or of which little is seen, are left out.
    """
    flat = view.flat(points)
    bottom, top = flat[:, 1].min(), flat[:, 1].max()
    height, share = top - bottom, (flat[:, 1] - bottom) / (top - bottom)
    aside = flat[:, 0] - np.median(flat[(share > UPPER) & (share < 0.78), 0])
    hanging = (share > LOWER) & (share < UPPER)
    length = WHOLE * (UPPER - LOWER) * height
    left, right = (_arm_angle(flat[hanging & (side * aside > ASIDE * height)], side, length) for side in (-1.0, 1.0))
    return left, right


def _arm_angle(arm: Array, side: float, length: float) -> float:
    """Angle from the vertical, outwards [degree], of the line through the points (n, 2) [m] of an arm."""
    if len(arm) < FEWEST_OF_ARM or np.ptp(arm[:, 1]) < length:
        return float("nan")
    return float(np.degrees(np.arctan(-side * np.polyfit(arm[:, 1], arm[:, 0], 1)[0])))


def section_distances(body: Folded, name: str, view: Facing) -> tuple[Mask, Array]:
    """Which points lie within `SECTION` of the upright plane through the middle of the view, and their distances [m],
    in the plane, from the true samples within the same slice.
    """
    which = body.of(name) & (np.abs((body.place - view.middle) @ view.right) < SECTION)
    shown = body.shown(name)
    shown = shown[np.abs((shown - view.middle) @ view.right) < SECTION]
    if not len(shown) or not which.any():
        return which, np.full(int(which.sum()), np.inf)
    distance = cKDTree(_in_plane(shown, view)).query(_in_plane(body.place[which], view))[0]
    return which, np.asarray(distance)


def _in_plane(points: Array, view: Facing) -> Array:
    """Places in the upright plane towards the viewer, (n, 2) [m]: distance ahead of the middle, and height."""
    return np.stack([(points - view.middle) @ view.ahead, points[:, 2]], axis=1)
