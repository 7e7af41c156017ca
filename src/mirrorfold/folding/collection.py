"""Step 6 of the algorithm: pictures, points and mirrors are collected in a Reconstruction, the folded scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import xarray as xr

from mirrorfold import __version__
from mirrorfold.common.chains import chain_name
from mirrorfold.common.phases import phase_of
from mirrorfold.detection import Fold, Mirror
from mirrorfold.detection.finding import example_mirror
from mirrorfold.folding.confidence import TRUE_CELLS, mirror_confidence
from mirrorfold.folding.pictures import Grid, pictures
from mirrorfold.folding.points import Points
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree.assignment import ITSELF, Found
from mirrorfold.tree.explaining.half_shadows import OVERHANG_COLUMNS
from mirrorfold.tree.half_transparent.doubts import doubtful
from mirrorfold.tree.half_transparent.transparent import BY_GEOMETRY, TransparentWall
from mirrorfold.tree.mirror_tree import MirrorTree

FOLDED_ERRORS = "folded_angle_error", "folded_offset_error"
"""Columns with the standard errors of a mirror at its true place, which include those of the mirrors on its way."""

MIRROR_UNITS = {"angle_error": "degree", FOLDED_ERRORS[0]: "degree", "curvature": "1/m", "curvature_error": "1/m"}
MIRROR_UNITS |= dict.fromkeys(("confidence", "strength", "fill", "permittivity", "permittivity_error"), "1")
"""Units of the columns of mirrors that are neither lengths nor unit vectors."""


def collect(
    image: xr.DataArray,
    found: Found,
    points: Points,
    settings: FoldSettings,
    *,
    grid: Grid | None = None,
    given: int | None = None,
    from_above: float | None = None,
) -> xr.DataTree:
    """The folded scene as a Reconstruction, with the unfolded image and all settings.

    Parameters
    ----------
    image : DataArray
        The unfolded image or volume.
    found : Found
        The tree of mirrors, the lines of sight and the echoes, as steps 2 to 4 found them.
    points : Points
        Every echo at its true place, as step 5 returns them.
    settings : FoldSettings
        Settings of these steps.
    grid : tuple of 1D arrays [m], optional
        Pixel coordinates x and y of the pictures, and z for a volume. By default, those of the image, continued as far
        as there are folded points; for a volume, a grid around all points.
    given : int, optional
        Number of mirrors, or of walls of a floor plan, that the user gave; None where mirrors were searched for.
    from_above : float [degree], optional
        Angle by which the radar looks down, if that is why no mirrors were searched for.

    Returns
    -------
    xarray.DataTree
        ``/`` with the folded picture `intensity`, ``/initial`` with the unfolded picture `initial`, and the tables
        ``/objects`` and ``/mirrors``.
    """
    sight, tree, axes = found.sight, found.tree, "xyz"[: found.sight.view.dimensions]
    attrs: dict[str, Any] = {
        "mirrorfold_kind": "reconstruction",
        "mirrorfold_version": __version__,
        **{f"radar_{axis}": float(place) for axis, place in zip(axes, sight.view.radar, strict=True)},
        **{f"fold_{name}": value for name, value in asdict(settings).items()},
        "threshold": found.echoes.threshold,
        "reference": found.echoes.reference,
        **{f"image_{name}": value for name, value in image.attrs.items() if name != "mirrorfold_kind"},
        "remark": _remark(image, found, points, settings, given, from_above),
    }
    if "z" in image.coords and image["z"].ndim == 0:
        attrs["image_z"] = float(image["z"])
    if "title" in image.attrs:
        attrs["title"] = image.attrs["title"]
    (x, y), intensity, initial, what = pictures(image, found, points, settings, grid)
    axes_of = {"y": ("y", y, {"units": "m", "long_name": "range"}),
               "x": ("x", x, {"units": "m", "long_name": "cross-range"})}  # fmt: skip
    drawn, before = (xr.Dataset({name: (("y", "x"), np.abs(picture), {"long_name": what})}, axes_of)
                     for name, picture in (("intensity", intensity), ("initial", initial)))  # fmt: skip
    if np.iscomplexobj(initial):
        before["phase"] = ("y", "x"), phase_of(initial), {"units": "rad", "long_name": "phase of the image"}
    tables = {"/objects": _objects(points), "/mirrors": _mirrors(tree, points, found.transparent_walls)}
    return xr.DataTree.from_dict({"/": drawn.assign_attrs(attrs), "/initial": before} | tables)


def _remark(
    image: xr.DataArray,
    found: Found,
    points: Points,
    settings: FoldSettings,
    given: int | None,
    from_above: float | None,
) -> str:
    """Why there is no mirror, unless none was wanted; with mirrors, in which of them the radar sees itself, how many
    points lie near or beyond a caustic, and of how many it is guessed or doubtful whether they passed through a wall.
    """
    if not found.tree.mirrors:
        wanted = given != 0 and settings.generations != 0
        return _without_mirrors(image, found, settings, given, from_above) if wanted else ""
    own = found.explained.take(found.explanation == ITSELF)
    through = found.sight.through(own)
    said = [
        f"the radar sees itself in mirror {chain_name(found.sight.chain[index])}, "
        f"{np.median(own.range[through == index]):.3g} m away, and leaves this out"
        for index in np.unique(through)
    ]
    shown = points.confidence >= settings.min_confidence
    if beyond := int(np.count_nonzero((points.caustic != "") & shown)):
        where = "1 point lies" if beyond == 1 else f"{beyond} points lie"
        said.append(f"{where} near or beyond a caustic of a concave mirror, where the image is out of focus")
    guess, unsure = points.decided == BY_GEOMETRY, doubtful(points.passed)
    for which, how in (
        (guess, "is a guess from geometry, for there is one polarization"),
        (unsure & ~guess, "is doubtful, for their polarizations fit both"),
    ):
        if count := int(np.count_nonzero(which & shown)):
            what = "1 point" if count == 1 else f"{count} points"
            said.append(f"whether {what} passed through a wall or {'was' if count == 1 else 'were'} reflected {how}")
    return "; ".join(said)


def _without_mirrors(
    image: xr.DataArray, found: Found, settings: FoldSettings, given: int | None, from_above: float | None
) -> str:
    """Why none of the mirrors is used that were `given`, or none was found."""
    if given is not None:
        axes = [image[name] for name in ("x", "y", "z", "range") if name in image.dims]
        reach = ", ".join(f"{axis.name} {float(axis.min()):.3g} to {float(axis.max()):.3g} m" for axis in axes)
        which = "the given mirror is not" if given == 1 else f"none of the {given} given mirrors is"
        return f"{which} in the radar's sight within the image, {reach}; give metres, as the image shows them"
    form, long = ("straight row", "long") if "azimuth" not in image.dims else ("flat sheet", "wide and as much high")
    if from_above is not None:
        why = (
            f"the radar looks down by {from_above:.0f} degrees, where a wall shows in itself only the ground at its "
            "foot; give mirrors to fold all the same"
        )
    elif found.echoes.strong.any():
        why = f"no {form} of echoes is {settings.minimum_length:.3g} m {long} and stands out of its surroundings"
    else:
        why = "no echo stands out of noise and side lobes"
    return f"no mirror was found: {why}; the scene is shown unfolded"


def _objects(points: Points) -> xr.Dataset:
    """The table of points; it has columns on caustics and on half-transparent walls only where there are any."""
    axes = "xyz"[: points.position.shape[1]]
    data: dict[str, Any] = {
        axis + suffix: ("point", place, {"units": "m", "long_name": text})
        for suffix, places, text in (("", points.position, "folded position"),
                                     ("_initial", points.initial, "position before folding"),
                                     ("_error", points.error.astype(np.float32), "standard error"))
        for axis, place in zip(axes, places.T, strict=True)
    }  # fmt: skip
    texts = {
        "amplitude": "",
        "bounces": "mirrors on the way, 0 = line of sight",
        "chain": "indices of the mirrors from the root",
        "surface": "object, or face of a mirror",
        "confidence": f"probability that something stands within {TRUE_CELLS} resolution cells",
        "confocal": "share that came back as it went",
        "explanation": "why no object stands where the echo is seen",
        "interpolated": "no echo, but a gap between two of them",
    }
    if (points.growth != 1.0).any():
        texts["growth"] = "of the cell across, by curved mirrors"
        texts["caustic"] = "near or beyond a caustic of a concave mirror"
    if np.isfinite(points.passed).any():
        texts["passed"] = "probability that it passed through the wall instead of being reflected"
        texts["wall"] = "chain of the wall that it passed through"
        texts["decided"] = "by what: polarization, or geometry, which is a guess"
    held = {**vars(points), "surface": np.where(points.mirror == "", "object", "mirror")}
    for name, text in texts.items():
        values = held[name].astype(np.float32) if held[name].dtype == np.float64 else held[name]
        data[name] = ("point", values, {"long_name": text} if text else {})
    # As coordinates, the places of the points replace the axes x and y that the table would inherit from the pictures.
    return xr.Dataset(data).set_coords(list(axes))


def _pane(mirror: Mirror, transparent_walls: Sequence[TransparentWall]) -> dict[str, float]:
    """Permittivity and thickness [m] of a half-transparent wall, with their standard errors; NaN for other walls."""
    pane = next((wall.pane for wall in transparent_walls if wall.mirror is mirror), None)
    names = "permittivity", "permittivity_error", "thickness", "thickness_error"
    if pane is None:
        return dict.fromkeys(names, np.nan)
    found = pane.permittivity.real, pane.permittivity_error, pane.thickness, pane.thickness_error
    return dict(zip(names, found, strict=True))


def _mirrors(tree: MirrorTree, points: Points, transparent_walls: Sequence[TransparentWall] = ()) -> xr.Dataset:
    """The table of mirrors: each one in the unfolded image and at its true place."""
    nodes = [node for node in tree.walk() if node.way]
    curved = any(node.way[-1].curved for node in nodes)
    any_overhang = any(any(node.way[-1].overhang) for node in nodes)
    any_pane = any(wall.pane is not None for wall in transparent_walls)
    index = {(): -1} | {node.chain: i for i, node in enumerate(nodes)}

    def own_place(mirror: Mirror, fold: Fold) -> dict[str, Any]:
        """Columns of a mirror's place after the map `fold`, with the middle of its face if any mirror is curved."""
        middle = dict(zip(("xm", "ym", "zm"), fold(mirror.center[None])[0], strict=False)) if curved else {}
        flat = dict.fromkeys(("axis_x", "axis_y", "axis_z"), 0.0) if "zm" in middle else {}
        return flat | mirror.columns(fold) | middle

    def row(node: MirrorTree) -> dict[str, Any]:
        mirror, parent, chain = node.way[-1], node.chain[:-1], chain_name(node.chain)
        own = own_place(mirror, tree.fold)
        own |= {f"folded_{name}": value for name, value in own_place(mirror, node.face_fold).items()}
        own |= {"parent": np.int32(index[parent]), "generation": np.int32(node.generation), "chain": chain}
        own |= {"confidence": mirror_confidence(points, chain)}
        own |= {name: getattr(mirror, name) for name in ("strength", "angle_error", "offset_error", "fill", "depth")}
        own |= dict(zip(FOLDED_ERRORS, node.errors, strict=True))
        if curved:
            own |= {"curvature": mirror.curvature, "curvature_error": mirror.curvature_error}
        if any_overhang:
            own |= dict(zip(OVERHANG_COLUMNS, mirror.overhang, strict=True))
        return own | (_pane(mirror, transparent_walls) if any_pane else {})

    # Without mirrors the table still has its columns, empty.
    example = replace(tree, way=(example_mirror(tree.objects.position.shape[1]),), chain=(0,))
    return _table([row(node) for node in nodes or [example]]).isel(mirror=slice(len(nodes)))


def _table(rows: Sequence[dict[str, Any]]) -> xr.Dataset:
    """The table of mirrors, from the columns of each by name."""
    data: dict[str, Any] = {}
    for name in rows[0]:
        values = np.array([row[name] for row in rows])
        unit = MIRROR_UNITS.get(name, "1" if "normal" in name or "axis" in name else "m")
        data[name] = (("mirror", "corner")[: values.ndim], values, {} if values.dtype.kind in "iU" else {"units": unit})
    return xr.Dataset(data)
