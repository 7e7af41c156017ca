"""Paths over curved mirrors by Fermat's principle: the points on the arcs at which the path length is stationary.

A chain of mirrors is *unfolded*: everything behind a flat mirror is reflected in that mirror, so that the path crosses
it straight, and only the arcs bend the path. With the unfolded points ``x_k`` on the arcs at the angles ``t_k``, the
path length is ``L = sum of |x_k - x_(k-1)|``. Each derivative of L depends only on its own angle and the two
neighbouring ones, so that every step of Newton's method solves one tridiagonal system. A stationary path is valid if it
is reflected at every arc instead of passing through it, crosses every flat mirror, and no obstacle blocks a leg of it.

The width of a thin pencil of rays, ``q`` [m] per radian of angle at the antenna, grows by ``s q'`` over the distance s.
A mirror of radius R (positive if it is convex towards the waves), met at the angle of incidence i, changes its
divergence, ``q' += 2 q / (R cos i)`` (Balanis, Advanced Engineering Electromagnetics, 2nd ed., ch. 13). The amplitude
is ``1 / sqrt(|q|)``. At each zero of q, a caustic, the phase advances by a quarter turn: the factor +j for
``exp(+jwt)``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array
from mirrorfold.simulation.rays.outline import TOUCH, shadowed

X, Y, M00, M01, M10, M11, RADIUS, FIRST, SPAN, SIDE, REAL_X, REAL_Y = range(12)
"""Columns of the table of arcs: unfolded center x, y [m], the matrix of the unfolding, radius [m], first angle and
angular span [rad], the side that reflects (+1 outer, -1 inner), and the true center x, y [m]."""

STEPS, LARGEST_STEP, EXACT = 16, 0.3, 1e-10
"""Newton's method: largest number of steps, longest step [rad], and step below which it ends [rad]. The error of the
path length is of second order in the last step."""

SAME = 1e-6
"""Solutions whose first angles differ by less than this [rad] are the same path."""

LENGTH, SPREADING, CAUSTICS, APERTURE, FOLD, END_COSINE, FACTS = range(7)
"""Columns of the table of paths: length [m]; ``|q|`` [m] at the point; number of caustics on the path; the largest,
among the arcs, of ``|q p| / (cos(i) l)^2`` and, among inner sides, of ``|q p| |L'''|^(2/3) / cos(i)^2``
[m^(2/3)], with the widths q and p [m], at the arc, of the pencils of rays from the antenna and from the point, the
length l [m] of the arc, and the third derivative L''' [1/m^2] of the path length along it; cosine of the angle to the
normal at the point."""


@njit(error_model="numpy", nogil=True)
def stationary(ax: float, ay: float, px: float, py: float, arcs: Array, angle: Array, work: Array) -> bool:
    """Move the angles (k,) to those of the nearby stationary path from antenna a over the arcs to the unfolded point p.

    Returns False if Newton's method finds no such path. `work` (5, k + 2) is scratch memory.
    """
    k = arcs.shape[0]
    x, y, gradient, diagonal, off = work
    x[0], y[0], x[k + 1], y[k + 1] = ax, ay, px, py
    for _ in range(STEPS):
        for i in range(k):
            cos, sin = np.cos(angle[i]), np.sin(angle[i])
            x[i + 1] = arcs[i, X] + arcs[i, RADIUS] * (arcs[i, M00] * cos + arcs[i, M01] * sin)
            y[i + 1] = arcs[i, Y] + arcs[i, RADIUS] * (arcs[i, M10] * cos + arcs[i, M11] * sin)
        for i in range(k):
            radius = arcs[i, RADIUS]
            nx, ny = (x[i + 1] - arcs[i, X]) / radius, (y[i + 1] - arcs[i, Y]) / radius
            # An odd number of reflections mirrors the arc: the tangent towards growing angles then turns round.
            hand = arcs[i, M00] * arcs[i, M11] - arcs[i, M01] * arcs[i, M10]
            tx, ty = -ny * hand, nx * hand
            bx, by = x[i + 1] - x[i], y[i + 1] - y[i]
            fx, fy = x[i + 1] - x[i + 2], y[i + 1] - y[i + 2]
            back, ahead = np.sqrt(bx * bx + by * by), np.sqrt(fx * fx + fy * fy)
            if back < TOUCH or ahead < TOUCH:
                return False
            bx, by, fx, fy = bx / back, by / back, fx / ahead, fy / ahead
            slope_b, slope_f = tx * bx + ty * by, tx * fx + ty * fy
            gradient[i] = radius * (slope_b + slope_f)
            diagonal[i] = radius * radius * ((1.0 - slope_b**2) / back + (1.0 - slope_f**2) / ahead)
            diagonal[i] -= radius * (nx * (bx + fx) + ny * (by + fy))
            if i > 0:
                cos, sin = np.cos(angle[i - 1]), np.sin(angle[i - 1])
                ux = -arcs[i - 1, M00] * sin + arcs[i - 1, M01] * cos
                uy = -arcs[i - 1, M10] * sin + arcs[i - 1, M11] * cos
                across = tx * ux + ty * uy - slope_b * (ux * bx + uy * by)
                off[i] = -radius * arcs[i - 1, RADIUS] * across / back
        for i in range(1, k):
            share = off[i] / diagonal[i - 1]
            diagonal[i] -= share * off[i]
            gradient[i] -= share * gradient[i - 1]
        largest = 0.0
        for i in range(k - 1, -1, -1):
            gradient[i] = (gradient[i] - (off[i + 1] * gradient[i + 1] if i < k - 1 else 0.0)) / diagonal[i]
            largest = max(largest, abs(gradient[i]))
        if not largest < np.inf:
            return False
        scale = min(1.0, LARGEST_STEP / largest) if largest > 0.0 else 1.0
        for i in range(k):
            angle[i] -= scale * gradient[i]
        if largest < EXACT:
            return True
    return False


@njit(error_model="numpy", nogil=True)
def walk(
    ax: float,
    ay: float,
    px: float,
    py: float,
    target_x: float,
    target_y: float,
    normal_x: float,
    normal_y: float,
    enclosing_face: int,
    arcs: Array,
    angle: Array,
    arc_slot: NDArray[np.int64],
    leg: NDArray[np.int64],
    flat_slot: NDArray[np.int64],
    unfolded: Array,
    flat: Array,
    facets: Array,
    obstacles: Array,
    work: Array,
    cosines: Array,
    facts: Array,
) -> bool:
    """Whether the path with these angles is valid; fills in the cosines on all mirrors, and the `facts` about the path.

    The path runs from antenna a over the arcs (k,) to the point p, whose unfolded position is `target`. Flat mirrors
    (f, 2, 2) are crossed on the legs `leg` (f,), in order: `unfolded` are their unfolded positions, `flat` their true
    ones. `arc_slot` and `flat_slot` are the places of the arcs and of the flat mirrors in the chain. `facets` and
    `obstacles` are the facets and the arcs of the `Outline`. `work` (5, k + 2) is scratch memory.
    """
    k = arcs.shape[0]
    ux, uy, rx, ry = ax, ay, ax, ay
    q, growth, length, caustics, crossed = 0.0, 1.0, 0.0, 0, 0
    legs, width, vergence, power, incidences = work
    for level in range(k + 1):
        if level < k:
            cos, sin = np.cos(angle[level]), np.sin(angle[level])
            if (angle[level] - arcs[level, FIRST]) % (2.0 * np.pi) > arcs[level, SPAN]:
                return False
            radius, side = arcs[level, RADIUS], arcs[level, SIDE]
            nx = arcs[level, M00] * cos + arcs[level, M01] * sin
            ny = arcs[level, M10] * cos + arcs[level, M11] * sin
            vx, vy = arcs[level, X] + radius * nx, arcs[level, Y] + radius * ny
        else:
            vx, vy = target_x, target_y
        dx, dy = vx - ux, vy - uy
        distance = np.sqrt(dx * dx + dy * dy)
        before = TOUCH
        while crossed < leg.size and leg[crossed] == level:
            sx = unfolded[crossed, 1, 0] - unfolded[crossed, 0, 0]
            sy = unfolded[crossed, 1, 1] - unfolded[crossed, 0, 1]
            ox, oy = unfolded[crossed, 0, 0] - ux, unfolded[crossed, 0, 1] - uy
            denominator = dx * sy - dy * sx
            along = (ox * sy - oy * sx) / denominator * distance
            share = (ox * dy - oy * dx) / denominator
            if not (before < along < distance - TOUCH and 0.0 <= share <= 1.0):
                return False
            hit_x = flat[crossed, 0, 0] + share * (flat[crossed, 1, 0] - flat[crossed, 0, 0])
            hit_y = flat[crossed, 0, 1] + share * (flat[crossed, 1, 1] - flat[crossed, 0, 1])
            cosines[flat_slot[crossed]] = abs(denominator) / (distance * np.sqrt(sx * sx + sy * sy))
            if shadowed(rx, ry, hit_x, hit_y, facets, obstacles, -1):
                return False
            rx, ry, before = hit_x, hit_y, along + TOUCH
            crossed += 1
        grown = q + distance * growth
        if q * grown < 0.0:
            caustics += 1
        q, length, legs[level] = grown, length + distance, distance
        if level == k:
            break
        incidence = -(dx * nx + dy * ny) * side / distance
        next_x, next_y = target_x - vx, target_y - vy
        if level + 1 < k:
            cos, sin = np.cos(angle[level + 1]), np.sin(angle[level + 1])
            other = arcs[level + 1]
            next_x = other[X] + other[RADIUS] * (other[M00] * cos + other[M01] * sin) - vx
            next_y = other[Y] + other[RADIUS] * (other[M10] * cos + other[M11] * sin) - vy
        # A path straight through the arc has stationary length, too, but is no reflection.
        if incidence <= 0.0 or (next_x * nx + next_y * ny) * side <= 0.0:
            return False
        real_x, real_y = (
            arcs[level, REAL_X] + radius * np.cos(angle[level]),
            arcs[level, REAL_Y] + radius * np.sin(angle[level]),
        )
        if shadowed(rx, ry, real_x, real_y, facets, obstacles, -1):
            return False
        rx, ry = real_x, real_y
        cosines[arc_slot[level]] = incidence
        width[level], vergence[level], incidences[level] = q, growth / q, incidence
        power[level] = side * 2.0 / (radius * incidence)
        growth += power[level] * q
        ux, uy = vx, vy
    if shadowed(px, py, rx, ry, facets, obstacles, enclosing_face):
        return False
    way = np.sqrt((rx - px) ** 2 + (ry - py) ** 2)
    facing = ((rx - px) * normal_x + (ry - py) * normal_y) / way
    if facing <= 0.0 and (normal_x != 0.0 or normal_y != 0.0):
        return False
    facts[LENGTH], facts[SPREADING], facts[CAUSTICS] = length, abs(q), caustics
    facts[APERTURE], facts[FOLD], facts[END_COSINE] = 0.0, 0.0, facing
    q, growth = legs[k], 1.0  # the pencil from the point
    for level in range(k - 1, -1, -1):
        radius, cos = arcs[level, RADIUS], incidences[level]
        both = abs(width[level] * q) / cos**2
        facts[APERTURE] = max(facts[APERTURE], both / (radius * arcs[level, SPAN]) ** 2)
        if arcs[level, SIDE] < 0.0 and both > 0.0:
            uneven, second = vergence[level] - growth / q, cos * (vergence[level] + growth / q) - 1.0 / radius
            third = 3.0 * np.sqrt(max(1.0 - cos**2, 0.0)) * cos * abs(uneven * second)
            facts[FOLD] = max(facts[FOLD], both * third ** (2.0 / 3.0))
        growth += power[level] * q
        q += legs[level] * growth
    return True


@njit(makes_arrays=True, error_model="numpy", nogil=True)
def starts(
    angle: Array,
    place: Array,
    heading: Array,
    joined: NDArray[np.bool_],
    target: Array,
    found: Array,
    count: NDArray[np.int64],
) -> None:
    """Approximate paths from an antenna to points (p, 2), interpolated between the rays of a fan.

    Fills `found` (p, most, k) with the angles on the k arcs, and `count` (p,) with the number of paths to each point.
    Ray i of the fan has the angles `angle` (m, k), leaves the last arc at `place` (m, 2) in the direction `heading`
    (m, 2), and has ray i + 1 as its neighbour where `joined` (m,). A path lies where a point is on the left of one ray
    and on the right of its neighbour.
    """
    most, rays = found.shape[1], angle.shape[0]
    miss, ahead = np.empty(rays), np.empty(rays)
    for p in range(target.shape[0]):
        for i in range(rays):
            dx, dy = target[p, 0] - place[i, 0], target[p, 1] - place[i, 1]
            miss[i] = heading[i, 0] * dy - heading[i, 1] * dx
            ahead[i] = heading[i, 0] * dx + heading[i, 1] * dy
        for i in range(1, rays):
            if not joined[i - 1] or (ahead[i] <= 0.0 and ahead[i - 1] <= 0.0):
                continue
            if (miss[i] < 0.0) != (miss[i - 1] < 0.0):
                if count[p] < most:
                    _interpolate(angle, i, miss[i - 1] / (miss[i - 1] - miss[i]), found[p, count[p]])
                    count[p] += 1
                continue
            # Near a caustic two paths lie between the same two rays: roots of the parabola through three misses.
            if i + 1 == rays or not joined[i] or count[p] + 1 >= most:
                continue
            low, middle, high = miss[i - 1], miss[i], miss[i + 1]
            if abs(middle) >= min(abs(low), abs(high)) or (high < 0.0) != (middle < 0.0):
                continue
            bend, slope = low - 2.0 * middle + high, 0.5 * (high - low)
            square = slope * slope - 2.0 * bend * middle
            if square > 0.0:
                for sign in (-1.0, 1.0):
                    share = (-slope + sign * np.sqrt(square)) / bend
                    if abs(share) <= 1.0:
                        _interpolate(angle, i if share <= 0.0 else i + 1, share % 1.0, found[p, count[p]])
                        count[p] += 1


@njit(error_model="numpy", nogil=True)
def _interpolate(angle: Array, i: int, share: float, out: Array) -> None:
    """Interpolate the angles at the fraction `share` between ray i - 1 and ray i; the result is written to `out`."""
    for j in range(angle.shape[1]):
        turn = (angle[i, j] - angle[i - 1, j] + np.pi) % (2.0 * np.pi) - np.pi
        out[j] = angle[i - 1, j] + share * turn


@njit(makes_arrays=True, error_model="numpy", nogil=True)
def trace_points(
    antennas: Array,
    fans: NDArray[np.int64],
    start: Array,
    count: NDArray[np.int64],
    position: Array,
    normal: Array,
    enclosing_face: NDArray[np.int64],
    target: Array,
    arcs: Array,
    arc_slot: NDArray[np.int64],
    leg: NDArray[np.int64],
    flat_slot: NDArray[np.int64],
    unfolded: Array,
    flat: Array,
    facets: Array,
    obstacles: Array,
    seen: NDArray[np.bool_],
    cosine: Array,
    facts: Array,
    first: int,
    last: int,
) -> None:
    """Find the paths to points `first` to `last`, and fill them into the (n, p, most) tables `seen`, `cosine`, `facts`.

    Newton's method starts from the approximate paths of the antennas `fans` for which fans were cast, ``start`` (fans,
    p, most, k), `count` (fans, p) of them, and follows each path from antenna to antenna, up to the next fan on either
    side, as long as it finds one that is not known yet.
    """
    k = arcs.shape[0]
    angle, work, taken = np.empty(k), np.empty((5, k + 2)), np.empty((antennas.shape[0], seen.shape[2]))
    number = np.empty(antennas.shape[0], dtype=np.int64)
    for p in range(first, last):
        number[:] = 0
        for turn in range(2 * fans.size):
            fan, step = turn // 2, 1 - 2 * (turn % 2)
            begin = fans[fan] if step > 0 else fans[fan] - 1
            end = -1 if step < 0 else antennas.shape[0]
            if 0 <= fan + step < fans.size:
                end = fans[fan + step]
            for candidate in range(count[fan, p]):
                for k in range(angle.size):
                    angle[k] = start[fan, p, candidate, k]
                for n in range(begin, end, step):
                    if not stationary(antennas[n, 0], antennas[n, 1], target[p, 0], target[p, 1], arcs, angle, work):
                        break
                    again = number[n] == taken.shape[1]
                    for other in range(number[n]):
                        gap = (angle[0] - taken[n, other] + np.pi) % (2.0 * np.pi) - np.pi
                        again |= abs(gap) < SAME
                    if again:
                        break
                    if walk(
                        antennas[n, 0],
                        antennas[n, 1],
                        position[p, 0],
                        position[p, 1],
                        target[p, 0],
                        target[p, 1],
                        normal[p, 0],
                        normal[p, 1],
                        enclosing_face[p],
                        arcs,
                        angle,
                        arc_slot,
                        leg,
                        flat_slot,
                        unfolded,
                        flat,
                        facets,
                        obstacles,
                        work,
                        cosine[n, p, number[n]],
                        facts[n, p, number[n]],
                    ):
                        seen[n, p, number[n]] = True
                        taken[n, number[n]] = angle[0]
                        number[n] += 1
