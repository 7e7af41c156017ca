"""The folded scene: what was found, at its true place, as a Reconstruction."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold import __version__
from mirrorfold.common.geometry import Isometry
from mirrorfold.detection.image_echoes import Echoes
from mirrorfold.detection.image_view import PolarImage
from mirrorfold.detection.mirror import Mirror
from mirrorfold.tree.lines_of_sight import EDGE_COLUMNS, ROOT, Views
from mirrorfold.tree.tree import MirrorTree

Array = NDArray[np.float64]

LARGEST_GROWTH = 2.0
"""The corrected grid grows to hold what folds to outside of the image, by at most this share of the image's size."""


def to_reconstruction(
    image: xr.DataArray,
    polar: PolarImage,
    echoes: Echoes,
    tree: MirrorTree,
    views: Views,
    settings: dict[str, Any],
    *,
    mixed: Array | None = None,
    grid: tuple[Array, Array] | None = None,
) -> xr.DataTree:
    """The folded scene with its origins, as a Reconstruction.

    Parameters
    ----------
    image : (y, x) DataArray
    polar : PolarImage
    echoes : Echoes
        All of the image; their threshold and reference are recorded.
    tree : MirrorTree
    views : Views
    settings : dict
        As they were chosen; `wall_margin` [m] among them.
    mixed : (n, 2) array [m], optional
        Where echoes stood in the image that were found to be mixed-path ghosts, and left out.
    grid : (x, y), optional
        Pixel coordinates of the pictures [m].

    Returns
    -------
    xarray.DataTree
        ``/``: `intensity`; ``/initial``: `initial`; ``/objects`` and ``/mirrors``. Images share one grid, that of the
        image, grown where something folds to outside of it, unless another is given.
    """
    folds = tree.folds()
    objects = _objects(tree, folds, echoes.threshold)
    mirrors = _mirrors(tree, folds)
    x, y = _grid(image, objects) if grid is None else grid
    mixed = np.empty((0, 2)) if mixed is None else mixed
    attrs: dict[str, Any] = {
        "mirrorfold_kind": "reconstruction",
        "mirrorfold_version": __version__,
        "radar_x": float(polar.radar[0]),
        "radar_y": float(polar.radar[1]),
        **{f"fold_{name}": value for name, value in settings.items()},
        "threshold": echoes.threshold,
        "reference": echoes.reference,
        "mixed_x": mixed[:, 0],
        "mixed_y": mixed[:, 1],
        **{f"image_{name}": value for name, value in image.attrs.items() if name != "mirrorfold_kind"},
        "remark": "" if tree.mirrors else "no mirror was found; the scene is shown unfolded",
    }
    coords = {
        "y": ("y", y, {"units": "m", "long_name": "range"}),
        "x": ("x", x, {"units": "m", "long_name": "cross-range"}),
    }
    intensity, initial = render(x, y, polar, views, folds, settings["wall_margin"])
    root = xr.Dataset({"intensity": (("y", "x"), intensity)}, coords=coords, attrs=attrs)
    first = xr.Dataset({"initial": (("y", "x"), initial)}, coords=coords)
    for variable in (root["intensity"], first["initial"]):
        variable.attrs["long_name"] = "amplitude, range-normalised"
    return xr.DataTree.from_dict({"/": root, "/initial": first, "/objects": objects, "/mirrors": mirrors})


