"""Mixed-path echoes, told by the directions in which they leave and arrive.

An echo that leaves by one chain of mirrors and is received by another (out in line of sight, back by way of a wall, or
the reverse) has the mean of two path lengths, and focuses where nothing stands. A sweep of several transmitters and
receivers gives such an echo away: with the transmitters focused on the point, the receivers hear the echo arrive from
another direction than that of the point.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numba
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.threads import in_shares, products
from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.image_view import LARGEST_SINE, ImageView
from mirrorfold.errors import InputError
from mirrorfold.focusing.phasor import unit_phasor
from mirrorfold.sweep import antenna_positions, wavenumber

Complex = NDArray[np.complex64]
Single = NDArray[np.float32]
Known = dict[tuple[float, float], float]

SMALLEST_RATIO = 0.5
"""True echoes have ratios near one, mixed ones far below a half."""

PHASE_SPREAD = 0.5
"""Frequencies are summed in groups over which the phase of no direction turns by more than this [rad]."""

SAME_PLACE = 1e-3
"""Elements closer than this share of the shortest wavelength stand at the same place: no phase tells them apart."""

CHUNK = 64
"""Points treated at once; bounds the memory."""


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _send(
    k0: float, dk: float, weight: Array, taper: Array, path: Array, phasor: Complex, first: int, last: int
) -> None:
    """``phasor[m, i, p] = weight[i] taper[m] exp(j (k0 + m dk) path[p, i])``: focused on points p.

    For the transmitters i from the first up to, and without, the last. The phase goes from one frequency m to the next
    by a multiplication; `path` is in metres.
    """
    points = path.shape[0]
    for i in range(first, last):
        for p in range(points):
            turn = complex(np.cos(dk * path[p, i]), np.sin(dk * path[p, i]))
            value = weight[i] * complex(np.cos(k0 * path[p, i]), np.sin(k0 * path[p, i]))
            for m in range(taper.size):
                phasor[m, i, p] = value * taper[m]
                value *= turn


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _listen(
    re: Single, im: Single, k0: float, dk: float, rx: Array, point: Array, reach: Array, level: Array, first: int,
    last: int,
) -> None:  # fmt: skip
    """``level[p, j] = |sum_b,k (re + j im)[p, b, k] exp(j (k0 + b dk) (|point[p, j] - rx[k]| - reach[p]))|``.

    Points p from the first up to, and without, the last; directions j, groups of frequencies b, receivers k; places in
    x, y and z [m].
    """
    groups, antennas = re.shape[1:]
    per_turn = 0.5 / np.pi
    cos, sin = np.empty(antennas, np.float32), np.empty(antennas, np.float32)
    cos_turn, sin_turn = np.empty(antennas, np.float32), np.empty(antennas, np.float32)
    for p in range(first, last):
        for j in range(point.shape[1]):
            for k in range(antennas):
                x = point[p, j, 0] - rx[k, 0]
                y = point[p, j, 1] - rx[k, 1]
                z = point[p, j, 2] - rx[k, 2]
                path = per_turn * (np.sqrt(x * x + y * y + z * z) - reach[p])
                cos[k], sin[k] = unit_phasor(k0 * path)
                cos_turn[k], sin_turn[k] = unit_phasor(dk * path)
            total_re, total_im = np.float32(0.0), np.float32(0.0)
            for b in range(groups):
                for k in range(antennas):
                    c, s = cos[k], sin[k]
                    total_re += re[p, b, k] * c - im[p, b, k] * s
                    total_im += re[p, b, k] * s + im[p, b, k] * c
                    cos[k] = c * cos_turn[k] - s * sin_turn[k]
                    sin[k] = c * sin_turn[k] + s * cos_turn[k]
            level[p, j] = np.sqrt(total_re * total_re + total_im * total_im)


class _Aperture(NamedTuple):
    """The transmitters, or the receivers, weighted against the side lobes of bright glints.

    The `weight` (n,) of elements at `position` (n, 3) [m] is a Hann window along the aperture's principal axis; those
    at the same place share its weight. `centre` (3,) [m] is the mean of the `places`, of which so many differ.
    """

    position: Array
    weight: Array
    centre: Array
    places: int

    @classmethod
    def of(cls, position: Array, wavelength: float) -> _Aperture:
        """The aperture of elements at positions (n, 3) [m]; `wavelength` [m] says which of them coincide."""
        distance = SAME_PLACE * wavelength
        rounded, place, count = np.unique(np.rint(position / distance), axis=0, return_inverse=True, return_counts=True)
        place, places = place.ravel(), rounded * distance
        centre = places.mean(axis=0)
        # Sorted places have one principal axis, whatever the order of the elements.
        along = (places - centre) @ np.linalg.svd(places - centre)[2][0]
        share = _between_ends(along, steps=np.unique(np.rint(along / distance)).size)
        return cls(position, (np.sin(np.pi * share) ** 2 / count)[place], centre, count.size)


def _between_ends(along: Array, steps: int) -> Array:
    """Where each place stands between the ends of its aperture, in (0, 1); one half where all stand together.

    The aperture reaches half a mean pitch, ``length / (2 steps)``, beyond its outermost places, so that the window
    gives none of them the weight zero.
    """
    length = float(np.ptp(along))
    if steps < 2:
        return np.full(along.size, 0.5)
    margin = 0.5 * length / steps
    return np.asarray((along - along.min() + margin) / (length + 2.0 * margin))


def _apertures(sweep: xr.Dataset) -> tuple[_Aperture, _Aperture]:
    """The transmitters and the receivers of a sweep."""
    shortest = 2.0 * np.pi / float(wavenumber(sweep)[-1])
    tx, rx = antenna_positions(sweep)
    return _Aperture.of(tx, shortest), _Aperture.of(rx, shortest)


def direction_ratio(sweep: xr.Dataset, view: ImageView, range_: Array, u: Array) -> Array:
    """How much of an echo at ranges [m] and u, (n,) each, arrives from the direction in which it left: 0 to 1, (n,).

    Let ``B(u, u')`` be the sum over transmitters, focused on a point at range r in direction u, and over receivers,
    focused at the same range in direction u'. The ratio is ``|B(u, u)| / max over u' of |B(u, u')|``: near one for an
    echo that came back the way it went out, small for one that arrives from elsewhere. The points are taken at the
    height of the radar, the mean of the heights of its two apertures, of two places or more each.

    Raises
    ------
    InputError
        If the sweep has other dimensions than (frequency, tx, rx), such as frames.
    """
    data = sweep["s"]
    if data.dims != ("frequency", "tx", "rx"):
        raise InputError(
            f"sweep: s has the dimensions {data.dims}, expected (frequency, tx, rx); choose one frame or polarization"
        )
    k = wavenumber(sweep)
    tx, rx = _apertures(sweep)
    height = 0.5 * float(tx.centre[2] + rx.centre[2])
    radar = np.append(view.radar, height)
    taper = np.sin(np.pi * np.arange(1, k.size + 1) / (k.size + 1)) ** 2
    # A path to the radar's middle and one to the farthest receiver differ by at most the distance between these two.
    spread = float(np.linalg.norm(rx.position - radar, axis=1).max())
    groups = int(np.clip(np.ceil((k[-1] - k[0]) * spread / PHASE_SPREAD), 1, k.size))
    size = k.size // groups
    first_of_group = np.arange(0, k.size, size)
    dk = float(k[-1] - k[0]) / max(k.size - 1, 1)
    # Steps of half the beam width of the receivers.
    beams = int(np.ceil(LARGEST_SINE * 2.0 * max(view.aperture_rx, 1.0)))
    ring = np.linspace(-LARGEST_SINE, LARGEST_SINE, 2 * beams + 1)

    def places(range_: Array, u: Array) -> Array:
        """Positions (..., 3) [m] at the radar's height."""
        plan = view.to_points(range_, u)
        return np.concatenate([plan, np.full((*plan.shape[:-1], 1), height)], axis=-1)

    ratio = np.empty(range_.size)
    for first in range(0, range_.size, CHUNK):
        part = slice(first, first + CHUNK)
        r = range_[part]
        # The range, taken away again by the receivers' sum, keeps the phases there small between frequencies.
        path = np.linalg.norm(places(r, u[part])[:, None] - tx.position, axis=-1) + r[:, None]
        send = np.empty((k.size, len(tx.position), r.size), dtype=np.complex64)
        in_shares(_send, len(tx.position), float(k[0]), dk, tx.weight, taper, path, send)
        heard = np.empty((k.size, len(rx.position), r.size), dtype=np.complex64)
        products(data.values.swapaxes(1, 2), send, out=heard)
        field = np.add.reduceat(heard, first_of_group, axis=0).transpose(2, 0, 1) * rx.weight.astype(np.float32)
        directions = np.concatenate([np.broadcast_to(ring, (r.size, ring.size)), u[part, None]], axis=1)
        where = places(np.broadcast_to(r[:, None], directions.shape), directions)
        level = np.empty(directions.shape)
        # Each group counts with its middle frequency.
        k_middle = float(k[0]) + 0.5 * (size - 1) * dk
        parts = np.ascontiguousarray(field.real), np.ascontiguousarray(field.imag)
        in_shares(_listen, r.size, *parts, k_middle, size * dk, rx.position, where, r, level)
        ratio[part] = level[:, -1] / np.maximum(level.max(axis=1), np.finfo(float).tiny)
    return ratio


def of_mixed_paths(echoes: Echoes, sweep: xr.Dataset, view: ImageView, known: Known | None = None) -> Mask:
    """Which echoes of a view arrive from another direction than they left in, (n,).

    Where all transmitters, or all receivers, stand at one place, directions cannot be told and no echo is called mixed.
    """
    if min(side.places for side in _apertures(sweep)) < 2:
        return np.zeros(len(echoes), dtype=bool)
    return once_a_cell(partial(direction_ratio, sweep, view), echoes, view, known) < SMALLEST_RATIO


def once_a_cell(
    measure: Callable[[Array, Array], Array], echoes: Echoes, view: ImageView, known: Known | None = None
) -> Array:
    """What `measure` says of ranges [m] and u, (n,) each: once for each resolution cell, at its brightest echo, (n,).

    `known` holds values by range and u from earlier calls; those measured now are added.
    """
    known = {} if known is None else known
    _, u = view.to_polar(echoes.position)
    cells = view.in_cells(echoes.position).T.astype(np.intp)
    _, cell = np.unique(cells, axis=1, return_inverse=True)
    cell = cell.ravel()
    order = np.lexsort([-echoes.amplitude, cell])
    brightest = order[np.unique(cell[order], return_index=True)[1]]
    where = list(zip(echoes.range[brightest].tolist(), u[brightest].tolist(), strict=True))
    new = brightest[[place not in known for place in where]]
    if new.size:
        measured = measure(echoes.range[new], u[new])
        known.update(zip(zip(echoes.range[new].tolist(), u[new].tolist(), strict=True), measured, strict=True))
    return np.array([known[place] for place in where])[cell]
