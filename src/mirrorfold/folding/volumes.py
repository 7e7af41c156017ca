"""Steps 5 and 6 in three dimensions: the folded cloud, its plan view and its voxels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold import __version__
from mirrorfold.common.geometry import Isometry
from mirrorfold.common.threads import for_each
from mirrorfold.detection.planes import MINIMUM_SIZE, PlaneMirror
from mirrorfold.detection.volume_echoes import Cloud, RadarVolume, find_peaks, to_radar_volume
from mirrorfold.errors import InputError
from mirrorfold.focusing.range_profiles import at_point
from mirrorfold.tree.tree import WALL_MARGIN, MirrorTree
from mirrorfold.tree.volume_tree import OBJECT_DB, Worlds, build_worlds

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

PIXEL = 0.010
"""Of the plan view, and of its vertical columns twice that [m]: the beam is some 2 cm wide."""

BORDER = 0.15
"""Space around the points in the plan view [m]."""

LARGEST_GRID = 60_000_000
"""Voxels that are looked at for the plan view; the pixels grow beyond it."""


@dataclass(frozen=True, eq=False)
class Folded:
    """Everything that folding a volume finds.

    Attributes
    ----------
    volume : RadarVolume
    cloud : Cloud
        All echoes, before folding.
    tree : MirrorTree
        Its lines are `PlaneMirror`, its echoes `Cloud`.
    worlds : Worlds
    folds : dict
        For every chain, the map from the volume to the true place.
    """

    volume: RadarVolume
    cloud: Cloud
    tree: MirrorTree
    worlds: Worlds
    folds: dict[tuple[int, ...], Isometry]


def find_worlds(
    volume: xr.DataArray,
    *,
    normalization: str | None = None,
    threshold_db: float = OBJECT_DB,
    minimum_size: float = MINIMUM_SIZE,
    wall_margin: float = WALL_MARGIN,
    opaque: bool = True,
) -> Folded:
    """Echoes, mirrors, tree and folds of a raster volume: steps 2 to 5.

    Parameters
    ----------
    volume : (range, azimuth, elevation) DataArray
    normalization : {"beam", "r2", "none"}, optional
    threshold_db : float [dB]
        Of objects, relative to the reference of their world.
    minimum_size : float [m]
        Smallest width and height of a mirror.
    wall_margin : float [m]
        Least distance behind a mirror up to which echoes belong to the wall.
    opaque : bool
        Objects end the view.
    """
    radar = to_radar_volume(volume, normalization=normalization)
    cloud = find_peaks(radar)
    tree, worlds = build_worlds(
        cloud, radar, minimum_size=minimum_size, wall_margin=wall_margin, opaque=opaque, threshold_db=threshold_db
    )
    return Folded(radar, cloud, tree, worlds, tree.folds(3))


def fold_volume(
    volume: xr.DataArray,
    *,
    normalization: str | None = None,
    threshold_db: float | None = None,
    minimum_size: float | None = None,
    wall_margin: float | None = None,
    pixel: float | None = None,
    progress: Progress | None = None,
) -> xr.DataTree:
    """Find the mirrors in a raster volume, and fold what was seen through them back to where it stands.

    Parameters
    ----------
    volume : (range, azimuth, elevation) DataArray
        Complex or amplitude.
    normalization : {"beam", "r2", "none"}, optional
        By default for the beam if it is known, else for range squared.
    threshold_db : float [dB], optional
        Of objects, relative to the reference of their world.
    minimum_size : float [m], optional
        Smallest width and height of a mirror.
    wall_margin : float [m], optional
        Least distance behind a mirror up to which echoes belong to the wall.
    pixel : float [m], optional
        Of the plan view.
    progress : callable (done, total), optional

    Returns
    -------
    xarray.DataTree
        The Reconstruction, with `z`, and planes for mirrors. Without any mirror it is the unfolded scene, and its attr
        `remark` says so.

    Raises
    ------
    InputError
        If the volume or a setting cannot be used.
    """
    settings: dict[str, Any] = {
        "threshold_db": OBJECT_DB if threshold_db is None else threshold_db,
        "minimum_size": MINIMUM_SIZE if minimum_size is None else minimum_size,
        "wall_margin": WALL_MARGIN if wall_margin is None else wall_margin,
    }
    for name, value in settings.items():
        lowest = {"threshold_db": -np.inf, "minimum_size": 1e-3, "wall_margin": 0.0}[name]
        if not (np.isfinite(value) and value >= lowest):
            raise InputError(f"{name} is {value!r}, expected a finite number above zero; leave it out for the default")
    if pixel is not None and not (np.isfinite(pixel) and pixel > 0.0):
        raise InputError(f"pixel is {pixel!r}, expected a length in metres above zero")
    report = progress or (lambda done, total: None)
    found = find_worlds(volume, normalization=normalization, **settings)
    report(1, 2)
    objects = _objects(found)
    x, y, z = _axes(objects, PIXEL if pixel is None else float(pixel))
    amplitude = folded_voxels(found, x=x, y=y, z=z)
    unfolded = folded_voxels(found, x=x, y=y, z=z, folds=False)
    coords = {
        "y": ("y", y, {"units": "m", "long_name": "range"}),
        "x": ("x", x, {"units": "m", "long_name": "cross-range"}),
    }
    kept = {f"image_{name}": value for name, value in volume.attrs.items() if name != "mirrorfold_kind"}
    attrs: dict[str, Any] = {
        "mirrorfold_kind": "reconstruction",
        "mirrorfold_version": __version__,
        "radar_x": float(found.volume.origin[0]),
        "radar_y": float(found.volume.origin[1]),
        "radar_z": float(found.volume.origin[2]),
        **{f"fold_{name}": value for name, value in settings.items()},
        "fold_normalization": normalization or "default",
        "noise_floor": found.volume.floor,
        **kept,
        "remark": "" if found.tree.mirrors else "no mirror was found; the scene is shown unfolded",
    }
    if "title" in volume.attrs:
        attrs["title"] = volume.attrs["title"]
    long_name = {"long_name": "strongest amplitude of each vertical column, normalised"}
    root = xr.Dataset({"intensity": (("y", "x"), amplitude.max(axis=0), long_name)}, coords=coords, attrs=attrs)
    initial = xr.Dataset({"initial": (("y", "x"), unfolded.max(axis=0), long_name)}, coords=coords)
    report(2, 2)
    return xr.DataTree.from_dict({"/": root, "/initial": initial, "/objects": objects, "/mirrors": _mirrors(found)})


def _objects(found: Folded) -> xr.Dataset:
    """Every echo at its folded place: objects by their node's chain, faces of mirrors by their parent's."""
    columns: dict[str, list[Any]] = {
        name: [] for name in ("position", "initial", "amplitude", "bounces", "chain", "surface", "confidence")
    }
    trust: dict[tuple[int, ...], float] = {}
    for node in found.tree.walk():
        trust[node.chain] = 1.0 if node.line is None else trust[node.chain[:-1]] * node.line.fill
        parts = [(node.objects, node.chain, "object")]
        if node.line is not None:
            parts.append((node.face, node.chain[:-1], "mirror"))
        part: Any
        for part, chain, surface in parts:
            size = part.range.size
            columns["position"].append(found.folds[chain](part.position))
            columns["initial"].append(part.position)
            columns["amplitude"].append(part.amplitude)
            columns["bounces"].append(np.full(size, len(chain), dtype=np.int32))
            columns["chain"].append(np.full(size, "/".join(map(str, chain)), dtype=object))
            columns["surface"].append(np.full(size, surface, dtype=object))
            columns["confidence"].append((1.0 - np.minimum(1.0 / part.contrast, 1.0) ** 2) * trust[chain])
    joined = {name: np.concatenate(parts) for name, parts in columns.items()}
    data: dict[str, Any] = {}
    for suffix, name, text in (("", "position", "folded position"), ("_initial", "initial", "position before folding")):
        for axis, letter in enumerate("xyz"):
            data[letter + suffix] = ("point", joined[name][:, axis], {"units": "m", "long_name": text})
    data["amplitude"] = ("point", joined["amplitude"].astype(np.float32))
    data["bounces"] = ("point", joined["bounces"], {"long_name": "mirrors on the way, 0 = line of sight"})
    data["chain"] = ("point", joined["chain"].astype(str), {"long_name": "indices of the mirrors from the root"})
    data["surface"] = ("point", joined["surface"].astype(str), {"long_name": "object, or face of a mirror"})
    text = "share of power above the noise floor, times the filled share of each mirror on the way"
    data["confidence"] = ("point", joined["confidence"].astype(np.float32), {"long_name": text})
    return xr.Dataset(data).set_coords(["x", "y", "z"])


def _mirrors(found: Folded) -> xr.Dataset:
    """Every mirror in the unfolded volume and at its true place: its plane, its extent and its footprint."""
    nodes = [node for node in found.tree.walk() if node.line is not None]
    index = {node.chain: i for i, node in enumerate(nodes)}
    lines: list[Any] = [node.line for node in nodes]
    corners: Any = np.array([_corners(line) for line in lines]).reshape(-1, 4, 3)
    ends: Any = np.array([[line.start, line.end] for line in lines]).reshape(-1, 2, 3)
    center: Any = np.array([line.center for line in lines]).reshape(-1, 3)
    tip: Any = np.array([line.center + line.normal for line in lines]).reshape(-1, 3)
    data: dict[str, Any] = {}
    for prefix in ("", "folded_"):
        if prefix:
            maps = [found.folds[node.chain[:-1]] for node in nodes]
            corners, ends, center, tip = (
                np.array([fold(points) for fold, points in zip(maps, thing, strict=True)]).reshape(thing.shape)
                for thing in (corners, ends, center, tip)
            )
        for axis, letter in enumerate("xyz"):
            for end in (0, 1):
                data[f"{prefix}{letter}{end}"] = ("mirror", ends[:, end, axis], {"units": "m"})
            data[f"{prefix}center_{letter}"] = ("mirror", center[:, axis], {"units": "m"})
            data[f"{prefix}normal_{letter}"] = ("mirror", tip[:, axis] - center[:, axis], {"units": "1"})
            data[f"{prefix}corner_{letter}"] = (("mirror", "corner"), corners[:, :, axis], {"units": "m"})
    data["parent"] = ("mirror", np.array([index.get(node.chain[:-1], -1) for node in nodes], dtype=np.int32))
    data["generation"] = ("mirror", np.array([node.generation for node in nodes], dtype=np.int32))
    data["chain"] = ("mirror", np.array(["/".join(map(str, node.chain)) for node in nodes], dtype=str))
    for name, unit in (("strength", "1"), ("angle_error", "degree"), ("offset_error", "m"), ("fill", "1"),
                       ("depth", "m")):  # fmt: skip
        data[name] = ("mirror", np.array([getattr(line, name) for line in lines], dtype=float), {"units": unit})
    return xr.Dataset(data)


def _corners(mirror: PlaneMirror) -> Array:
    """The rectangle around what is seen of a mirror, its sides horizontal and upright, (4, 3) [m]."""
    up = np.cross(mirror.normal, mirror.right)
    offset = mirror.outline - mirror.center
    across, along = offset @ mirror.right, offset @ up
    sides = ((across.min(), along.min()), (across.max(), along.min()), (across.max(), along.max()),
             (across.min(), along.max()))  # fmt: skip
    return np.array([mirror.center + u * mirror.right + v * up for u, v in sides])


def _axes(objects: xr.Dataset, pixel: float) -> tuple[Array, Array, Array]:
    """Pixels of the plan view around all points, before and after folding; a few where there are none."""
    limits = []
    for letter in "xyz":
        values = np.concatenate([objects[letter].values, objects[letter + "_initial"].values])
        limits.append((values.min() - BORDER, values.max() + BORDER) if values.size else (0.0, 1.0))
    cells = np.prod([high - low for low, high in limits]) / (2.0 * pixel**3)
    pixel *= max(1.0, float(cells / LARGEST_GRID) ** (1.0 / 3.0))
    x, y, z = (
        step * np.arange(np.floor(low / step), np.ceil(high / step) + 1)
        for (low, high), step in zip(limits, (pixel, pixel, 2.0 * pixel), strict=True)
    )
    return x, y, z


def folded_voxels(found: Folded, *, x: Array, y: Array, z: Array, folds: bool = True) -> NDArray[np.float32]:
    """Normalised amplitude of the true scene on a regular grid, (z, y, x).

    Every voxel looks up the volume where each chain of mirrors shows it, if nothing stands in the way there: there are
    no holes, as pushing voxels to their folded places would leave them.

    Parameters
    ----------
    found : Folded
    x, y, z : 1D arrays [m]
        In equal steps.
    folds : bool
        Without, the volume as it was, whole.
    """
    radar = found.volume
    crossing, opened = found.worlds.tables
    if folds:
        worlds = [(-1, ())] + [(i, chain) for i, chain in enumerate(found.worlds.views.chain) if chain]
        end = found.worlds.end
    else:
        worlds = [(-1, ())]
        crossing, opened, end = crossing[:0], np.full_like(opened[:1], -1), np.full_like(found.worlds.end, np.inf)
    inverse = [found.folds[chain].inverse for _, chain in worlds]
    linear = np.array([f.linear for f in inverse])
    shift = np.array([f.shift for f in inverse]) - radar.origin
    number = np.array([i for i, _ in worlds], dtype=np.int64)
    angles = np.radians(np.array([[a[0], a[-1], np.diff(a).mean()] for a in (radar.azimuth, radar.elevation)]))
    out = np.zeros((y.size, x.size, z.size), dtype=np.float32)
    step = float(z[1] - z[0]) if z.size > 1 else 1.0
    gain = radar.gain.astype(np.float32)

    def row(i: int) -> None:
        _fold_row(radar.amplitude, gain, x, float(y[i]), float(z[0]), step, linear, shift, number, angles,
                  float(radar.range[0]), radar.step, crossing, opened, end, WALL_MARGIN, out[i])  # fmt: skip

    for_each(row, range(y.size))
    return np.moveaxis(out, -1, 0)


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _fold_row(  # type: ignore[no-untyped-def]
    amplitude, gain, x, y, z, step_z, linear, shift, number, angles, first, step, crossing, opened, end, margin, out
):
    """Voxels of one y, (x, z): the largest amplitude with which any world shows them."""
    side_low, side_high = np.tan(angles[0, 0]), np.tan(angles[0, 1])
    up_low, up_high = np.tan(angles[1, 0]), np.tan(angles[1, 1])
    rows, depth = amplitude.shape[1], crossing.shape[0]
    for w in range(number.size):
        a = linear[w]
        for j in range(x.size):
            px = a[0, 0] * x[j] + a[0, 1] * y + shift[w, 0]
            py = a[1, 0] * x[j] + a[1, 1] * y + shift[w, 1]
            pz = a[2, 0] * x[j] + a[2, 1] * y + shift[w, 2]
            for i in range(out.shape[1]):
                height = z + i * step_z
                qx, qy, qz = px + a[0, 2] * height, py + a[1, 2] * height, pz + a[2, 2] * height
                if qy <= 0.0 or qx < side_low * qy or qx > side_high * qy:
                    continue
                ground = np.sqrt(qx * qx + qy * qy)
                if qz < up_low * ground or qz > up_high * ground:
                    continue
                r = np.sqrt(ground * ground + qz * qz)
                k = (r - first) / step
                if k < 0.0 or k >= gain.size - 1:
                    continue
                az = (np.arctan(qx / qy) - angles[0, 0]) / angles[0, 2]
                el = (np.arctan(qz / ground) - angles[1, 0]) / angles[1, 2]
                beam = int(az + 0.5) * rows + int(el + 0.5)
                if r > end[beam]:
                    continue
                passed = 0
                for d in range(depth):
                    if crossing[d, beam] < r - margin:
                        passed += 1
                if opened[passed, beam] == number[w]:
                    value = at_point(amplitude, az, el, k) * gain[int(k)]
                    out[j, i] = max(out[j, i], value)
