"""Step 2 of the algorithm: the radar's own view, the echoes in it, and the mirrors among them.

This is the only file of step 2 that chooses between the functions for images and those for volumes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from hashlib import sha256
from typing import Any, cast

import numpy as np
import xarray as xr

from mirrorfold.common.facts import VOLUME, VOXELS, doubt_angles
from mirrorfold.common.threads import one_thread
from mirrorfold.common.types import UNSEEN, Array, Index
from mirrorfold.detection import image_echoes, volume_echoes
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.curved import dimmed, gains
from mirrorfold.detection.mirrors.known_mirrors import is_round, known_mirrors
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.mirrors.mirror import WALL_CELLS, WALL_WAVELENGTHS, Mirror
from mirrorfold.detection.mirrors.plane_mirror import PlaneMirror
from mirrorfold.detection.search import lines, planes
from mirrorfold.detection.search.arcs import find_arcs
from mirrorfold.detection.search.round_sheets import find_round_sheets
from mirrorfold.detection.views.image_to_view import to_image_view
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.detection.views.volume_view import VolumeView, to_volume_view
from mirrorfold.errors import InputError

NEAREST, MIDDLE = 0.1, 0.5
"""The resolution cell of a scene is that at the range within which this share of the strong echoes lies: in an image,
and in a volume."""

STEEPEST = 26.6
"""Angle [degree] below the horizon at which the radar sees the scene, up to which its image is a floor plan in which
mirrors are sought. A wall of height H hides only what lies on the ground up to ``H / tan(angle)`` behind it, and shows
as much of the ground in itself: here 2 H. What looks like a wall from higher up is a row of other bright things, such
as parked cars."""

MOST_SEARCHES = 100
"""Number of searches for mirrors whose results a view keeps."""


def see(image: xr.DataArray, *, normalization: str | None = None) -> View:
    """The radar's own view of an image (y, x), of voxels (z, y, x), or of a raster volume (range, azimuth, elevation).

    Voxels are seen from above, by the strongest of each column. The `normalization`, "r", "r2", "none" or "beam",
    undoes the decay of amplitudes with range, so that all ranges can be compared.

    Raises
    ------
    InputError
        If the image or the normalization cannot be used.
    """
    if isinstance(image, xr.DataArray) and image.dims == VOLUME:
        view = to_volume_view(image, normalization=normalization)
        doubt_angles(image, "image")
        return view
    if isinstance(image, xr.DataArray) and image.dims == VOXELS:  # the strongest voxel of each column
        image = abs(image).max("z", skipna=False, keep_attrs=True).assign_coords(z=image["z"].mean())
    return to_image_view(image, normalization=normalization)


def find_echoes(
    view: View, *, threshold_db: float | None = None, published: bool = False, through: Sequence[Mirror] = ()
) -> Echoes:
    """The echoes of a view: what exceeds the noise, the side lobes of brighter echoes, and the threshold. May be empty.

    Parameters
    ----------
    view : View
    threshold_db : float [dB], optional
        Threshold of strong echoes, relative to the robust reference echo; by default -18 for images and -26 for
        volumes.
    published : bool
        As in the published algorithm: every pixel above the threshold, relative to the brightest pixel, is an echo.
    through : sequence of Mirror, optional
        Known mirrors. Curved ones dim the echoes behind them, so that the threshold is lower there.
    """
    curved = [mirror for mirror in through if mirror.curved]
    if isinstance(view, ImageView):
        level = image_echoes.THRESHOLD_DB if threshold_db is None else threshold_db
        if published:
            return image_echoes.find_pixels(view, threshold_db=level)
        return image_echoes.find_ridges(view, threshold_db=level, gain=gains(view, curved) if curved else None)
    volume = cast(VolumeView, view)
    level = volume_echoes.THRESHOLD_DB if threshold_db is None else threshold_db
    if published:
        return volume_echoes.find_voxels(volume, threshold_db=level)
    return dimmed(volume_echoes.find_runs(volume, threshold_db=level), view, curved)


def find_mirrors(
    view: View, echoes: Echoes, *, minimum_length: float | None = None, tested: bool = True, known: Array | None = None
) -> Sequence[Mirror]:
    """The mirrors of a view: straight rows or flat sheets among the visible echoes.

    The view keeps the results, because the rounds of steps 2 to 4 often repeat a search.

    Parameters
    ----------
    view : View
    echoes : Echoes
    minimum_length : float [m], optional
        Least length of a mirror; in a volume, its least width and height. By default as in `usual_settings`.
    tested : bool
        Whether a mirror must also be straight, filled with echoes and stand out of its surroundings; if not, it need
        only be long enough.
    known : (mirrors, 2, 2) or (mirrors, 4, 3) array [m], optional
        Given mirrors, used instead of a search: the ends of lines, or the corners of planes. For curved ones see
        `mirrorfold.detection.mirrors.known_mirrors.check_mirrors`.

    Raises
    ------
    InputError
        If the given mirrors are lines and the view that of a volume, or the reverse.
    """
    if known is not None and len(known) and known.shape[2] != view.dimensions:
        if any(is_round(points) for points in known):
            raise InputError(
                "mirrors: some are round in space, cylinders or spheres with a 'radius', and belong to a volume; give "
                "'start', 'through' and 'end' of an arc for the image of a floor plan"
            )
        wanted = "the two ends of lines (x, y)" if view.dimensions == 2 else "the four corners of planes (x, y, z)"
        raise InputError(f"mirrors: have {known.shape[1]} points of {known.shape[2]} numbers, expected {wanted} [m]")
    if known is not None:
        return known_mirrors(known, echoes, view)
    length = usual_settings(view, echoes)["minimum_length"] if minimum_length is None else minimum_length
    if (key := _digest(view, echoes, length, tested)) not in view.searches:
        if len(view.searches) >= MOST_SEARCHES:
            view.searches.clear()
        find: Callable[..., Sequence[Mirror]] = lines.find_lines if view.dimensions == 2 else planes.find_planes
        with one_thread():
            view.searches[key] = find(echoes, view, minimum_length=length, tested=tested)
    return list(view.searches[key])


def _digest(view: View, echoes: Echoes, *options: Any) -> bytes:
    """A digest of all that the result of a search for mirrors in a view depends on, but for the samples of the view."""
    digest = sha256(repr(options).encode())
    if isinstance(view, ImageView):
        digest.update(view.misplaced.tobytes())
    for field in fields(echoes):
        digest.update(np.asarray(getattr(echoes, field.name)).tobytes())
    return digest.digest()


def depression(view: View, echoes: Echoes) -> float:
    """Angle [degree] below the horizon at which the radar sees the middle of its strong echoes; 0 if there are
    none, and in a volume.
    """
    if not (isinstance(view, ImageView) and echoes.strong.any()):
        return 0.0
    return float(np.degrees(np.arctan2(view.height, echoes.range_up_to(MIDDLE))))


def find_curved_rows(view: View, echoes: Echoes, own: Index) -> Sequence[Mirror]:
    """Curved rows or sheets of echoes, which may be mirrors: arcs in an image, cylinders and spheres in a volume.

    `own` (n,) is the number of the mirror by way of which each echo is seen, or `ROOT`. Echoes with different numbers
    are searched separately; those that are `UNSEEN` are left out.
    """
    find: Callable[..., Sequence[Mirror]] = find_arcs if view.dimensions == 2 else find_round_sheets
    with one_thread():
        return [row for way in np.unique(own[own != UNSEEN]) for row in find(view, echoes.take(own == way))]


def usual_settings(view: View, echoes: Echoes) -> dict[str, float]:
    """Default values of those settings of folding that depend on the view, by name.

    Lengths [m] are multiples of one resolution cell of the scene. In an image, where cells grow with range, it is the
    cell at the nearest echoes; in a volume, whose beam is focused somewhere in the scene, the cell at the median range.
    """
    found, mirrors, share = (image_echoes, lines, NEAREST) if view.dimensions == 2 else (volume_echoes, planes, MIDDLE)
    cell = float(view.cell(echoes.range_up_to(share)))
    return {
        "threshold_db": found.THRESHOLD_DB,
        "minimum_length": mirrors.MINIMUM_CELLS * cell,
        "wall_margin": min(WALL_CELLS * cell, WALL_WAVELENGTHS * view.wavelength),
    }


def example_mirror(dimensions: int) -> Mirror:
    """A mirror of unit size at the origin, from which a table without mirrors takes the names of its columns."""
    if dimensions == 2:
        return LineMirror(np.zeros(2), np.array([1.0, 0.0]))
    square = np.array([[-0.5, 0.0, -0.5], [0.5, 0.0, -0.5], [0.5, 0.0, 0.5], [-0.5, 0.0, 0.5]])
    return PlaneMirror(np.zeros(3), np.array([0.0, -1.0, 0.0]), square, np.zeros(0, dtype=bool))
