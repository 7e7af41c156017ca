"""Kernels that draw the folded scene: every pixel looks up the image at the places where chains of mirrors show it.

Of the amplitudes found there, the largest is drawn. There is one kernel for chains of flat mirrors, and one each for
chains that end with an arc, and with a cylinder or a sphere. What all of them look up is one tuple, `seen`, which
`pictures.draw` makes: the map without mirrors, the passages of the lines of sight (two arrays), the cover (three
arrays), where the direct view is empty, the margin behind walls [m], the owners of the samples, the image and its gain,
the steps to directions beside, the number of directions along both axes, and the `grid` of the samples.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.kernels import njit
from mirrorfold.common.round_surfaces import reflection_point
from mirrorfold.common.types import UNSEEN
from mirrorfold.focusing.scans.range_profiles import at_point
from mirrorfold.tree.lines_of_sight import hidden_at, through_at


@njit(nogil=True, fastmath=True, error_model="numpy", inline="always")
def _place(m, x, y, z, grid, flat):  # type: ignore[no-untyped-def]
    """Where a map `m` (3, 4) takes a point x, y, z [m]: azimuth, elevation and range, counted in samples of the view.

    All three are -1 for places beside the view, or behind the radar of an image. An image is `flat`: its first index is
    that of the sine of the angle from broadside, its second index is zero. In a volume ``tan(azimuth / 2)``, which
    rises all the way around the radar, decides without an arctangent whether a place is in view.
    """
    px = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3]
    py = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3]
    pz = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3]
    ground = np.sqrt(px * px + py * py)
    if (py if flat else py + ground) <= 0.0:
        return -1.0, -1.0, -1.0
    right, up = px / (ground if flat else py + ground), pz / ground
    if not (grid[0, 2] <= right <= grid[0, 3] and grid[1, 2] <= up <= grid[1, 3]):
        return -1.0, -1.0, -1.0
    k = (np.sqrt(ground * ground + pz * pz) - grid[2, 0]) / grid[2, 1]
    if flat:
        return (right - grid[0, 0]) / grid[0, 1], 0.0, k
    return (2.0 * np.arctan(right) - grid[0, 0]) / grid[0, 1], (np.arctan(up) - grid[1, 0]) / grid[1, 1], k


@njit(nogil=True, fastmath=True, error_model="numpy", inline="always")
def _shown(a, e, k, x, y, z, mirror, seen, least):  # type: ignore[no-untyped-def]
    """The amplitude of the image at sample a, e, k (angles, range), if `mirror` shows there what stands at x, y, z [m].

    Zero if the radar does not look by way of that mirror there, if an object in front hides the sample, if the echo
    there is doubted or folded by another mirror, or if the amplitude does not exceed `least`.
    """
    unmoved, crossing, through, cover, empty, margin, blobs, amplitude, gain, side, (columns, rows), grid = seen
    if not (0.0 <= a <= columns - 1 and 0.0 <= e <= rows - 1 and 0.0 <= k < gain.size - 1):
        return 0.0
    beam, r = int(a + 0.5) * rows + int(e + 0.5), grid[2, 0] + k * grid[2, 1]
    if through_at(crossing, through, r - margin, beam) != mirror:
        return 0.0
    value = at_point(amplitude, a, e, k) * gain[int(k)]
    if value <= least or value <= hidden_at(*cover, r, beam):
        return 0.0
    owner = blobs[beam, int(k + 0.5)]
    if owner == UNSEEN:
        return 0.0
    if mirror >= 0:
        if owner != mirror:
            return 0.0
        # Near the edge of what a mirror shows, nothing is drawn where the radar itself looks and sees nothing.
        b, f, n = _place(unmoved, x, y, z, grid, rows == 1)
        ahead = -0.5 <= b < columns - 0.5 and -0.5 <= f < rows - 0.5 and n >= 0.0
        if ahead and grid[2, 0] + n * grid[2, 1] < empty[int(b + 0.5) * rows + int(f + 0.5)]:
            s, inside = side[int(k)], True
            for right, high in ((-s, 0), (s, 0), (0, -s), (0, s)):
                c = min(max(int(a + 0.5) + right, 0), columns - 1)
                beside = c * rows + min(max(int(e + 0.5) + high, 0), rows - 1)
                inside &= through_at(crossing, through, r - margin, beside) == mirror
            if not inside:
                return 0.0
    return value


@njit(nogil=True, fastmath=True, error_model="numpy")
def draw_row(x, y, z, maps, number, bound, brightest, pixels, seen, out):  # type: ignore[no-untyped-def]
    """Voxels of one y, (x, z): the largest amplitude with which a chain of mirrors shows them, see `pictures.draw`.

    All `maps` (n, 3, 4) lead to the radar's own frame. The rows of the `grid` in `seen`, (3, 4), are the two angles and
    the range: first value, step, and for angles the lowest and highest tangent, of azimuths that of their half, or the
    sine for an image, which has one row of directions. A block of `pixels` (2,) along x and z shows nothing brighter
    than its `bound` (n, x, z); blocks are taken in the order `brightest`, by falling bound. If `out`
    is (x, 1), it gets the largest amplitude over all z.
    """
    columns, shape, grid = out.shape[1] == 1, seen[-2], seen[-1]
    for w in range(number.size):
        for j in range(x.size):
            blocks, order = bound[w, j // pixels[0]], brightest[w, j // pixels[0]]
            for block in order:
                if blocks[block] <= (out[j, 0] if columns else 0.0):
                    break
                for i in range(block * pixels[1], min((block + 1) * pixels[1], z.size)):
                    a, e, k = _place(maps[w], x[j], y, z[i], grid, shape[1] == 1)
                    into = 0 if columns else i
                    value = _shown(a, e, k, x[j], y, z[i], number[w], seen, out[j, into])
                    out[j, into] = max(value, out[j, into])


@njit(nogil=True, error_model="numpy")
def draw_bent_row(x, y, unfold, column, place, heading, before, number, seen, out):  # type: ignore[no-untyped-def]
    """As `draw_row`, for what an arc shows: pixels of one y, (x, 1).

    The lines of sight `column` (m,) meet the arc at `place` (m, 2) [m], after the way `before` (m,) [m], and leave it
    along `heading` (m, 2). The map `unfold` (2, 3) takes pixels to where the flat mirrors in front of the arc show
    them. A pixel is shown by every reflected line of sight that leads to it (Fermat), interpolated between the two
    that pass it on either side. Behind a caustic there are several, of which the strongest is drawn.
    """
    grid = seen[-1]
    for j in range(x.size):
        px = unfold[0, 0] * x[j] + unfold[0, 1] * y + unfold[0, 2]
        py = unfold[1, 0] * x[j] + unfold[1, 1] * y + unfold[1, 2]
        last, ahead_last = 0.0, -1.0
        for i in range(column.size):
            dx, dy = px - place[i, 0], py - place[i, 1]
            miss, ahead = heading[i, 0] * dy - heading[i, 1] * dx, heading[i, 0] * dx + heading[i, 1] * dy
            joined = i > 0 and column[i] == column[i - 1] + 1
            if joined and (miss < 0.0) != (last < 0.0) and ahead > 0.0 and ahead_last > 0.0:
                share = last / (last - miss)
                hx = place[i - 1, 0] + share * (place[i, 0] - place[i - 1, 0])
                hy = place[i - 1, 1] + share * (place[i, 1] - place[i - 1, 1])
                r = before[i - 1] + share * (before[i] - before[i - 1]) + np.sqrt((px - hx) ** 2 + (py - hy) ** 2)
                sample = (r - grid[2, 0]) / grid[2, 1]
                value = _shown(column[i - 1] + share, 0.0, sample, x[j], y, 0.0, number, seen, out[j, 0])
                out[j, 0] = max(value, out[j, 0])
            last, ahead_last = miss, ahead


@njit(nogil=True, error_model="numpy")
def draw_round_row(x, y, z, unfold, middle, axis, radius, radar, number, seen, out):  # type: ignore[no-untyped-def]
    """As `draw_row`, for what a cylinder or a sphere with `middle`, `axis` and `radius` shows: voxels of one y, (x, z).

    The map `unfold` (3, 4) takes voxels to where the flat mirrors in front of the surface show them. The image shows a
    voxel along the one line of sight that the surface reflects to it, at the length of the whole way.
    """
    columns, unmoved, shape, grid = out.shape[1] == 1, seen[0], seen[-2], seen[-1]
    for j in range(x.size):
        for i in range(z.size):
            px = unfold[0, 0] * x[j] + unfold[0, 1] * y + unfold[0, 2] * z[i] + unfold[0, 3]
            py = unfold[1, 0] * x[j] + unfold[1, 1] * y + unfold[1, 2] * z[i] + unfold[1, 3]
            pz = unfold[2, 0] * x[j] + unfold[2, 1] * y + unfold[2, 2] * z[i] + unfold[2, 3]
            hx, hy, hz, r = reflection_point(middle, axis, radius, radar, px, py, pz)
            if r < 0.0:
                continue
            dx, dy, dz = hx - radar[0], hy - radar[1], hz - radar[2]
            share = r / np.sqrt(dx * dx + dy * dy + dz * dz)
            vx, vy, vz = radar[0] + share * dx, radar[1] + share * dy, radar[2] + share * dz
            a, e, k = _place(unmoved, vx, vy, vz, grid, shape[1] == 1)
            into = 0 if columns else i
            value = _shown(a, e, k, x[j], y, z[i], number, seen, out[j, into])
            out[j, into] = max(value, out[j, into])
