"""The pixels of the folded scene: each looks up the image where the chains of mirrors show it."""

from __future__ import annotations

import numpy as np

from mirrorfold.common.kernels import njit
from mirrorfold.focusing.range_profiles import at_point
from mirrorfold.tree.lines_of_sight import NOBODY, hidden_at, through_at


@njit(nogil=True, fastmath=True, error_model="numpy")
def _place(m, x, y, z, grid, flat):  # type: ignore[no-untyped-def]
    """Where a map leads a point: along the two angles and range in steps of the view; outside at -1."""
    px = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3]
    py = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3]
    pz = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3]
    if py <= 0.0:
        return -1.0, -1.0, -1.0
    ground = np.sqrt(px * px + py * py)
    right, up = px / (ground if flat else py), pz / ground
    if not (grid[0, 2] <= right <= grid[0, 3] and grid[1, 2] <= up <= grid[1, 3]):
        return -1.0, -1.0, -1.0
    k = (np.sqrt(ground * ground + pz * pz) - grid[2, 0]) / grid[2, 1]
    if flat:
        return (right - grid[0, 0]) / grid[0, 1], 0.0, k
    return (np.arctan(right) - grid[0, 0]) / grid[0, 1], (np.arctan(up) - grid[1, 0]) / grid[1, 1], k


@njit(nogil=True, fastmath=True, error_model="numpy")
def draw_row(  # type: ignore[no-untyped-def]
    x, y, z, maps, number, crossing, through, begin, level, empty, margin, blobs, amplitude, gain, side, shape, grid,
    out,
):  # fmt: skip
    """Voxels of one y, (x, z): the largest amplitude with which a chain of mirrors shows them, see `pictures.draw`.

    The first of the maps (n, 3, 4) is that without mirrors; all lead to the radar's own frame. The `grid` (3, 4) holds
    first value and step of the two angles and of range, and the limits of the angles' tangents, or of the sine of an
    image, which has one row of directions.
    """
    columns, rows = shape
    for w in range(number.size):
        for j in range(x.size):
            for i in range(z.size):
                a, e, k = _place(maps[w], x[j], y, z[i], grid, rows == 1)
                if not (0.0 <= a <= columns - 1 and 0.0 <= e <= rows - 1 and 0.0 <= k < gain.size - 1):
                    continue
                beam, r = int(a + 0.5) * rows + int(e + 0.5), grid[2, 0] + k * grid[2, 1]
                if through_at(crossing, through, r - margin, beam) != number[w]:
                    continue
                value = at_point(amplitude, a, e, k) * gain[int(k)]
                if value <= out[j, i] or value <= hidden_at(begin, level, r, beam):
                    continue
                owner = blobs[beam, int(k + 0.5)]
                if owner == NOBODY:
                    continue
                if number[w] >= 0:
                    if owner != number[w]:
                        continue
                    # Next to the edge of what the mirror shows, the radar's own view must not contradict.
                    b, f, n = _place(maps[0], x[j], y, z[i], grid, rows == 1)
                    ahead = -0.5 <= b < columns - 0.5 and -0.5 <= f < rows - 0.5 and n >= 0.0
                    if ahead and grid[2, 0] + n * grid[2, 1] < empty[int(b + 0.5) * rows + int(f + 0.5)]:
                        s, inside = side[int(k)], True
                        for right, high in ((-s, 0), (s, 0), (0, -s), (0, s)):
                            c = min(max(int(a + 0.5) + right, 0), columns - 1)
                            beside = c * rows + min(max(int(e + 0.5) + high, 0), rows - 1)
                            inside &= through_at(crossing, through, r - margin, beside) == number[w]
                        if not inside:
                            continue
                out[j, i] = value
