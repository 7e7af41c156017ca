"""Shared by the experiments with the raster radar: scenes at reduced size, folded volumes, the walls that were found.

All scans are simulated by rays: diffuse scatterers at fixed places on surfaces and inside walls are seen directly and
by way of specular mirrors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from scipy.ndimage import map_coordinates

import mirrorfold as mf
from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.geometry import reflect
from mirrorfold.common.types import ROOT, Array, Mask
from mirrorfold.detection import find_echoes, see, usual_settings
from mirrorfold.detection.views.volume_view import to_volume_view
from mirrorfold.folding import FoldSettings
from mirrorfold.folding.confident import confident_points
from mirrorfold.folding.pictures import Grid, draw
from mirrorfold.folding.points import fold_back, owned_blobs
from mirrorfold.scenes.solids import Scene3D
from mirrorfold.tree.lines_of_sight import LinesOfSight
from mirrorfold.tree.rounds import find_tree

SNR_DB = 20.0
"""Signal over noise of a sample [dB]; a hidden body then stands some 30 dB above the noise of the volume."""

TOLD_DB = 10.0
"""The apparent thickness of a wall is the width of its mean profile at this level below its peak [dB]."""

EDGE = 0.10
"""Beams that meet a wall this close to its edge, three times their radius, also see what is beside the wall [m]."""

DEPTHS = np.arange(-0.06, 0.08, 0.0005)
"""Depths behind the face of a wall at which its profile is sampled [m]: a tenth of a range cell apart."""


@dataclass(frozen=True, eq=False)
class Wall:
    """A mirror that was found, at its true place.

    Attributes
    ----------
    chain : str
        Chain of the objects that are seen by way of it.
    center, normal : (3,) arrays [m]
        Center, and unit normal.
    corners : (4, 3) array [m]
    angle_error : float [degree]
        Standard error of the fit.
    """

    chain: str
    center: Array
    normal: Array
    corners: Array
    angle_error: float

    def image(self, points: Array) -> Array:
        """Mirror images of points (n, 3) [m]."""
        return reflect(points, self.center, self.normal)


def reduced(scene: Scene3D, *, beams: int, frequencies: int) -> Scene3D:
    """The same scene, scanned with fewer beams on each side, and fewer frequencies of the same band."""
    azimuth, elevation = scene.scanner.azimuth, scene.scanner.elevation
    assert azimuth is not None  # the beams form a grid in all shipped scenes
    assert elevation is not None
    sides = replace(azimuth, points=beams), replace(elevation, points=beams)
    scanner = replace(scene.scanner, azimuth=sides[0], elevation=sides[1])
    return replace(scene, scanner=scanner, band=replace(scene.band, points=frequencies))


def without_pictures(sweep: xr.Dataset) -> xr.DataTree:
    """The reconstruction of a scan with pictures of a few pixels, because pictures take most of the time."""
    few = np.array([0.0, 1.0])
    return mf.FoldPlan(mf.focus(sweep)).fold(grid=(few, few + 1.0, few))


def walls_of(reconstruction: xr.DataTree) -> list[Wall]:
    """The mirrors that were found, at their true places."""
    mirrors = reconstruction.children["mirrors"].to_dataset(inherit=False)
    found = []
    for i in range(mirrors.sizes.get("mirror", 0)):
        center, normal = (np.array([float(mirrors[f"folded_{what}_{axis}"][i]) for axis in "xyz"]) for what in
                          ("center", "normal"))  # fmt: skip
        corners = np.stack([mirrors[f"folded_corner_{axis}"].values[i] for axis in "xyz"], axis=-1)
        error = float(mirrors["angle_error"].values[i])
        found.append(Wall(str(mirrors["chain"].values[i]), center, normal, corners, error))
    return found


def hidden_points(reconstruction: xr.DataTree) -> xr.Dataset:
    """The points that were seen by way of mirrors: of objects, and on the faces of further mirrors."""
    points = confident_points(reconstruction)
    return points.isel(point=points["bounces"].values > 0)


def places_of(points: xr.Dataset) -> Array:
    """Folded places of points, (n, 3) [m]."""
    return np.stack([points[axis].values for axis in "xyz"], axis=-1)


def wall_profile(volume: xr.DataArray, wall: Wall) -> xr.DataArray:
    """Mean power across a wall at the depths `DEPTHS` behind its plane, relative to its maximum.

    The mean is over all beams that meet the wall away from its edges. An echo that a beam shows at a range d behind the
    plane lies ``d cos(t)`` deep, with the angle of incidence t of the beam. The power of the noise is subtracted.
    """
    view = to_volume_view(volume)
    cosine = np.abs(view.sight @ wall.normal)
    range_ = ((wall.center - view.radar) @ wall.normal) / (view.sight @ wall.normal)
    beams = np.flatnonzero(_inside(view.radar + range_[:, None] * view.sight, wall) & (range_ > 0.0))
    along = range_[beams, None] + DEPTHS / cosine[beams, None]
    power = view.power_at(along, beams[:, None]).mean(axis=0)
    attrs = {"units": "1", "long_name": "mean power across the wall, over its maximum"}
    depth = ("depth", DEPTHS, {"units": "m", "long_name": "behind the plane"})
    return xr.DataArray(power / power.max(), dims="depth", coords={"depth": depth}, attrs=attrs)


def _inside(points: Array, wall: Wall) -> Mask:
    """Which points (n, 3) [m] of the plane of a wall lie on the wall, at least `EDGE` away from its edges."""
    center = wall.corners.mean(axis=0)
    inside = np.ones(len(points), dtype=bool)
    for i in (0, 1):
        side = wall.corners[(1, 3)[i]] - wall.corners[0]
        half = 0.5 * float(np.linalg.norm(side))
        inside &= np.abs((points - center) @ side / (2.0 * half)) <= half - EDGE
    return inside


def thickness(profile: xr.DataArray) -> float:
    """Width [m] of a profile of power at `TOLD_DB` below its maximum, interpolated between its samples."""
    power, depth = profile.values, profile["depth"].values
    level = power_ratio_of(-TOLD_DB) * power.max()
    above = np.flatnonzero(power >= level)
    first, last = int(above[0]), int(above[-1])
    rise = np.interp(level, power[first - 1 : first + 1], depth[first - 1 : first + 1])
    fall = np.interp(-level, -power[last : last + 2], depth[last : last + 2])
    return float(fall - rise)


def folded_voxels(volume: xr.DataArray, grids: list[tuple[Grid, bool]]) -> list[xr.DataArray]:
    """Amplitude on grids of voxels: folded if the second item of a pair is true, otherwise as the radar sees the scene.

    The first item of a pair has the coordinates x, y and z [m] of the grid. Each voxel of the folded scene takes its
    value from the place in the volume where a chain of mirrors shows this voxel.
    """
    view = see(volume)
    echoes = find_echoes(view)
    settings = FoldSettings().completed(normalization=view.normalization, **usual_settings(view, echoes))
    found = find_tree(view, echoes, settings)
    margin, blobs = settings.wall_margin or 0.0, owned_blobs(fold_back(found.tree), found.sight)
    result = []
    for grid, folded in grids:
        if folded:
            values = draw(found.sight, margin, grid, blobs)
        else:
            values = draw(LinesOfSight.unfolded(view), margin, grid, np.full_like(blobs, ROOT))
        coords = {name: (name, axis, {"units": "m"}) for name, axis in zip("xyz", grid, strict=True)}
        result.append(xr.DataArray(values, dims=("z", "y", "x"), coords=coords, attrs={"long_name": "amplitude"}))
    return result


def upright(voxels: xr.DataArray, middle: Array, along: Array, distance: Array, height: Array) -> xr.DataArray:
    """An upright section (height, distance) of voxels through `middle` (3,) [m], horizontally along `along` (3,)."""
    place = middle[:2] + distance[:, None] * along[:2]
    index = []
    for name, values in (("z", height[:, None]), ("y", place[None, :, 1]), ("x", place[None, :, 0])):
        axis = voxels[name].values
        index.append((values - axis[0]) / (axis[1] - axis[0]))
    values = map_coordinates(voxels.values, np.stack(np.broadcast_arrays(*index)), order=1)
    coords = {"height": ("height", height, {"units": "m"}), "distance": ("distance", distance, {"units": "m"})}
    return xr.DataArray(values, dims=("height", "distance"), coords=coords, attrs={"long_name": "amplitude"})


def around(middle: Array, half: tuple[float, float, float], step: float = 0.01) -> Grid:
    """Coordinates x, y and z [m] of the voxels of a box around a place; `half` has half the sides of the box [m]."""
    return tuple(np.arange(m - h, m + h + 0.5 * step, step) for m, h in zip(middle, half, strict=True))
