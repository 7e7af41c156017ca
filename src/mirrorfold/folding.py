"""Steps 5 and 6: fold every ghost back, and collect what arrives at the root.

What was seen through a chain of mirrors is reflected across the last of them first and across the first of them last;
all lines are those of the unfolded image, where a deeper mirror is a ghost itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold import __version__
from mirrorfold.detection import THRESHOLD_DB, Echoes, find_echoes, find_pixels
from mirrorfold.errors import InputError
from mirrorfold.geometry import Isometry
from mirrorfold.mirrors import MINIMUM_LENGTH, Mirror
from mirrorfold.mixed import is_mixed
from mirrorfold.polar import PolarImage, to_polar_image
from mirrorfold.sweep import check_sweep, is_monostatic
from mirrorfold.tree import ROOT, WALL_MARGIN, MirrorTree, Views, build_tree

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

MIXED_ROUNDS = 3
"""Each round uncovers little: mixed-path ghosts rarely stand behind one another."""

LARGEST_GROWTH = 2.0
"""The corrected grid grows to hold what folds to outside of the image, by at most this share of the image's size."""


@dataclass(frozen=True)
class Settings:
    """Everything that can be chosen about folding.

    Attributes
    ----------
    normalization : {"r", "none", "r2"}
        Power of range that undoes the spreading before anything is judged.
    threshold_db : float [dB]
        Relative to the robust reference echo; with `published`, to the brightest pixel.
    minimum_length : float [m]
        Of a mirror.
    wall_margin : float [m]
        How far behind a mirror echoes still belong to the wall.
    opaque : bool
        Objects end the view.
    published : bool
        Every pixel above the threshold counts, and every row of them that is long enough is a mirror.
    """

    normalization: str = "r"
    threshold_db: float = THRESHOLD_DB
    minimum_length: float = MINIMUM_LENGTH
    wall_margin: float = WALL_MARGIN
    opaque: bool = True
    published: bool = False


PRESETS = {
    "default": Settings(),
    "published": Settings(normalization="r2", threshold_db=-30.0, wall_margin=0.0, opaque=False, published=True),
}
"""`published` is the algorithm of Cui and Trichopoulos (2024), for comparison."""


def fold(
    image: xr.DataArray,
    *,
    sweep: xr.Dataset | None = None,
    preset: str = "default",
    normalization: str | None = None,
    threshold_db: float | None = None,
    minimum_length: float | None = None,
    wall_margin: float | None = None,
    progress: Progress | None = None,
) -> xr.DataTree:
    """Find the mirrors in an image, and fold what was seen through them back to where it stands.

    Parameters
    ----------
    image : (y, x) or (range, azimuth, elevation) DataArray
        Complex or amplitude, not normalised with range. For a volume see also `mirrorfold.volume_folding`; of voxels
        (z, y, x) the plan view is folded.
    sweep : xarray.Dataset, optional
        The MIMO or synthetic-aperture Sweep that the image was focused from. It tells echoes that left and arrived by
        different ways, which focus where nothing is, from true ones.
    preset : {"default", "published"}
        Where the settings below come from unless they are given.
    normalization : {"r", "none", "r2"}, optional
        For a volume "beam", "r2" or "none".
    threshold_db : float [dB], optional
        Relative to the robust reference echo; with the published preset to the brightest pixel.
    minimum_length : float [m], optional
        Of a mirror; in a volume, of its width and height.
    wall_margin : float [m], optional
        How far behind a mirror echoes still belong to the wall.
    progress : callable (done, total), optional

    Returns
    -------
    xarray.DataTree
        The Reconstruction. Without any mirror it is the unfolded image, and its attr `remark` says so.

    Raises
    ------
    InputError
        If the image or a setting cannot be used.
    """
    if getattr(image, "dims", None) == ("range", "azimuth", "elevation"):
        from mirrorfold.volume_folding import fold_volume

        if preset != "default":
            raise InputError(f"preset is {preset!r}, but a volume is folded with the default one; fold its plan_view")
        return fold_volume(
            image,
            normalization=normalization,
            threshold_db=threshold_db,
            minimum_size=minimum_length,
            wall_margin=wall_margin,
            progress=progress,
        )
    if getattr(image, "dims", None) == ("z", "y", "x"):  # the plan view: the strongest voxel of each column
        image = abs(image).max("z", skipna=False, keep_attrs=True)
    if preset not in PRESETS:
        raise InputError(f"preset is {preset!r}, expected one of {', '.join(PRESETS)}")
    given: dict[str, Any] = {
        "normalization": normalization,
        "threshold_db": threshold_db,
        "minimum_length": minimum_length,
        "wall_margin": wall_margin,
    }
    settings = replace(PRESETS[preset], **{name: value for name, value in given.items() if value is not None})
    for name in ("minimum_length", "wall_margin", "threshold_db"):
        value = getattr(settings, name)
        if not np.isfinite(value) or (name == "minimum_length" and value <= 0) or (name == "wall_margin" and value < 0):
            raise InputError(f"{name} is {value}, expected a finite number{'' if name == 'threshold_db' else ' [m]'} "
                             "above zero; leave it out for the default")  # fmt: skip
    if sweep is not None:
        sweep = check_sweep(sweep)
        if is_monostatic(sweep):  # one antenna hears an echo from where it sent it to
            sweep = None
    report = progress or (lambda done, total: None)

    polar = to_polar_image(image, normalization=settings.normalization)
    report(1, 4)
    if settings.published:
        echoes = find_pixels(polar, threshold_db=settings.threshold_db)
    else:
        echoes = find_echoes(polar, threshold_db=settings.threshold_db)
    report(2, 4)

    def arrange(echoes: Echoes) -> tuple[MirrorTree, Views]:
        return build_tree(
            echoes,
            polar,
            minimum_length=settings.minimum_length,
            opaque=settings.opaque,
            wall_margin=settings.wall_margin,
            tested=not settings.published,
        )

    tree, views = arrange(echoes)
    if sweep is not None and not settings.published:
        trusted = np.zeros(echoes.range.size, dtype=bool)
        # What stands behind a mixed-path ghost comes into view, and is tested in its turn.
        for _ in range(MIXED_ROUNDS):
            new = ~trusted & views.clear(echoes.range, views.column(echoes.u), echoes.amplitude)
            if not new.any():
                break
            mixed = np.zeros_like(new)
            mixed[new] = is_mixed(echoes.take(new), sweep, polar)
            trusted = (trusted | new)[~mixed]
            echoes = echoes.take(~mixed)
            tree, views = arrange(echoes)
    report(3, 4)
    result = to_reconstruction(image, polar, echoes, tree, views, settings)
    result.attrs["preset"] = preset
    report(4, 4)
    return result


