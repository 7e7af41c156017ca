"""Penumbras: at the edge of a shadow, and of what a mirror shows, waves fade instead of stopping abruptly.

An opaque half-plane leaves of a wave a Fresnel integral (Born and Wolf, Principles of Optics, section 8.7). Let ``D``
be the detour by way of its edge, and ``v = sqrt(4 D / lambda)``. With the wave from the edge, relative to the direct
one,

    E(v) = (1 + j) / 2 * integral from v to infinity of exp(-j pi t^2 / 2) dt,

the share ``E(v)`` of the amplitude arrives in the shadow, and ``1 - E(v)`` beside it: a half on the edge itself. A
mirror is a slit between its two ends. In a sweep, each abrupt end of a wave along the array would have side lobes in
all directions, which no radar measures.

Only the penumbra is kept: between `FADES` the wave from the edge is faded out. Its detour is at most six wavelengths
there, and the share is taken as the same at all frequencies: for bandwidths up to a tenth of the frequency, the detour
is within about one range cell. The waves of ends farther away are in `edges`. Arcs have sharp shadows.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array
from mirrorfold.simulation.rays.outline import TOUCH, Obstacles, crossings_facet, shadowed, shadowed_by_arcs

FADES = 2.0, 5.0
"""The wave from an edge is faded out from the first to the second of these v, where it has 11 and 5 % of the direct
wave's amplitude."""

EDGE = 1e-9
"""Distance [m] from the end of a mirror within which a path counts as grazing that end; above the rounding of
coordinates."""

FAR = 0.5 * FADES[1] ** 2
"""An edge at the distance h aside of a path, and d1 and d2 along it from its ends, is far outside of the penumbra if
``h^2 (d1 + d2) / (d1 d2)`` exceeds this many wavelengths."""


@njit(error_model="numpy", nogil=True)
def _from_edge(detour: float, wavelength: float) -> complex:
    """``E(v)``, faded out; within 0.2 % (Abramowitz and Stegun, Handbook of Mathematical Functions, 7.3.32-33)."""
    square = 4.0 * detour / wavelength
    v = np.sqrt(square)
    if v >= FADES[1]:
        return 0.0j
    f = (1.0 + 0.926 * v) / (2.0 + 1.792 * v + 3.104 * square)
    g = 1.0 / (2.0 + 4.142 * v + 3.492 * square + 6.670 * v * square)
    phase = 0.5 * np.pi * square
    wave = (0.5 + 0.5j) * (g - 1j * f) * (np.cos(phase) - 1j * np.sin(phase))
    fade = min(max((v - FADES[0]) / (FADES[1] - FADES[0]), 0.0), 1.0)
    return wave * np.cos(0.5 * np.pi * fade) ** 2


@njit(error_model="numpy", nogil=True)
def _below(aside: float, before: float, behind: float, wavelength: float) -> complex:
    """Share of a wave that passes on that side of an edge to which negative distances from the path lead.

    The edge is `aside` of the path (signed), and `before` and `behind` along it from its two ends [m]. A path with an
    end at the edge itself has no penumbra.
    """
    if not (before > TOUCH and behind > TOUCH):
        return 1.0 + 0.0j if aside > 0.0 else 0.0j
    square = aside * aside
    detour = square / (np.sqrt(before * before + square) + before) + square / (
        np.sqrt(behind * behind + square) + behind
    )
    wave = _from_edge(detour, wavelength)
    return 1.0 - wave if aside > 0.0 else wave


@njit(error_model="numpy", nogil=True)
def _between(one: tuple[float, complex], other: tuple[float, complex]) -> complex:
    """Share of a wave between two edges; of each its place aside of the path, and the share below it."""
    return one[1] - other[1] if one[0] > other[0] else other[1] - one[1]


@njit(error_model="numpy", nogil=True)
def _mirror_end(
    x: float, y: float, ux: float, uy: float, gone: float, length: float,
    mirror: Array, beyond: Array, end: int, wavelength: float,
) -> tuple[float, complex]:  # fmt: skip
    """Place of one end of a mirror aside of the path [m], and the share of the wave below it; see `through_mirror`."""
    ex, ey = mirror[end, 0] - x, mirror[end, 1] - y
    aside = ux * ey - uy * ex
    sx, sy = mirror[1, 0] - mirror[0, 0], mirror[1, 1] - mirror[0, 1]
    side = sx * (y - mirror[0, 1]) - sy * (x - mirror[0, 0])
    further = sx * (beyond[end, 1] - mirror[0, 1]) - sy * (beyond[end, 0] - mirror[0, 0])
    if further * side > 0.0:
        # Another mirror joins at an angle that faces the wave: a corner, whose two orders of reflection add up.
        return aside, 0.5 + 0.0j if abs(aside) < EDGE else (1.0 + 0.0j if aside > 0.0 else 0.0j)
    before = gone + ux * ex + uy * ey
    return aside, _below(aside, before, length - before, wavelength)


@njit(error_model="numpy", nogil=True)
def through_mirror(
    x: float, y: float, ux: float, uy: float, gone: float, length: float,
    mirror: Array, beyond: Array, wavelength: float,
) -> complex:  # fmt: skip
    """Share of the amplitude that a mirror of finite length reflects, on the line from (x, y) in the direction u.

    Parameters
    ----------
    x, y : float [m]
        Place from which the line leads to the mirror.
    ux, uy : float
        Its direction, a unit vector.
    gone, length : float [m]
        Length of the path up to (x, y), and of the whole path.
    mirror, beyond : (2, 2) arrays [m]
        Ends of the mirror, and far ends of the facets that continue it; NaN where none does.
    wavelength : float [m]
    """
    return _between(
        _mirror_end(x, y, ux, uy, gone, length, mirror, beyond, 0, wavelength),
        _mirror_end(x, y, ux, uy, gone, length, mirror, beyond, 1, wavelength),
    )