def _objects(tree: MirrorTree, folds: dict[tuple[int, ...], Isometry], threshold: float) -> xr.Dataset:
    """Every echo at its folded place: objects by their node's chain, faces of mirrors by their parent's."""
    columns: dict[str, list[Any]] = {
        name: [] for name in ("position", "initial", "amplitude", "bounces", "chain", "surface", "confidence")
    }
    trust: dict[tuple[int, ...], float] = {}
    for node in tree.walk():
        trust[node.chain] = 1.0 if node.line is None else trust[node.chain[:-1]] * node.line.fill
        parts = [(node.objects, node.chain, "object")]
        if node.line is not None:
            parts.append((node.face, node.chain[:-1], "mirror"))
        for part, chain, surface in parts:
            size = part.range.size
            columns["position"].append(folds[chain](part.position))
            columns["initial"].append(part.position)
            columns["amplitude"].append(part.amplitude)
            columns["bounces"].append(np.full(size, len(chain), dtype=np.int32))
            columns["chain"].append(np.full(size, "/".join(map(str, chain)), dtype=object))
            columns["surface"].append(np.full(size, surface, dtype=object))
            excess = 1.0 - (threshold / np.maximum(part.amplitude, threshold)) ** 2 if threshold > 0 else np.ones(size)
            columns["confidence"].append(excess * trust[chain])
    joined = {name: np.concatenate(parts) for name, parts in columns.items()}
    position = joined["position"].reshape(-1, 2)
    initial = joined["initial"].reshape(-1, 2)
    metre = {"units": "m"}
    # As coordinates of their own, x and y of the points take precedence over the images' axes of the same names.
    return xr.Dataset(
        {
            "x": ("point", position[:, 0], {**metre, "long_name": "folded position"}),
            "y": ("point", position[:, 1], {**metre, "long_name": "folded position"}),
            "x_initial": ("point", initial[:, 0], {**metre, "long_name": "position before folding"}),
            "y_initial": ("point", initial[:, 1], {**metre, "long_name": "position before folding"}),
            "amplitude": ("point", joined["amplitude"].astype(np.float32)),
            "bounces": ("point", joined["bounces"], {"long_name": "mirrors on the way, 0 = line of sight"}),
            "chain": ("point", joined["chain"].astype(str), {"long_name": "indices of the mirrors from the root"}),
            "surface": ("point", joined["surface"].astype(str), {"long_name": "object, or face of a mirror"}),
            "confidence": (
                "point",
                joined["confidence"].astype(np.float32),
                {"long_name": "share of power above the threshold, times the filled share of each mirror on the way"},
            ),
        }
    ).set_coords(["x", "y"])


def _mirrors(tree: MirrorTree, folds: dict[tuple[int, ...], Isometry]) -> xr.Dataset:
    """Every mirror in the unfolded image and at its true place."""
    nodes: list[tuple[MirrorTree, Mirror]] = [(node, node.line) for node in tree.walk() if node.line is not None]
    index = {node.chain: i for i, (node, _) in enumerate(nodes)}
    ends = np.array([[line.start, line.end] for _, line in nodes], dtype=float).reshape(-1, 2, 2)
    true = np.array(
        [folds[node.chain[:-1]](np.stack([line.start, line.end])) for node, line in nodes], dtype=float
    ).reshape(-1, 2, 2)
    data: dict[str, Any] = {}
    for prefix, points in (("", ends), ("folded_", true)):
        for end in (0, 1):
            for axis, name in enumerate("xy"):
                data[f"{prefix}{name}{end}"] = ("mirror", points[:, end, axis], {"units": "m"})
    data["parent"] = ("mirror", np.array([index.get(n.chain[:-1], -1) for n, _ in nodes], dtype=np.int32))
    data["generation"] = ("mirror", np.array([node.generation for node, _ in nodes], dtype=np.int32))
    data["chain"] = ("mirror", np.array(["/".join(map(str, node.chain)) for node, _ in nodes], dtype=str))
    for name, unit in (("strength", "1"), ("angle_error", "degree"), ("offset_error", "m"), ("fill", "1")):
        data[name] = ("mirror", np.array([getattr(line, name) for _, line in nodes], dtype=float), {"units": unit})
    return xr.Dataset(data)


def _grid(image: xr.DataArray, objects: xr.Dataset) -> tuple[Array, Array]:
    """The image's coordinates, continued in the same steps as far as folded points lie."""
    axes = []
    for name in ("x", "y"):
        axis = image[name].values.astype(float)
        step = (axis[-1] - axis[0]) / (axis.size - 1)
        position = objects[name].values
        limit = int(LARGEST_GROWTH * axis.size)
        below = above = 0
        if position.size:
            below = int(np.clip(np.ceil((axis[0] - position.min()) / step), 0, limit))
            above = int(np.clip(np.ceil((position.max() - axis[-1]) / step), 0, limit))
        before, after = axis[0] - step * np.arange(below, 0, -1), axis[-1] + step * np.arange(1, above + 1)
        axes.append(np.concatenate([before, axis, after]))
    return axes[0], axes[1]


