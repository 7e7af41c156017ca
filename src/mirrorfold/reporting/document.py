"""Everything that a page shows of a reconstruction, as plain numbers and strings, which `page` turns into JSON.

Each pixel of an image is a level of one byte: 0 for an amplitude of zero, 1 to 255 for equal steps in dB. The
differences along each row are compressed, which a browser undoes exactly.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold import __version__
from mirrorfold.common.arcs import mirror_curves
from mirrorfold.common.decibels import COLOURS, PASSED_COLOUR, PASSED_LABEL, TRUTH_COLOUR, reference
from mirrorfold.common.facts import recorded_radar
from mirrorfold.common.plans import FloorPlan
from mirrorfold.common.statistics import mean_step
from mirrorfold.common.types import Array
from mirrorfold.describing.reconstructions import on_mirrors, remarks_on
from mirrorfold.describing.rows import found_rows, mirror_rows, place_digits, points_by_chain, score_rows
from mirrorfold.describing.settings import attribute_words, recorded_settings
from mirrorfold.folding.confident import confident_points
from mirrorfold.io.exports.vtk import places
from mirrorfold.scoring.cells import point_cells

if TYPE_CHECKING:
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D


LOWEST_DB = -60.0
"""Level of the weakest pixels that are shown [dB]; the side lobes of the focused image are below it."""

LARGEST_IMAGE = 1_200_000
"""Largest number of pixels of each image: a screen shows no more, and two images of this size make a page of 3 MB."""

LARGEST_CLOUD = 40_000
"""Largest number of points in a page; of more points the strongest are taken."""

MARGIN = 0.18
"""Space left free around all points and mirrors, as a share of the larger side of their bounding box."""

BLOB = 3
"""Diagonal of a resolution cell in diagonals of a pixel, where the file does not say what was resolved."""

DIGITS = 6
"""Decimal places of true lines [m], finer than any wavelength."""

CURVE_STEP = 0.01
"""Length of the chords by which true curves are drawn [m]."""

HIDDEN_ATTRS = ("mirrorfold_kind", "mixed_x", "mixed_y", "remark", "command", "title", "image_title")
"""Attributes that are not listed as parameters, because they are none or are shown elsewhere in the page."""


def to_document(
    reconstruction: xr.DataTree,
    scene: Scene | Scene3D | None = None,
    *,
    largest_image: int = LARGEST_IMAGE,
    extent: tuple[float, float, float, float] | None = None,
    zero_db: float | None = None,
    effort: int = 9,
    images: Sequence[str] = ("initial", "corrected"),
    scored: bool = True,
    plan: FloorPlan | None = None,
) -> dict[str, Any]:
    """Everything that a page shows of a reconstruction.

    Parameters
    ----------
    reconstruction : xarray.DataTree
        A reconstruction that was checked before.
    scene : Scene or Scene3D, optional
        The truth: drawn, and the result scored against it.
    largest_image : int
        Largest number of pixels of an image. Larger images are reduced: blocks of pixels become one, as strong as the
        strongest of them.
    extent : (x0, x1, y0, y1) [m], optional
        The part of the images to show; by default what was found, with a margin.
    zero_db : float, optional
        Amplitude that is shown as 0 dB; by default that of the brightest pixels of the initial image.
    effort : int
        Level of compression, 1 to 9.
    images : list of str
        Which of the two pictures the document holds.
    scored : bool
        Whether to score the result, where the truth is known.
    plan : FloorPlan, optional
        Known walls: drawn like the truth.

    Returns
    -------
    dict
        It consists of dicts, lists, numbers, strings, booleans and None only.
    """
    attrs = reconstruction.attrs
    settings = recorded_settings(attrs)
    elsewhere = {*HIDDEN_ATTRS, *(setting.attr for setting in settings)}
    objects = reconstruction.children["objects"].to_dataset(inherit=False)
    trusted = confident_points(reconstruction)
    dimensions = 3 if "z" in objects.variables else 2
    axes = "xyz"[:dimensions]
    mirrors = mirror_rows(reconstruction)
    truth = [] if scene is None else truth_lines(scene)
    if plan is not None:
        truth += [np.round(line, DIGITS).tolist() for line in plan.lines]
    if extent is None:
        extent = shown_extent(reconstruction, truth)
    shown = {
        "initial": reconstruction.children["initial"].dataset["initial"],
        "corrected": reconstruction.dataset["intensity"],
    }
    shown = {name: _reduced(_cropped(image, extent), largest_image) for name, image in shown.items()}
    zero = reference(shown["initial"].values) if zero_db is None else zero_db
    x, y = (shown["corrected"][name].values.astype(float) for name in "xy")
    document: dict[str, Any] = {
        "version": __version__,
        "dimensions": dimensions,
        "title": title_of(reconstruction, scene),
        "remark": " ".join(remarks_on(reconstruction)),
        "command": str(attrs.get("command", "")),
        "colours": list(COLOURS),
        "truth_colour": TRUTH_COLOUR,
        "passed": {"colour": PASSED_COLOUR, "label": PASSED_LABEL},
        "grid": {"x0": x[0], "dx": _step(x), "nx": x.size, "y0": y[0], "dy": _step(y), "ny": y.size},
        "extent": list(extent),
        "zero_db": zero,
        "images": {name: packed_levels(shown[name].values, zero, effort) for name in images},
        "margin": float(attrs.get("fold_wall_margin") or 0.0),
        "digits": place_digits(reconstruction),
        "radar": recorded_radar(attrs)[:dimensions].tolist(),
        "mirrors": mirrors,
        "least_confidence": float(attrs.get("fold_min_confidence", 0.0)),
        "points": _points(objects, axes, zero, _cells(objects, attrs, shown["corrected"])),
        "truth": truth,
        "settings": [setting._asdict() for setting in settings],
        "parameters": [
            [str(name), attribute_words(str(name), value)] for name, value in attrs.items() if name not in elsewhere
        ],
        "facts": found_rows(trusted, mirrors),
        "seen": points_by_chain(trusted),
    }
    if scene is not None and scored:
        from mirrorfold.scoring.score import score

        document["score"] = score_rows(score(reconstruction, scene))
    return document


def title_of(reconstruction: xr.DataTree, scene: Scene | Scene3D | None = None) -> str:
    """The title of a page: that of the measurement, else the name of the scene, else "Reconstruction"."""
    for name in ("title", "image_title"):
        if reconstruction.attrs.get(name):
            return str(reconstruction.attrs[name])
    return scene.name if scene is not None else "Reconstruction"


def truth_lines(scene: Scene | Scene3D) -> list[list[list[float]]]:
    """True surfaces as polylines [m]; in three dimensions the edges of walls, and sections of round objects."""
    if scene.dimensions == 2:
        pieces = [piece for surface in scene.surface for piece in surface.pieces(CURVE_STEP)]
        return [np.round(piece, DIGITS).tolist() for piece in pieces]
    from mirrorfold.plotting.outlines import wireframe

    return [np.round(line, DIGITS).tolist() for line in wireframe(scene)]


def shown_extent(reconstruction: xr.DataTree, truth: list[list[list[float]]]) -> tuple[float, float, float, float]:
    """The part of the plane to show (x0, x1, y0, y1) [m]: all that was found, folded and unfolded, with a margin."""
    objects = confident_points(reconstruction)
    held = reconstruction.children["mirrors"].to_dataset(inherit=False)
    grid = reconstruction.children["initial"].dataset
    radar, found = recorded_radar(reconstruction.attrs), []
    for i, axis in enumerate("xy"):
        values = [objects[axis].values, objects[f"{axis}_initial"].values]
        values += [curve[:, i] for prefix in ("", "folded_") for curve in mirror_curves(held, prefix)]
        values += [np.array(line)[:, i] for line in truth]
        joined = np.concatenate([radar[i : i + 1], *values])
        joined = joined[np.isfinite(joined)]
        pixels = grid[axis].values.astype(float)
        found.append((joined.min(), joined.max()) if joined.size > 1 else (pixels[0], pixels[-1]))
    margin = MARGIN * max(high - low for low, high in found)
    (low_x, high_x), (low_y, high_y) = found
    return float(low_x - margin), float(high_x + margin), float(low_y - margin), float(high_y + margin)


def shown_grid(image: xr.DataArray, extent: tuple[float, float, float, float], largest: int) -> tuple[Array, Array]:
    """The pixel coordinates (x, y) [m] on which `to_document` shows an image."""
    part = _reduced(_cropped(image, extent), largest)
    return part["x"].values.astype(float), part["y"].values.astype(float)


def packed_levels(amplitude: NDArray[np.float32], zero: float, effort: int = 9) -> dict[str, Any]:
    """An image, packed: `data`, the differences along rows, deflated, in base64; `lowest` level and `step` [dB].

    `amplitude` (y, x) equal to `zero` has 0 dB; `lowest` is the level of the byte 1. Amplitudes that are NaN, as files
    of other programs may have, are shown as nothing.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        level = 20.0 * np.log10(amplitude.astype(np.float32) / np.float32(zero))
    top = float(level.max(initial=0.0, where=np.isfinite(level)))
    step = (top - LOWEST_DB) / 254.0
    count = np.where(amplitude > 0, np.clip(np.rint((level - LOWEST_DB) / step) + 1.0, 1.0, 255.0), 0.0)
    bytes_ = count.astype(np.uint8)
    difference = np.diff(bytes_, axis=1, prepend=np.uint8(0))
    return {"data": _base64(zlib.compress(difference.tobytes(), effort)), "lowest": LOWEST_DB, "step": step}