@njit(error_model="numpy", nogil=True)
def _facet_end(
    along: float, aside: float, other_along: float, other_aside: float, further: float,
    leg: float, gone: float, length: float, wavelength: float,
) -> tuple[float, complex]:  # fmt: skip
    """Place of one end of a facet aside of the path [m], and the share of the wave below it; see `_past_facet`.

    Both ends are given by their places along the leg and aside of it [m], and the far end of the facet that continues
    it, if there is one, by its place aside.
    """
    if not TOUCH < along < leg - TOUCH:
        limit = 0.0 if along <= TOUCH else leg
        aside += (other_aside - aside) * (limit - along) / (other_along - along)
    # Where the outline goes on to the other side of the path there is no edge, but where it folds back.
    elif not (further - aside) * (other_aside - aside) <= 0.0:
        return aside, _below(aside, gone + along, length - gone - along, wavelength)
    return aside, 1.0 + 0.0j if aside > 0.0 else 0.0j


@njit(error_model="numpy", nogil=True)
def _past_facet(
    x: float, y: float, ux: float, uy: float, leg: float, gone: float, length: float,
    facet: Array, beyond: Array, wavelength: float,
) -> tuple[complex, bool]:  # fmt: skip
    """Share of the amplitude that passes an opaque facet, and whether the facet crosses the path, see `let_through`.

    The path leads from (x, y) in the direction u. Only the part of the facet beside this leg counts.
    """
    ax, ay = facet[0, 0] - x, facet[0, 1] - y
    bx, by = facet[1, 0] - x, facet[1, 1] - y
    along_a, along_b = ux * ax + uy * ay, ux * bx + uy * by
    if max(along_a, along_b) <= TOUCH or min(along_a, along_b) >= leg - TOUCH:
        return 1.0 + 0.0j, False
    aside_a, aside_b = ux * ay - uy * ax, ux * by - uy * bx
    nearest = min(abs(aside_a), abs(aside_b))
    # d1 d2 / (d1 + d2) is at most a quarter of the length
    if aside_a * aside_b > 0.0 and 4.0 * nearest * nearest > FAR * wavelength * length:
        return 1.0 + 0.0j, False
    further_a = ux * (beyond[0, 1] - y) - uy * (beyond[0, 0] - x)
    further_b = ux * (beyond[1, 1] - y) - uy * (beyond[1, 0] - x)
    a = _facet_end(along_a, aside_a, along_b, aside_b, further_a, leg, gone, length, wavelength)
    b = _facet_end(along_b, aside_b, along_a, aside_a, further_b, leg, gone, length, wavelength)
    return 1.0 - _between(a, b), a[0] * b[0] < 0.0


@njit(error_model="numpy", nogil=True)
def let_through(
    x: float, y: float, qx: float, qy: float, gone: float, length: float, first: int, last: int,
    obstacles: Obstacles, enclosing_face: int,
) -> complex:  # fmt: skip
    """Share of the amplitude that all obstacles let through on the leg from (x, y) to q of a path.

    It is that of a single obstacle, as two facets that meet share an edge: of those that cross the leg, the one that
    lets through least; if none does, the one that changes the wave most. Without a wavelength it is one or zero.

    Parameters
    ----------
    x, y, qx, qy : float [m]
        Ends of the leg.
    gone, length : float [m]
        Length of the path up to (x, y), and of the whole path.
    first, last : int
        Numbers of the mirrors at the ends of the leg, which have no penumbra on it; -1 for none.
    obstacles : Obstacles
    enclosing_face : int
        As in `shadowed`.
    """
    facets, arcs, beyond, wavelength = obstacles
    if wavelength == 0.0:
        return 0.0j if shadowed(x, y, qx, qy, facets, arcs, enclosing_face) else 1.0 + 0.0j
    if shadowed_by_arcs(x, y, qx, qy, arcs, enclosing_face - facets.shape[0]):
        return 0.0j
    dx, dy = qx - x, qy - y
    leg = np.sqrt(dx * dx + dy * dy)
    if leg <= TOUCH:  # from one mirror to the other at the vertex of a corner
        return 1.0 + 0.0j
    ux, uy = dx / leg, dy / leg
    share, dark = 1.0 + 0.0j, False
    for i in range(facets.shape[0]):
        facet = facets[i]
        if i == enclosing_face:
            if crossings_facet(x, y, qx, qy, facet) != 1:
                return 0.0j
            continue
        if i in (first, last) or np.isnan(facet[0, 0]) or _touches(x, y, facet) or _touches(qx, qy, facet):
            continue
        past, crosses = _past_facet(x, y, ux, uy, leg, gone, length, facet, beyond[i], wavelength)
        if crosses and (not dark or abs(past) < abs(share)):
            share, dark = past, True
            if share == 0.0:
                break
        elif not dark and abs(1.0 - past) > abs(1.0 - share):
            share = past
    return share


@njit(error_model="numpy", nogil=True)
def _touches(x: float, y: float, facet: Array) -> bool:
    """Whether a place lies on a facet."""
    sx, sy = facet[1, 0] - facet[0, 0], facet[1, 1] - facet[0, 1]
    px, py = x - facet[0, 0], y - facet[0, 1]
    square = sx * sx + sy * sy
    along = px * sx + py * sy
    aside = sx * py - sy * px
    room = TOUCH * np.sqrt(square)
    return bool(abs(aside) < room and -room < along < square + room)