def to_reconstruction(
    image: xr.DataArray, polar: PolarImage, echoes: Echoes, tree: MirrorTree, views: Views, settings: Settings
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
    settings : Settings

    Returns
    -------
    xarray.DataTree
        ``/``: `intensity`; ``/initial``: `initial`; ``/objects`` and ``/mirrors``. Images share one grid, that of the
        image, grown where something folds to outside of it.
    """
    folds = tree.folds()
    objects = _objects(tree, folds, echoes.threshold)
    mirrors = _mirrors(tree, folds)
    x, y = _grid(image, objects)
    attrs: dict[str, Any] = {
        "mirrorfold_kind": "reconstruction",
        "mirrorfold_version": __version__,
        "radar_x": float(polar.radar[0]),
        "radar_y": float(polar.radar[1]),
        **{f"fold_{name}": value for name, value in asdict(settings).items()},
        "threshold": echoes.threshold,
        "reference": echoes.reference,
        **{f"image_{name}": value for name, value in image.attrs.items() if name != "mirrorfold_kind"},
        "remark": "" if tree.mirrors else "no mirror was found; the scene is shown unfolded",
    }
    coords = {
        "y": ("y", y, {"units": "m", "long_name": "range"}),
        "x": ("x", x, {"units": "m", "long_name": "cross-range"}),
    }
    intensity, initial = _render(x, y, polar, views, folds, settings.wall_margin)
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


def _render(
    x: Array, y: Array, polar: PolarImage, views: Views, folds: dict[tuple[int, ...], Isometry], wall_margin: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Folded and unfolded amplitude on the grid.

    Every pixel of the true scene looks up the amplitude of the image where each chain of mirrors shows it: there are
    no holes, as pushing pixels to their folded places would leave them.
    """
    grid = np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)
    range_, u = polar.to_polar(grid)
    initial = polar.at(range_, u)
    intensity = np.where(views.shows(range_, u, initial, ROOT, wall_margin), initial, 0.0)
    for index, chain in enumerate(views.chain):
        if chain:
            outline = folds[chain](polar.to_points(*views.region(index).T))
            first, last = outline.min(axis=0), outline.max(axis=0)
            rows, columns = (
                slice(np.searchsorted(axis, first[i]), np.searchsorted(axis, last[i], side="right"))
                for i, axis in ((1, y), (0, x))
            )
            range_, u = polar.to_polar(folds[chain].inverse(grid[rows, columns]))
            amplitude = polar.at(range_, u)
            seen = views.shows(range_, u, amplitude, index, wall_margin)
            part = intensity[rows, columns]
            part[seen] = np.maximum(part[seen], amplitude[seen])
    return intensity.astype(np.float32), initial.astype(np.float32)
