"""Mirrors that the user gives, in the place of detected ones.

They come from a JSON file, in metres (or as texts with a unit, ``"98 cm"``) and in the coordinates of the unfolded
image, where a mirror that is seen through another one is a ghost itself. The lines and arcs of an image, and the
planes, cylinders (by both ends of the axis) and spheres of a volume, are written as::

    {"mirrors": [{"start": [x, y], "end": [x, y]}, {"start": [x, y], "through": [x, y], "end": [x, y]}, ...]}

    {"mirrors": [{"corners": [[x, y, z], [x, y, z], [x, y, z], [x, y, z]]},
                 {"start": [x, y, z], "end": [x, y, z], "radius": r}, {"center": [x, y, z], "radius": r}, ...]}
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mirrorfold.common.arcs import Arc, as_three_points, in_line
from mirrorfold.common.arguments import expect_unit, in_message
from mirrorfold.common.geometry import cross2
from mirrorfold.common.plausible import unplaced
from mirrorfold.common.reading import parsed, read_text
from mirrorfold.common.round_surfaces import RoundSurface
from mirrorfold.common.stopping import go_on
from mirrorfold.common.types import Array
from mirrorfold.common.units import mixes_units, parse_quantity, split_quantity
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.mirrors.mirror import Mirror, proving_echoes
from mirrorfold.detection.mirrors.plane_mirror import PlaneMirror
from mirrorfold.detection.mirrors.round_mirror import RoundMirror
from mirrorfold.detection.mirrors.seen_arcs import seen_parts
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.detection.views.volume_view import VolumeView
from mirrorfold.errors import InputError

SHORTEST = 1e-9
"""Least length of a mirror, as a share of its largest coordinate: below it, rounding errors decide its direction."""

FLATTEST = 0.01
"""Largest distance of the corners of a given plane from that plane, as a share of its size."""

LONGEST = 1000.0
"""Largest length of a mirror, in multiples of the largest range: longer mirrors were given in another unit."""

LARGEST_COUNT = 1000
"""Largest number of given mirrors: more are a mistake, not a room."""

EXAMPLE = '{"mirrors": [{"start": [0.4, 1.6], "end": [0.6, 0.9]}]}'


def check_mirrors(mirrors: ArrayLike, source: str = "mirrors") -> Array:
    """Check given mirrors, and return them as an array: ends of lines, (mirrors, 2, 2), or corners, (mirrors, 4, 3)
    [m].

    They may also be a list of dicts, as in the file. Where some are arcs, all get a third point between their ends,
    (mirrors, 3, 2); that of a line lies on the line. Round mirrors in space have four rows of three numbers in the
    place of corners: of a cylinder both ends of its axis, three times its radius, and NaN; of a sphere twice its
    center, three times its radius, and NaN.

    Raises
    ------
    InputError
        If the shape is none of these, a number is not finite, a mirror has no extent or is not flat, or stands there
        twice. The sentence begins with `source`.
    """
    expect_unit(source, mirrors, "m")
    rows = as_three_points(_rows(mirrors, source))
    try:
        given = np.array(rows)
        places = given.astype(float) if given.dtype.kind in "fiu" or not given.size else np.array(np.nan)
    except (TypeError, ValueError, OverflowError):
        places = np.array(np.nan)
    if places.shape[:1] == (0,):
        return np.empty((0, 2, 2))
    if places.ndim != 3 or places.shape[1:] not in ((2, 2), (3, 2), (4, 3)):
        found = in_message(mirrors) if places.ndim == 0 else f"an array of shape {places.shape}"
        raise InputError(
            f"{source}: expected for each mirror its two ends of two numbers, of an arc a point between them, too, or "
            f"in space its four corners of three numbers [m], got {found}"
        )
    if len(places) > LARGEST_COUNT:
        raise InputError(f"{source}: holds {len(places)} mirrors, expected at most {LARGEST_COUNT}")
    seen: dict[bytes, int] = {}
    for number, points in enumerate(places):
        mirror = f"{source}: mirror {number}"
        if (first := seen.setdefault(min(one.tobytes() for one in _alike(points + 0.0)), number)) != number:  # no -0.0
            raise InputError(f"{mirror} is mirror {first} once more, and nothing is seen by way of both; leave it out")
        wrong = unplaced(points[:3] if is_round(points) else points)
        if wrong is not None:
            raise InputError(f"{mirror} has a place that {wrong}, expected numbers in metres")
        check = _check_round if is_round(points) else _check_plane if len(points) == 4 else _check_row
        check(points, mirror)
    return places


def _check_round(points: Array, mirror: str) -> None:
    """Refuse a cylinder or a sphere (4, 3), in the form of `check_mirrors`, without a radius."""
    if not (points[2] == points[2, 0]).all() or points[2, 0] <= SHORTEST * np.abs(points[:2]).max():
        raise InputError(f"{mirror} has the radius {points[2, 0]:g}, expected a length above zero in metres")


def _check_plane(corners: Array, mirror: str) -> None:
    """Refuse four corners (4, 3) that are not those of a flat, convex face."""
    spread = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)
    if spread[1] <= SHORTEST * np.abs(corners).max():
        raise InputError(f"{mirror} has no extent; give four different corners, or leave it out")
    if spread[2] > FLATTEST * spread[0]:
        raise InputError(f"{mirror} is not flat; give four corners of one plane")
    if not _goes_around(corners):
        raise InputError(f"{mirror} has no convex outline; give its corners in their order around the face")


def _check_row(points: Array, mirror: str) -> None:
    """Refuse the ends (2, 2) of a line without length, and three points (3, 2) that do not define an arc."""
    if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[0] <= SHORTEST * np.abs(points).max():
        raise InputError(f"{mirror} has no length; give two different ends, or leave it out")
    if len(points) == 3:
        _check_arc(points, mirror)


def _alike(points: Array) -> list[Array]:
    """The points of a mirror in every order that describes the same mirror."""
    if is_round(points):
        return [points, points[[1, 0, 2, 3]]]
    turns = range(4) if len(points) == 4 else (0,)
    return [np.roll(points, turn, axis=0)[::step] for turn in turns for step in (1, -1)]


def _goes_around(corners: Array) -> bool:
    """Whether the outline through corners (4, 3) [m] of a plane turns to one side, as around a convex face."""
    offset = corners - corners.mean(axis=0)
    edges = (np.roll(offset, -1, axis=0) - offset) @ np.linalg.svd(offset)[2][:2].T
    turn = cross2(edges, np.roll(edges, -1, axis=0)) / np.sum(offset**2)
    return bool(turn.min() >= -FLATTEST or turn.max() <= FLATTEST)


def _check_arc(points: Array, mirror: str) -> None:
    """Refuse three points (3, 2), start, through and end, that do not define an arc."""
    start, through, end = points
    chord = end - start
    if np.linalg.norm(chord) <= SHORTEST * np.abs(points).max():
        raise InputError(f"{mirror} starts where it ends, and so could be any arc; give a full circle as two arcs")
    along = float((through - start) @ chord / (chord @ chord))
    if in_line(start, through, end) and not 0.0 < along < 1.0:
        raise InputError(f"{mirror} goes through a point in line with its ends, but not between them; give one between")


def is_round(points: Array) -> bool:
    """Whether a given mirror, in the form of `check_mirrors`, is a cylinder or a sphere."""
    return points.shape == (4, 3) and bool(np.isnan(points[3]).all())


def read_mirrors(path: str | Path) -> Array:
    """Read a JSON file of mirrors, as above, to an array in the form of `check_mirrors`.

    Raises
    ------
    InputError
        If the file is missing, is not JSON, or holds no mirrors, or only some numbers of a mirror have a unit.
    """
    text = read_text(path, "give a JSON file of mirrors")
    content = parsed(text, "JSON", str(path), f"expected {EXAMPLE}")
    mirrors = content.get("mirrors") if isinstance(content, dict) else None
    if not isinstance(mirrors, list):
        raise InputError(f"{path}: holds no list 'mirrors'; expected {EXAMPLE}")
    return check_mirrors([_in_metres(mirror, f"{path}: mirror {n}") for n, mirror in enumerate(mirrors)], str(path))


def _in_metres(mirror: Any, source: str) -> Any:
    """The entry of a mirror in a file, with numbers in metres in the place of texts such as ``"98 cm"``."""
    if mixes_units(list(mirror.values()) if isinstance(mirror, dict) else mirror):
        raise InputError(f"{source} has numbers with a unit and others without; give each its unit, as in '98 cm'")

    def read(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: read(item) for name, item in value.items()}
        if isinstance(value, list):
            return [read(item) for item in value]
        found = split_quantity(value) if isinstance(value, str) else None
        return parse_quantity(value, "length") if found is not None and found[1] else value

    try:
        return read(mirror)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None


FORMS: dict[frozenset[str], Callable[..., list[Any]]] = {
    frozenset(("start", "end")): lambda start, end: [start, end],
    frozenset(("start", "through", "end")): lambda start, through, end: [start, through, end],
    frozenset(("corners",)): lambda corners: corners,
    frozenset(("start", "end", "radius")): lambda start, end, radius: [start, end, [radius] * 3, [np.nan] * 3],
    frozenset(("center", "radius")): lambda center, radius: [center, center, [radius] * 3, [np.nan] * 3],
}
"""For the names of a mirror's entries in the file: the function that turns these into its points for
`check_mirrors`."""


def _rows(mirrors: Any, source: str) -> Any:
    """Turn mirrors as a file describes them, a list of dicts, into lists of points; leave anything else as it is."""
    if not isinstance(mirrors, list | tuple) or not any(isinstance(mirror, dict) for mirror in mirrors):
        return mirrors
    places = []
    for number, mirror in enumerate(mirrors):
        held = mirror if isinstance(mirror, dict) else {}
        form = FORMS.get(frozenset(held))
        if form is None:
            found = f"the entries {', '.join(map(repr, held))}" if held else "no entries"
            raise InputError(
                f"{source}: mirror {number} has {found}, expected 'start' and 'end' of a line, and of an arc 'through' "
                "between them; in space 'corners' of a plane, 'start', 'end' and 'radius' of a cylinder, or 'center' "
                "and 'radius' of a sphere"
            )
        places.append(form(**held))
    return places


def write_mirrors(mirrors: ArrayLike, path: str | Path) -> Path:
    """Write mirrors to a JSON file, which `read_mirrors` reads back to the last bit; return its path."""
    rows = [_entry(points) for points in check_mirrors(mirrors)]
    path = Path(path)
    path.write_text(json.dumps({"mirrors": rows}, indent=2) + "\n", encoding="utf-8")
    return path


def _entry(points: Array) -> dict[str, Any]:
    """The entry of the file for one given mirror."""
    place = points.tolist()
    if is_round(points):
        own = {"center": place[0]} if place[0] == place[1] else {"start": place[0], "end": place[1]}
        return {**own, "radius": place[2][0]}
    names = {2: ("start", "end"), 3: ("start", "through", "end")}
    return {"corners": place} if len(place) == 4 else dict(zip(names[len(place)], place, strict=True))


def known_mirrors(places: Array, echoes: Echoes, view: View) -> list[Mirror]:
    """Given mirrors, as `check_mirrors` returns them, as `Mirror` objects with their strength and fill.

    The strength is the median amplitude of the echoes on the mirror. Where there are none, it is the median amplitude
    of the image along the mirror; in a volume, zero. The errors are not known: NaN. Of an arc that the radar sees in
    parts, from outside and from inside, each part is a mirror.
    """
    reach = float(view.range[-1])
    for number, points in enumerate(places):
        size = float(np.ptp(points[:3], axis=0).max())
        if size > LONGEST * reach:
            raise InputError(
                f"mirrors: mirror {number} is {size:.3g} m long in an image that reaches {reach:.3g} m; give metres"
            )
    if isinstance(view, VolumeView):
        shapes: list[Mirror] = [_in_space(points, view, number) for number, points in enumerate(places)]
    else:
        shapes = _seen([_line_or_arc(points, view) for points in places])
    mirrors: list[Mirror] = []
    for mirror in shapes:
        go_on()
        on_it = echoes.take(mirror.own(view, echoes))
        strength = float(np.median(on_it.amplitude)) if len(on_it) else 0.0
        if isinstance(view, ImageView) and not len(on_it):
            strength = float(np.sqrt(np.median(view.power_at(*view.to_polar(mirror.places(view))))))
        fill = mirror.filled(view, proving_echoes(on_it, view))
        mirrors.append(replace(mirror, strength=strength, fill=fill, angle_error=np.nan, offset_error=np.nan))
    return mirrors


def _seen(given: list[LineMirror | ArcMirror]) -> list[Mirror]:
    """The lines as they are, and those parts of the arcs that the radar sees."""
    parts = iter(seen_parts([mirror for mirror in given if isinstance(mirror, ArcMirror)]))
    return [part for mirror in given for part in (next(parts) if isinstance(mirror, ArcMirror) else [mirror])]


def _line_or_arc(points: Array, view: View) -> LineMirror | ArcMirror:
    """The line between two points (2, 2) [m], or the arc through three points (3, 2) [m]."""
    start, end = points[[0, -1]]
    if len(points) == 2 or in_line(*points):
        return LineMirror(start, end)
    arc = Arc.through(*points)
    first = arc.first if arc.turn >= 0.0 else arc.last  # counter-clockwise
    return ArcMirror(middle=arc.center, radius=arc.radius, first=first, span=abs(arc.turn), radar=view.radar)


def _in_space(points: Array, view: VolumeView, number: int) -> PlaneMirror | RoundMirror:
    """The plane, cylinder or sphere of given mirror `number`, (4, 3), in the form of `check_mirrors`."""
    if not is_round(points):
        return _plane(points, view)
    start, end, radius = points[0], points[1], float(points[2, 0])
    axis = end - start
    length = float(np.linalg.norm(axis))
    shape = RoundSurface(0.5 * (start + end), axis / length if length else axis, radius)
    if shape.beside(view.radar) <= 0.0:
        what = "around the radar or straight above or below it, expected a face that is seen from outside"
        raise InputError(f"mirrors: mirror {number} is {what}")
    range_ = shape.met(view.radar, view.sight)
    met = view.radar + range_[:, None] * view.sight
    with np.errstate(invalid="ignore"):
        beams = np.isfinite(range_) & (np.abs(shape.along(met)) <= (0.5 * length if length else np.inf))
    # If no beam meets it, its extent is the point nearest to the radar.
    outline = met[beams] if beams.any() else shape.nearest(np.stack([view.radar, view.radar]))
    return RoundMirror(outline, beams, shape, view.radar, view.beam)


def _plane(outline: Array, view: VolumeView) -> PlaneMirror:
    """The plane mirror with four corners (4, 3) [m], given in order around a convex face."""
    center = outline.mean(axis=0)
    normal = np.linalg.svd(outline - center)[2][2]
    normal = normal * (-np.sign((center - view.radar) @ normal) or 1.0)
    # A point inside a convex outline lies on the same side of all edges.
    edges = np.roll(outline, -1, axis=0) - outline
    with np.errstate(invalid="ignore"):  # beams that do not meet the plane meet it at infinity
        met = view.radar + view.meets(normal, center)[:, None] * view.sight
        sides = np.cross(edges[:, None], met - outline[:, None]) @ normal
    return PlaneMirror(center, normal, outline, np.all(sides >= 0.0, axis=0) | np.all(sides <= 0.0, axis=0))