def _cells(objects: xr.Dataset, attrs: dict[Any, Any], picture: xr.DataArray) -> Array:
    """Diagonal of the resolution cell at each point (points,) [m]; that of `BLOB` pixels where it is unknown."""
    found = point_cells(objects, attrs)
    pixel = np.hypot(_step(picture["x"].values), _step(picture["y"].values))
    return np.full(objects.sizes.get("point", 0), BLOB * pixel) if found is None else found


def _points(objects: xr.Dataset, axes: str, zero: float, cells: Array) -> dict[str, Any]:
    """The columns of the table of points, each as float32 in base64; places far from the origin, those that `doubles`
    names, as float64.

    The columns are places, level, confidence, resolution cell [m], bounces, whether the point is on the face of a
    mirror, and the indices of its chain, of its explanation, and of the chain of the wall that it was seen through, in
    the lists `chains`, `reasons` and `walls`.
    """
    total = objects.sizes.get("point", 0)
    chosen = np.arange(total)
    if total > LARGEST_CLOUD:
        chosen = np.sort(np.argsort(-objects["amplitude"].values, kind="stable")[:LARGEST_CLOUD])
    names, number = np.unique(objects["chain"].values[chosen].astype(str), return_inverse=True)
    with np.errstate(divide="ignore"):
        level = 20.0 * np.log10(np.maximum(objects["amplitude"].values[chosen], 1e-30) / zero)
    wall = objects["wall"].values[chosen].astype(str) if "wall" in objects else np.full(chosen.size, "")
    walls, through = np.unique(wall, return_inverse=True)
    explanation = np.full(total, "") if "explanation" not in objects else objects["explanation"].values.astype(str)
    reasons, reason = np.unique(explanation[chosen], return_inverse=True)
    position = {
        f"{axis}{suffix}": places(objects[f"{axis}{suffix}"].values[chosen])
        for axis in axes
        for suffix in ("", "_initial")
    }
    columns = {
        "level": level,
        "confidence": objects["confidence"].values[chosen],
        "cell": cells[chosen],
        "bounces": objects["bounces"].values[chosen],
        "chain": number.ravel(),
        "reason": reason.ravel(),
        "face": on_mirrors(objects)[chosen],
        "wall": through.ravel(),
    }
    return {
        "total": int(total),
        "count": int(chosen.size),
        "chains": names.tolist(),
        "walls": walls.tolist(),
        "reasons": reasons.tolist(),
        "doubles": [name for name, values in position.items() if values.dtype == np.float64],
        **{name: _base64(values.tobytes()) for name, values in position.items()},
        **{name: _base64(np.asarray(values, dtype="<f4").tobytes()) for name, values in columns.items()},
    }


def _cropped(image: xr.DataArray, extent: tuple[float, float, float, float]) -> xr.DataArray:
    """The pixels inside an extent; the whole image where the extent holds fewer than two pixels a side."""
    part = image.sel(x=slice(*extent[:2]), y=slice(*extent[2:]))
    return part if min(part.sizes.values()) > 1 else image


def _reduced(image: xr.DataArray, largest: int) -> xr.DataArray:
    """The image with at most `largest` pixels, each as strong as the strongest of a square of original pixels."""
    image = image.transpose("y", "x")
    factor = int(np.ceil(np.sqrt(image.size / largest))) if image.size > largest else 1
    if factor == 1:
        return image
    rows, columns = (size // factor for size in image.shape)
    values = image.values[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor).max(axis=(1, 3))
    axes = {
        name: image[name].values[: size * factor].reshape(size, factor).mean(axis=1)
        for name, size in (("y", rows), ("x", columns))
    }
    return xr.DataArray(values, dims=("y", "x"), coords=axes)


def _step(axis: Array) -> float:
    """Distance between neighbouring pixels along an axis [m]; one for a single pixel."""
    return mean_step(axis) or 1.0


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")
