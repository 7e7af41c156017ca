"""Voxels of the folded scene, and the grid of their plan view."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from mirrorfold.common.types import Array
from mirrorfold.detection.volume_view import VolumeView
from mirrorfold.focusing.range_profiles import at_point
from mirrorfold.folding.points import Points
from mirrorfold.tree.lines_of_sight import hidden_at, through_at

PIXEL_RADII = 0.6
"""Pixels of the plan view, in radii of the beam where it is narrowest; its vertical columns are sampled twice that."""

BORDER_RADII = 9.0
"""Space around the points in the plan view, in the same radii."""

LARGEST_GRID = 60_000_000
"""Voxels that are looked at for the plan view; the pixels grow beyond it."""


def voxel_axes(points: Points, view: VolumeView) -> tuple[Array, Array, Array]:
    """Pixels x, y and z [m] around all points, before and after folding; a few where there are none."""
    radius = float(view.width(view.range[view.range > 0.0]).min()) if view.beam is None else view.beam[0]
    pixel, border = PIXEL_RADII * radius, BORDER_RADII * radius
    limits = []
    for i in range(3):
        values = np.concatenate([points.position[:, i], points.initial[:, i]])
        limits.append((values.min() - border, values.max() + border) if values.size else (0.0, 1.0))
    cells = np.prod([high - low for low, high in limits]) / (2.0 * pixel**3)
    pixel *= max(1.0, float(cells / LARGEST_GRID) ** (1.0 / 3.0))
    x, y, z = (
        step * np.arange(np.floor(low / step), np.ceil(high / step) + 1)
        for (low, high), step in zip(limits, (pixel, pixel, 2.0 * pixel), strict=True)
    )
    return x, y, z


def volume_tables(view: VolumeView, z: Array) -> tuple[Any, ...]:
    """What `draw_row` needs to know of a volume and of heights z [m] in equal steps."""
    angles = np.radians(np.array([[a[0], a[-1], np.diff(a).mean()] for a in (view.azimuth, view.elevation)]))
    step = float(z[1] - z[0]) if z.size > 1 else 1.0
    sample = float(view.range[0]), view.dr, view.beside_steps(view.range)
    return view.amplitude, view.gain.astype(np.float32), float(z[0]), step, view.radar, angles, *sample


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def draw_row(  # type: ignore[no-untyped-def]
    x, y, linear, shift, number, crossing, through, begin, level, empty, margin, blobs, out,
    amplitude, gain, z, step_z, radar, angles, first, step, side,
):  # fmt: skip
    """Voxels of one y, (x, z): the largest amplitude with which a chain of mirrors shows them, see `pictures.draw`."""
    side_low, side_high = np.tan(angles[0, 0]), np.tan(angles[0, 1])
    up_low, up_high = np.tan(angles[1, 0]), np.tan(angles[1, 1])
    columns, rows = amplitude.shape[:2]
    for w in range(number.size):
        a = linear[w]
        for j in range(x.size):
            px = a[0, 0] * x[j] + a[0, 1] * y + shift[w, 0] - radar[0]
            py = a[1, 0] * x[j] + a[1, 1] * y + shift[w, 1] - radar[1]
            pz = a[2, 0] * x[j] + a[2, 1] * y + shift[w, 2] - radar[2]
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
                if through_at(crossing, through, r - margin, beam) != number[w]:
                    continue
                value = at_point(amplitude, az, el, k) * gain[int(k)]
                if value <= out[j, i] or value <= hidden_at(begin, level, r, beam):
                    continue
                if number[w] >= 0 and blobs[beam, int(k + 0.5)] != number[w]:
                    continue
                if number[w] >= 0:
                    # Next to the edge of what the mirror shows, the radar's own view must not contradict.
                    ox, oy, oz = x[j] - radar[0], y - radar[1], height - radar[2]
                    flat = np.sqrt(ox * ox + oy * oy)
                    across = int(np.floor((np.arctan2(ox, oy) - angles[0, 0]) / angles[0, 2] + 0.5))
                    up = int(np.floor((np.arctan2(oz, flat) - angles[1, 0]) / angles[1, 2] + 0.5))
                    own = np.sqrt(flat * flat + oz * oz)
                    if 0 <= across < columns and 0 <= up < rows and first <= own < empty[across * rows + up]:
                        s, inside = side[int(k)], True
                        for right, high in ((-s, 0), (s, 0), (0, -s), (0, s)):
                            c, e = int(az + 0.5) + right, int(el + 0.5) + high
                            if 0 <= c < columns and 0 <= e < rows:
                                inside &= through_at(crossing, through, r - margin, c * rows + e) == number[w]
                        if not inside:
                            continue
                out[j, i] = value
