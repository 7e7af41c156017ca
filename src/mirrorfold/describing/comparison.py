"""Comparison of two results: how their levels differ, which points were gained and lost, how far mirrors moved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from mirrorfold.common.arcs import arc_through, mirror_places
from mirrorfold.common.arguments import wrong_kind
from mirrorfold.common.beams import beam_radius
from mirrorfold.common.decibels import ratio_of, reference
from mirrorfold.common.facts import VOLUME, recorded_radar
from mirrorfold.common.geometry import segment_normal
from mirrorfold.common.records import LEFT_OUT, Number, Record, fact
from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.views.image_to_view import outline_of
from mirrorfold.errors import InputError
from mirrorfold.focusing.scans.gridding import plan_view
from mirrorfold.folding.confident import confident_points
from mirrorfold.folding.earlier import initial_image
from mirrorfold.folding.frames import pick_frame
from mirrorfold.io.own.checks import check_image, check_reconstruction
from mirrorfold.scoring.figures import WITHIN_CELLS
from mirrorfold.scoring.mirrors import Face, mirror_errors
from mirrorfold.sweep.polarization import first_polarization

FLOOR_DB = -40.0
"""Level, relative to the brighter result [dB], at which both are cut off; the levels of noise below it would differ by
many decibels."""

PIXELS_A_CELL = 2.0
"""Size of a resolution cell, in pixels, that is assumed where a result does not state its resolution."""

APART = 1e6
"""Cost of matching two mirrors that cannot be the same one."""


class LevelChange(Record):
    """How the levels of two pictures differ, second over first, where one of them is above the floor."""

    pixels: int = fact("that were compared")
    floor_db: float = fact("level below the brighter of both, at which both are cut off")
    median_db: Number = fact("[dB]")
    rms_db: Number = fact("root mean square [dB]")
    largest_db: Number = fact("without sign [dB]")
    correlation: Number = fact("of the amplitudes, 1 where one is a multiple of the other")


class PointChange(Record):
    """How many points are in both results, and how many in one only."""

    first: int = fact("points of the first")
    second: int
    kept: int = fact("points of the second, near to one of the first")
    gained: int = fact("points of the second, near to none of the first")
    lost: int = fact("points of the first, near to none of the second")
    within_cells: float = fact("what is near: distance in resolution cells")
    cell_m: Number = fact("a resolution cell at the median distance of the points")


class MirrorPair(Record):
    """A mirror by its number in each of both results, null where a result lacks it, and how far it moved."""

    first: int | None
    second: int | None
    angle_deg: Number = fact("between them [degree]")
    offset_m: Number = fact("of the second's middle from the first's line, arc or plane")
    first_radius_m: Number = fact("negative where it is concave; null where it is flat", default=LEFT_OUT)
    second_radius_m: Number = fact("likewise", default=LEFT_OUT)
    sagitta_m: Number = fact(
        "how much farther the second bulges towards the radar, over the chord of the shorter", default=LEFT_OUT
    )


class Comparison(Record):
    """Two results side by side."""

    kind: Literal["comparison"]
    compared: Literal["reconstructions", "images"]
    first: str = fact("file or title")
    second: str
    levels: LevelChange
    points: PointChange = fact(default=LEFT_OUT)
    mirrors: list[MirrorPair] = fact(default=LEFT_OUT)
    remarks: list[str] = fact("sentences on what deserves attention")
    files: list[str] = fact("what was written", default=LEFT_OUT)


@dataclass(frozen=True, eq=False)
class Changes:
    """The pictures of a comparison, and which points were lost and gained.

    Attributes
    ----------
    first, second : (y, x) DataArray
        Linear amplitudes on one grid.
    difference : (y, x) DataArray [dB]
        Level of the second relative to the first, NaN where both are below the floor.
    lost, gained : bool arrays
        Which points of the first (lost), and of the second (gained), have no point of the other result near them.
    """

    first: xr.DataArray
    second: xr.DataArray
    difference: xr.DataArray
    lost: Mask
    gained: Mask


def two_names(names: Any) -> tuple[str, str]:
    """Check the names of two results, and return them.

    Raises
    ------
    InputError
        If `names` is not two texts.
    """
    if not isinstance(names, list | tuple) or len(names) != 2 or not all(isinstance(name, str) for name in names):
        raise wrong_kind("names", names, "two texts, such as ('before', 'after')", reader="")
    return names[0], names[1]


def compare(first: Any, second: Any, *, names: tuple[str, str] | None = None) -> Comparison:
    """Compare two reconstructions, or two images.

    Parameters
    ----------
    first, second : xarray.DataTree or xarray.DataArray
        Two reconstructions or two images. Where their grids differ, the second is interpolated on the first's.
    names : two of str, optional
        What to call them; their titles by default.

    Returns
    -------
    Comparison
        `levels`: how the corrected pictures, or the images, differ in decibels. For reconstructions also `points`, how
        many were kept, gained and lost, where a point is kept if the other result has one within 1.5 resolution cells;
        and `mirrors`, matched one to one at their true places, with the angle and the offset between them and the radii
        of arcs.

    Raises
    ------
    InputError
        If the two are not of one kind, differ in their dimensions, or have no pixel in common.
    """
    first, second = checked_pair(first, second)
    changes = find_changes(first, second)
    titles = [str(one.attrs.get("title") or name) for one, name in ((first, "first"), (second, "second"))]
    called = two_names(titles if names is None else names)
    remarks: list[str] = []
    if not changes.difference.notnull().any():
        remarks.append("Every pixel of both is zero; there is nothing to compare.")
    if said := sorted({str(one["polarization"].values) for one in (first, second) if "polarization" in one.coords}):
        remarks.append(f"Of several polarizations {' and '.join(said)} was compared.")
    record = Comparison(
        kind="comparison",
        compared="images" if isinstance(first, xr.DataArray) else "reconstructions",
        first=called[0],
        second=called[1],
        levels=_levels(changes),
        remarks=remarks,
    )
    if isinstance(first, xr.DataArray):
        return record
    counts = changes.lost.size, changes.gained.size
    distances = np.concatenate([_reach(first), _reach(second)])
    cell = float(cells(first, np.array([np.median(distances)]))[0]) if distances.size else None
    pairs = match_mirrors(first, second)
    lost = sum(pair.second is None for pair in pairs), sum(pair.first is None for pair in pairs)
    for count, of in zip(lost, called, strict=True):
        if count:
            remarks.append(f"{count} {'mirror is' if count == 1 else 'mirrors are'} in {of} only.")
    return record.but(
        remarks=remarks,
        points=PointChange(
            first=counts[0], second=counts[1], kept=int((~changes.gained).sum()), gained=int(changes.gained.sum()),
            lost=int(changes.lost.sum()), within_cells=WITHIN_CELLS, cell_m=cell,
        ),
        mirrors=pairs,
    )  # fmt: skip


def checked_pair(first: Any, second: Any) -> tuple[Any, Any]:
    """Check two results, and return them: of a recording one frame, of an image with two polarizations that with TE.

    Raises
    ------
    InputError
        If they cannot be compared.
    """
    both: list[Any] = []
    for one, name in ((first, "first"), (second, "second")):
        if isinstance(one, xr.DataTree):
            both.append(pick_frame(check_reconstruction(one, name)))
        elif isinstance(one, xr.DataArray):
            both.append(first_polarization(pick_frame(check_image(one, name))))
        else:
            raise InputError(f"{name}: is a {type(one).__name__}, expected a reconstruction or an image")
    if type(both[0]) is not type(both[1]):
        raise InputError("compare: one is a reconstruction and the other an image; give two of one kind")
    if isinstance(both[0], xr.DataTree):
        spaces = ["z" in one.children["objects"].variables for one in both]
        if spaces[0] != spaces[1]:
            raise InputError("compare: one is a floor plan and the other has heights; give two of one kind")
    elif both[0].dims != both[1].dims:
        raise InputError(f"compare: the images have dimensions {both[0].dims} and {both[1].dims}; give two of one kind")
    return both[0], both[1]


def find_changes(first: Any, second: Any) -> Changes:
    """The pictures of two results on one grid, the difference of their levels, and the points gained and lost."""
    a, b = _picture(first), _picture(second)
    if not all(np.array_equal(a[name], b[name]) for name in "yx"):
        inside = {name: a[name][(a[name] >= b[name].min()) & (a[name] <= b[name].max())] for name in "yx"}
        if not all(axis.size for axis in inside.values()):
            raise InputError("compare: the two have no pixel in common; focus both on one grid")
        a, b = a.sel(inside), b.interp(inside)
    zero = max(reference(a.values), reference(b.values))
    floor = zero * ratio_of(FLOOR_DB)
    with np.errstate(divide="ignore"):
        difference = xr.DataArray(20.0 * np.log10(np.maximum(b, floor) / np.maximum(a, floor)))
    difference = difference.where((a > floor) | (b > floor))
    lost, gained = (np.zeros(0, dtype=bool),) * 2
    if isinstance(first, xr.DataTree):
        lost, gained = _apart(first, second), _apart(second, first)
    return Changes(a, b, difference, lost, gained)


def match_mirrors(first: xr.DataTree, second: xr.DataTree) -> list[MirrorPair]:
    """Match the mirrors of two reconstructions one to one, at their true places.

    The sum of ``offset [mm] + angle [degree]`` over all pairs is minimised. Two arcs are compared as arcs, an arc and a
    line by the chord of the arc.
    """
    faces, arcs, arcs_of_second = _faces(first), _arcs(first), _arcs(second)
    count = second.children["mirrors"].sizes.get("mirror", 0)
    found = [
        mirror_errors(second, [face], [(face.surface, arcs[i])] if i in arcs else []) for i, face in enumerate(faces)
    ]
    cost = np.full((len(faces), count), APART)
    for i, row in enumerate(found):
        for j, error in enumerate(row):
            only_chords = i in arcs and j in arcs_of_second and error.curvature_error is None
            if error.surface is not None and not only_chords:
                cost[i, j] = (error.offset_error_mm or 0.0) + (error.angle_error_deg or 0.0)
    pairs = [(int(i), int(j)) for i, j in zip(*linear_sum_assignment(cost), strict=True) if cost[i, j] < APART]
    matched = [
        MirrorPair(
            first=i,
            second=j,
            angle_deg=found[i][j].angle_error_deg,
            offset_m=1e-3 * (found[i][j].offset_error_mm or 0.0),
            **bend,
        )
        for (i, j), bend in zip(pairs, _bends(first, second, pairs), strict=True)
    ]
    alone = [MirrorPair(first=i, second=None, angle_deg=None, offset_m=None)
             for i in range(len(faces)) if i not in {i for i, _ in pairs}]  # fmt: skip
    new = [MirrorPair(first=None, second=j, angle_deg=None, offset_m=None)
           for j in range(count) if j not in {j for _, j in pairs}]  # fmt: skip
    return [*matched, *alone, *new]


def _bends(first: xr.DataTree, second: xr.DataTree, pairs: list[tuple[int, int]]) -> list[dict[str, float | None]]:
    """Radii of each pair of mirrors and the difference of their sagittas [m]; empty for two flat mirrors."""
    tables = [one.children["mirrors"].to_dataset(inherit=False) for one in (first, second)]
    curvatures = [table["curvature"].values if "curvature" in table else np.zeros(table.sizes["mirror"])
                  for table in tables]  # fmt: skip
    chords = [[2.0 * float(np.linalg.norm(face.halves[0])) for face in _faces(one)] for one in (first, second)]
    found: list[dict[str, float | None]] = []
    for i, j in pairs:
        a, b = float(curvatures[0][i]), float(curvatures[1][j])
        chord = min(chords[0][i], chords[1][j])
        radii = {"first_radius_m": 1.0 / a if a else None, "second_radius_m": 1.0 / b if b else None}
        found.append({**radii, "sagitta_m": sagitta(b, chord) - sagitta(a, chord)} if a or b else {})
    return found


def sagitta(curvature: float, chord: float) -> float:
    """Sagitta of an arc over a chord c [m], ``R - sqrt(R^2 - c^2 / 4)``, in a form that gives zero for a line."""
    ratio = 0.5 * curvature * chord
    return float(0.5 * chord * ratio / (1.0 + np.sqrt(max(0.0, 1.0 - ratio**2))))


def cells(reconstruction: xr.DataTree, distance: Array) -> Array:
    """Size of the resolution cell [m] of a reconstruction at `distance` [m], the path length from the radar."""
    attrs = reconstruction.attrs
    if "z" not in reconstruction.children["objects"].variables:
        return np.asarray(outline_of(initial_image(reconstruction)).cell(distance))
    names = "spot_radius", "focus_distance", "frequency_start", "frequency_stop", "wave_speed"
    known = [attrs.get(f"image_{name}") for name in names]
    pixel = float(np.diff(reconstruction.dataset["x"].values[:2])[0])
    if any(value is None for value in known):
        return np.full(np.shape(distance), PIXELS_A_CELL * pixel)
    spot, focus, low, high, speed = map(float, known)  # type: ignore[arg-type]
    width = 2.0 * beam_radius(distance, spot_radius=spot, focus_distance=focus, wavelength=speed / (0.5 * (low + high)))
    return np.asarray(np.hypot(2.0 * float(attrs.get("image_range_resolution", 0.0)), width))


def _picture(obj: Any) -> xr.DataArray:
    """Amplitude (y, x) of an image, or of the corrected picture of a reconstruction."""
    if isinstance(obj, xr.DataTree):
        return obj.dataset["intensity"].astype(float)
    if obj.dims == VOLUME:
        obj = plan_view(obj)
    picture = np.abs(obj).astype(float)
    return picture.max("z") if "z" in picture.dims else picture


def _levels(changes: Changes) -> LevelChange:
    """Statistics of the difference of two pictures, and the correlation of their amplitudes."""
    values = changes.difference.values[np.isfinite(changes.difference.values)]
    a, b = changes.first.values.ravel(), changes.second.values.ravel()
    norm = float(np.linalg.norm(a) * np.linalg.norm(b))
    return LevelChange(
        pixels=int(values.size),
        floor_db=FLOOR_DB,
        median_db=float(np.median(values)) if values.size else None,
        rms_db=float(np.sqrt(np.mean(values**2))) if values.size else None,
        largest_db=float(np.abs(values).max()) if values.size else None,
        correlation=float(a @ b) / norm if norm > 0.0 else None,
    )


def _places(reconstruction: xr.DataTree, suffix: str = "") -> Array:
    """Positions of the points of a reconstruction, (n, d) [m]; with the suffix "_initial" those before folding."""
    objects = confident_points(reconstruction)
    axes = [axis for axis in "xyz" if axis in objects.variables]
    return np.stack([objects[f"{axis}{suffix}"].values.astype(float) for axis in axes], axis=-1)


def _reach(reconstruction: xr.DataTree) -> Array:
    """Path length from the radar to each point, (n,) [m]: its distance before folding, which folding preserves."""
    initial = _places(reconstruction, "_initial")
    return np.asarray(np.linalg.norm(initial - recorded_radar(reconstruction.attrs)[: initial.shape[1]], axis=1))


def _apart(of: xr.DataTree, other: xr.DataTree) -> Mask:
    """Which points of a result have no point of the other result near them, (n,)."""
    points, others = _places(of), _places(other)
    if not len(points) or not len(others):
        return np.ones(len(points), dtype=bool)
    return np.asarray(cKDTree(others).query(points)[0] > WITHIN_CELLS * cells(of, _reach(of)))


def _arcs(reconstruction: xr.DataTree) -> dict[int, Array]:
    """The curved mirrors of a floor plan by their numbers, at their true places: points along each (n, 2) [m]."""
    places = mirror_places(reconstruction.children["mirrors"].to_dataset(inherit=False), "folded_")
    return {i: arc_through(*place) for i, place in enumerate(places) if len(place) == 3}


def _faces(reconstruction: xr.DataTree) -> list[Face]:
    """The mirrors of a reconstruction at their true places, as faces with which other mirrors can be compared."""
    mirrors = reconstruction.children["mirrors"].to_dataset(inherit=False)
    if "folded_center_x" in mirrors:
        outlines = np.stack([mirrors[f"folded_corner_{axis}"].values for axis in "xyz"], axis=-1).astype(float)
        faces = []
        for number, corners in enumerate(outlines):
            right, up = corners[1] - corners[0], corners[2] - corners[1]
            normal = np.cross(right, up) / np.linalg.norm(np.cross(right, up))
            faces.append(Face(str(number), corners.mean(axis=0), normal, 0.5 * np.stack([right, up])))
        return faces
    ends = np.stack([mirrors[f"folded_{name}"].values for name in ("x0", "y0", "x1", "y1")], axis=-1).reshape(-1, 2, 2)
    return [
        Face(str(number), pair.mean(axis=0), segment_normal(*pair), 0.5 * (pair[1] - pair[0])[None])
        for number, pair in enumerate(ends)
    ]