def render(
    x: Array, y: Array, polar: PolarImage, views: Views, folds: dict[tuple[int, ...], Isometry], wall_margin: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Folded and unfolded amplitude on the grid, (y, x) each.

    Every pixel of the true scene looks up the amplitude of the image where each chain of mirrors shows it: there are
    no holes, as pushing pixels to their folded places would leave them.

    Parameters
    ----------
    x, y : 1D arrays [m]
    polar : PolarImage
    views : Views
    folds : dict
        For every chain, the map from the image to the true place.
    wall_margin : float [m]
        How far behind a mirror echoes still belong to the wall.
    """
    initial = np.zeros((y.size, x.size), dtype=np.float32)
    intensity = np.zeros_like(initial)
    crossing, opened = views._worlds
    view = (polar.radar, polar.along, polar.broadside, polar.range[0], polar.dr, polar.u[0], polar.du)
    empty = views.open if views.open.size else np.zeros(views.u.size)
    sight = (views.barrier, empty, np.ascontiguousarray(crossing), np.ascontiguousarray(opened), wall_margin)
    here = Isometry.identity()
    _render(x, y, here.linear, here.shift, polar.amplitude, *view, *sight, ROOT, intensity, initial)
    for index, chain in enumerate(views.chain):
        if chain:
            outline = folds[chain](polar.to_points(*views.region(index).T))
            first, last = outline.min(axis=0), outline.max(axis=0)
            rows, columns = (
                slice(np.searchsorted(axis, first[i]), np.searchsorted(axis, last[i], side="right"))
                for i, axis in ((1, y), (0, x))
            )
            back = folds[chain].inverse
            part = intensity[rows, columns]
            _render(x[columns], y[rows], back.linear, back.shift, polar.amplitude, *view, *sight, index, part, part[:0])
    return intensity, initial


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _through(crossing, opened, distance, column):  # type: ignore[no-untyped-def]
    """`Views.seen_through` for one point."""
    passed = 0
    for k in range(crossing.shape[0]):
        passed += crossing[k, column] < distance
    return opened[passed, column]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _render(  # type: ignore[no-untyped-def]
    x, y, linear, shift, amplitude, radar, along, broadside, range0, dr, u0, du, barrier, empty, crossing,
    opened, wall_margin, world, intensity, initial,
):  # fmt: skip
    """``intensity = max(intensity, image(linear @ p + shift))`` where `world` shows it; `initial` if it has rows."""
    rows, columns = amplitude.shape
    for i in range(y.size):
        for j in range(x.size):
            px = linear[0, 0] * x[j] + linear[0, 1] * y[i] + shift[0] - radar[0]
            py = linear[1, 0] * x[j] + linear[1, 1] * y[i] + shift[1] - radar[1]
            if px * broadside[0] + py * broadside[1] < 0.0:
                continue
            distance = np.hypot(px, py)
            row = (distance - range0) / dr
            column = ((px * along[0] + py * along[1]) / distance - u0) / du
            if not (0.0 <= row <= rows - 1 and 0.0 <= column <= columns - 1):
                continue
            r, c = min(int(row), rows - 2), min(int(column), columns - 2)
            a, b = row - r, column - c
            value = (1.0 - a) * ((1.0 - b) * amplitude[r, c] + b * amplitude[r, c + 1]) + a * (
                (1.0 - b) * amplitude[r + 1, c] + b * amplitude[r + 1, c + 1]
            )
            if initial.shape[0]:
                initial[i, j] = value
            nearest = min(int(column + 0.5), columns - 1)
            if value <= max(barrier[int(row), nearest], intensity[i, j]):
                continue
            if _through(crossing, opened, distance - wall_margin, nearest) != world:
                continue
            if world >= 0:
                # Next to the edge of what the mirror shows, the radar's own view must not contradict.
                px, py = x[j] - radar[0], y[i] - radar[1]
                own = np.hypot(px, py)
                column = (px * along[0] + py * along[1]) / max(own, range0) - u0
                at = int(column / du + 0.5)
                ahead = px * broadside[0] + py * broadside[1] >= 0.0 and 0 <= at < columns
                if ahead and range0 <= own < empty[at]:
                    left, right = max(nearest - EDGE_COLUMNS, 0), min(nearest + EDGE_COLUMNS, columns - 1)
                    if _through(crossing, opened, distance - wall_margin, left) != world or (
                        _through(crossing, opened, distance - wall_margin, right) != world
                    ):
                        continue
            intensity[i, j] = value
