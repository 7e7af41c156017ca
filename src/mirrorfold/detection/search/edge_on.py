"""Step 2 in the floor plan, once more: mirrors that the radar sees edge-on.

A wall along which the radar looks sends little back, so that its echoes make no row; but at grazing incidence it
reflects most. The image of another wall in it looks like one more wall. That other wall and its image are symmetric
about the mirror. So the mirror lies on one of the two lines that halve the angle between them, and on that line the
radar's image holds a faint row of power.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.geometry import reflect, turned, unit
from mirrorfold.common.types import Array
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.line_mirror import LineMirror, profile_count
from mirrorfold.detection.search.fit import refined
from mirrorfold.detection.search.lines import PROFILE
from mirrorfold.detection.search.rows import GAP_CELLS
from mirrorfold.detection.views.image_view import ImageView

LARGEST_GRAZING_DEG = 45.0
"""Largest angle [degree] between any line of sight and such a wall. Walls that face the radar more are found by their
own echoes."""

SMALLEST_TURN_DEG = 2.0
"""Least angle [degree] between a wall and its image: lines that are more parallel cross too far away to locate the
mirror between them."""

SEEN_TWICE = 0.75
"""Least share of the image of a wall that must lie, once reflected back, on the part of the wall that the radar
sees."""

CONTRAST = 2.7
"""Least median amplitude along the faint line, relative to that of lines beside it. At such walls it was 60 or more in
ray scenes; in full waves 13 or more, but for one case of 3.1, where wrapped echoes fill one side. On lines that halve
the angle between two walls by chance it was at most 2.3."""

FADED = ratio_of(-20.0)
"""Amplitude, relative to the median of the line, at which the line ends (20 dB), however little the image holds beside
it: speckle fades by less."""

ON_LINE, BESIDE = (-0.3, 0.0, 0.3), (1.5, 2.0, 2.5, 3.0)
"""Distances from the line, in resolution cells across it, at which the amplitude on the line is taken; and at which, on
either side, that beside it."""

SEARCH_ERRORS, STEPS = 3.0, 8
"""Largest distance at which the faint line is sought from where wall and image say that it is, in standard errors, and
at most as many resolution cells; and steps per cell. If wall and image are nearly parallel, their crossing is known to
about a cell."""

BEYOND = 0.5
"""How far the line is followed towards the radar beyond the part of the mirror in which the image is seen, as a
share of that part."""

SAMPLES = 32
"""Number of lines of sight that are followed to an image."""


def edge_on(
    mirrors: Sequence[LineMirror], rows: Sequence[LineMirror], view: ImageView, echoes: Echoes, shortest: float
) -> list[LineMirror]:
    """Mirrors seen edge-on, each between a wall and the image of that wall in the mirror.

    Any of the `mirrors`, which are in line of sight, may be the wall, and any other one its image; so may `rows` of
    echoes in line of sight that are too short for mirrors. `shortest` [m] is the least length of a mirror: of the part
    in which the image is seen, or of the faint line. The mirrors are as long as that line stands out, and at most one
    for each image, that of the highest contrast.
    """
    found: list[LineMirror] = []
    for image in (*mirrors, *rows):
        best, highest = None, 0.0
        for line in (line for wall in mirrors if wall is not image for line in _between(wall, image, view)):
            between = _on_faint_line(line, view)
            contrast = between.strength / max(float(_beside(between, view)), float(np.finfo(float).tiny))
            if contrast < CONTRAST or contrast <= highest:
                continue
            # The image is seen in a part of the mirror; the faint line shows all of it.
            lit = _as_far_as_lit(between, view)
            if max(between.length, lit.length) >= shortest:
                best, highest = lit, contrast
        if best is not None:
            found.append(replace(best, fill=best.filled(view, echoes.take(best.own(view, echoes)))))
    return found


def _between(wall: LineMirror, image: LineMirror, view: ImageView) -> list[LineMirror]:
    """Up to two mirrors in which the radar would see the wall where it sees the image."""
    sides = np.stack([wall.direction, -image.direction], axis=1)
    if abs(np.linalg.det(sides)) < np.sin(np.radians(SMALLEST_TURN_DEG)):
        return []
    crossing = wall.start + np.linalg.solve(sides, image.start - wall.start)[0] * wall.direction
    places = image.at(np.linspace(0.0, image.length, SAMPLES))
    sight = places - view.radar
    found = []
    for sign in (1.0, -1.0):
        along = unit(wall.direction + sign * image.direction)
        normal = turned(along)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (crossing - view.radar) @ normal / (sight @ normal)  # of the way to the image
        in_front = (share > 0.0) & ((1.0 - share) * np.linalg.norm(sight, axis=1) > 2.0 * view.range_cell)
        grazing = np.abs(sight @ normal) < np.sin(np.radians(LARGEST_GRAZING_DEG)) * np.linalg.norm(sight, axis=1)
        if not (in_front & grazing).all():
            continue
        seen = wall.along(reflect(places, crossing, normal))
        if np.mean((seen >= 0.0) & (seen <= wall.length)) >= SEEN_TWICE:
            first, last = view.radar + share[[0, -1], None] * sight[[0, -1]]
            found.append(_with_errors(LineMirror(first, last), wall, image, crossing))
    return found


def _with_errors(mirror: LineMirror, wall: LineMirror, image: LineMirror, crossing: Array) -> LineMirror:
    """The mirror with its standard errors, which follow from those of the wall and the image that cross at `crossing`.

    Its angle is the mean of theirs. If it moves by d, the image moves by ``2 d``, of which only the component square to
    the wall can be measured: its offset has half the error of theirs, over the cosine between mirror and wall.
    """
    angle = 0.5 * float(np.hypot(wall.angle_error, image.angle_error))
    across = float(np.abs(mirror.normal @ wall.normal))  # not zero: the lines are not parallel
    moved = 0.5 * float(np.hypot(wall.offset_error, image.offset_error)) / across
    swung = np.radians(angle) * float(np.linalg.norm(mirror.center - crossing))
    return replace(mirror, angle_error=angle, offset_error=float(np.hypot(moved, swung)))


def _on_faint_line(mirror: LineMirror, view: ImageView) -> LineMirror:
    """The mirror, moved to the weighted mean of its own position and that of the faint line in the image.

    The weights are ``1 / variance``; only the position changes, not the direction.
    """
    across = float(view.extent(mirror.center[None], mirror.normal)[0])
    count = int(np.ceil(SEARCH_ERRORS * min(mirror.offset_error / across, 1.0) * STEPS))
    cells = (np.arange(-count, count + 1) / STEPS).tolist()
    brightest = across * cells[np.argmax(np.median(_levels(mirror, view, cells), axis=0))]
    line, _ = refined(mirror.moved(mirror.normal, mirror.center + brightest * mirror.normal), view, *PROFILE)
    both = float(np.hypot(mirror.offset_error, line.offset_error))
    towards = (mirror.offset_error / both) ** 2 * mirror.beside(line.center) * mirror.normal
    moved = mirror.moved(mirror.normal, mirror.center + towards)
    level = float(np.median(_levels(moved, view, ON_LINE)))
    return replace(moved, offset_error=mirror.offset_error * line.offset_error / both, strength=level)


def _as_far_as_lit(mirror: LineMirror, view: ImageView) -> LineMirror:
    """The longest part of the mirror where the faint line stands out; the whole mirror if it stands out nowhere.

    The mirror may end earlier than its image does, which may go on in another row on the same line. Towards the radar
    it may be longer: there its own echoes are brightest, and hide what it shows.
    """
    near, far = sorted(mirror.ends, key=lambda end: float(np.linalg.norm(end - view.radar)))
    longer = replace(mirror, start=near + BEYOND * (near - far), end=far)
    on_it = np.median(_levels(longer, view, ON_LINE), axis=1)
    shown = on_it > CONTRAST * _beside(longer, view, axis=1)
    if not shown.any():
        return mirror
    lit = np.flatnonzero(shown & (on_it > FADED * np.median(on_it[shown])))
    place = longer.length * lit / (len(on_it) - 1)
    gap = GAP_CELLS * float(view.extent(mirror.center[None], mirror.direction)[0])
    longest = max(np.split(place, np.flatnonzero(np.diff(place) > gap) + 1), key=np.ptp)
    part = longer.part(float(longest[0]), float(longest[-1]))
    return replace(part, strength=float(np.median(_levels(part, view, ON_LINE)))) if part.length else mirror


def _beside(mirror: LineMirror, view: ImageView, axis: int | None = None) -> Array:
    """Median amplitude beside the line, on its brighter side; with `axis` 1 at each place along it, (n,)."""
    sides = [np.median(_levels(mirror, view, [side * cells for cells in BESIDE]), axis=axis) for side in (-1.0, 1.0)]
    return np.max(sides, axis=0)


def _levels(mirror: LineMirror, view: ImageView, cells: Sequence[float]) -> Array:
    """Amplitudes at places along the line, at distances `cells` (m,) beside it in resolution cells, (n, m)."""
    places = mirror.at(np.linspace(0.0, mirror.length, profile_count(mirror.length, view)))
    across = np.outer(view.extent(places, mirror.normal), cells)
    points = places[:, None] + across[..., None] * mirror.normal
    return np.sqrt(view.power_at(*view.to_polar(points)))
