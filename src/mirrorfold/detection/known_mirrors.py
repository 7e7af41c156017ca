"""Mirrors that are known or drawn, in the place of detected ones.

The file of such mirrors is JSON, in metres and in the coordinates of the unfolded image, where a mirror seen through
another is a ghost itself: ``{"mirrors": [{"start": [x, y], "end": [x, y]}, ...]}`` for an image,
``{"mirrors": [{"corners": [[x, y, z], [x, y, z], [x, y, z], [x, y, z]]}, ...]}`` for a volume.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mirrorfold.common.types import Array
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.line_mirror import LineMirror, line_cell
from mirrorfold.detection.lines import filled
from mirrorfold.detection.plane_mirror import PlaneMirror, plane_ranges
from mirrorfold.detection.volume_view import VolumeView
from mirrorfold.errors import InputError

SHORTEST = 1e-9
"""Of the coordinates of its ends: a given mirror that is shorter has no direction but that of rounding errors."""

FLATTEST = 0.01
"""How far the corners of a given plane may lie off it, as a share of its size."""

LARGEST_COUNT = 1000
"""More mirrors than this are no room but a mistake."""

SAMPLES = 64
"""Places along a line where the image tells how strong it is."""

EXAMPLE = '{"mirrors": [{"start": [0.4, 1.6], "end": [0.6, 0.9]}]}'


def check_mirrors(mirrors: ArrayLike, source: str = "mirrors") -> Array:
    """Given mirrors as an array: of both ends of lines, (mirrors, 2, 2), or of four corners, (mirrors, 4, 3) [m].

    Raises
    ------
    InputError
        If they are neither, hold a number that is not finite, or a mirror has no extent or is not flat; `source` names
        them.
    """
    try:
        places = np.array(mirrors, dtype=float)
    except (TypeError, ValueError):
        places = np.array(np.nan)
    if places.shape[:1] == (0,):
        return np.empty((0, 2, 2))
    if places.ndim != 3 or places.shape[1:] not in ((2, 2), (4, 3)):
        found = "something else" if places.ndim == 0 else f"an array of shape {places.shape}"
        raise InputError(
            f"{source}: expected for each mirror its two ends of two numbers, or in space its four corners of three "
            f"numbers [m], got {found}"
        )
    if len(places) > LARGEST_COUNT:
        raise InputError(f"{source}: holds {len(places)} mirrors, expected at most {LARGEST_COUNT}")
    for number, points in enumerate(places):
        if not np.isfinite(points).all():
            raise InputError(f"{source}: mirror {number} has a place that is not finite, expected numbers in metres")
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if spread[points.shape[1] - 2] <= SHORTEST * np.abs(points).max():
            what = "length; give two different ends" if points.shape[1] == 2 else "extent; give four different corners"
            raise InputError(f"{source}: mirror {number} has no {what}, or leave it out")
        if points.shape[1] == 3 and spread[2] > FLATTEST * spread[0]:
            raise InputError(f"{source}: mirror {number} is not flat; give four corners of one plane")
    return places


def read_mirrors(path: str | Path) -> Array:
    """Read a file of mirrors.

    Parameters
    ----------
    path : path
        JSON, see above.

    Returns
    -------
    (mirrors, 2, 2) or (mirrors, 4, 3) array [m]

    Raises
    ------
    InputError
        If the file is missing, is not JSON, or holds something else.
    """
    path = Path(path)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: does not exist; give a JSON file of mirrors") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give a JSON file of mirrors") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not JSON ({str(error).splitlines()[0]}); expected {EXAMPLE}") from None
    mirrors = content.get("mirrors") if isinstance(content, dict) else None
    if not isinstance(mirrors, list):
        raise InputError(f"{path}: holds no list 'mirrors'; expected {EXAMPLE}")
    places = []
    for number, mirror in enumerate(mirrors):
        if isinstance(mirror, dict) and "corners" in mirror:
            places.append(mirror["corners"])
        elif isinstance(mirror, dict) and {"start", "end"} <= set(mirror):
            places.append([mirror["start"], mirror["end"]])
        else:
            raise InputError(f"{path}: mirror {number} has no 'start' and 'end'; expected {EXAMPLE}")
    return check_mirrors(places, str(path))


def write_mirrors(mirrors: ArrayLike, path: str | Path) -> Path:
    """Write a file of mirrors that `read_mirrors` reads back to the last bit; returns its path."""
    rows: list[dict[str, Any]] = [
        {"start": points[0].tolist(), "end": points[1].tolist()} if len(points) == 2 else {"corners": points.tolist()}
        for points in check_mirrors(mirrors)
    ]
    path = Path(path)
    path.write_text(json.dumps({"mirrors": rows}, indent=2) + "\n", encoding="utf-8")
    return path


def known_lines(ends: Array, echoes: Echoes, view: ImageView) -> list[LineMirror]:
    """Lines as mirrors, with what the image says of each.

    Parameters
    ----------
    ends : (mirrors, 2, 2) array [m]
    echoes : Echoes
    view : ImageView

    Returns
    -------
    list of LineMirror
        Strength is the median amplitude of the echoes on the line, or of the image along it where there are none.
        Their errors are not known: NaN.
    """
    mirrors = []
    for start, end in ends:
        line = LineMirror(start, end, angle_error=np.nan, offset_error=np.nan)
        across, _ = line_cell(view, echoes.position, line.direction)
        position = line.along(echoes.position)
        on_it = (np.abs(line.beside(echoes.position)) <= across) & (position >= 0.0) & (position <= line.length)
        if on_it.any():
            strength = float(np.median(echoes.amplitude[on_it]))
        else:
            along = start + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (end - start)
            strength = float(np.median(view.at(*view.to_polar(along))))
        mirrors.append(replace(line, strength=strength, fill=filled(echoes.position[on_it], line, view)))
    return mirrors


def known_planes(corners: Array, echoes: Echoes, view: VolumeView) -> list[PlaneMirror]:
    """Planes as mirrors, with what the volume says of each.

    Parameters
    ----------
    corners : (mirrors, 4, 3) array [m]
        Of convex faces, in order around each.
    echoes : Echoes
    view : VolumeView

    Returns
    -------
    list of PlaneMirror
        Strength is the median amplitude of the echoes on the face, zero where there are none; fill the share of its
        beams that show one. Their errors are not known: NaN.
    """
    mirrors = []
    for outline in corners:
        center = outline.mean(axis=0)
        normal = np.linalg.svd(outline - center)[2][2]
        normal = normal * (-np.sign((center - view.radar) @ normal) or 1.0)
        met = view.radar + plane_ranges(view, normal, center)[:, None] * view.sight
        # Inside a convex outline a point lies on one side of all its edges.
        edges = np.roll(outline, -1, axis=0) - outline
        with np.errstate(invalid="ignore"):
            sides = np.stack(
                [np.cross(edge, met - corner) @ normal for edge, corner in zip(edges, outline, strict=True)]
            )
            beams = np.all(sides >= 0.0, axis=0) | np.all(sides <= 0.0, axis=0)
        mirror = PlaneMirror(center, normal, outline, beams, angle_error=np.nan, offset_error=np.nan)
        _, own, across = mirror.near(view, echoes)
        on_it = own & (np.abs(mirror.beside(echoes.position)) <= across)
        strength = float(np.median(echoes.amplitude[on_it])) if on_it.any() else 0.0
        fill = np.unique(echoes.direction[on_it]).size / max(int(beams.sum()), 1)
        mirrors.append(replace(mirror, strength=strength, fill=min(fill, 1.0)))
    return mirrors
