"""Chains of mirrors and the paths over them, by the method of images.

A chain lists the straight facets that reflect a ray from an antenna, in the order in which it meets them. Reflecting
the antenna at each of these mirrors in turn gives its *image*. Its *window* is the part of the last mirror that rays
over the earlier mirrors reach. A point is seen over the chain if the straight line from the image to the point passes
through the window, and no obstacle blocks a leg of the folded path (Borish, J. Acoust. Soc. Am. 75, 1827, 1984).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.geometry import cross2, reflect, segment_normal, signed_distance
from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import in_shares
from mirrorfold.common.types import Array, Complex
from mirrorfold.simulation.rays.outline import TOUCH, Obstacles, Outline
from mirrorfold.simulation.rays.penumbras import EDGE, let_through, through_mirror

PROBES = 1024
"""Number of sample points on the windows of all antennas together, which decide whether any part of a mirror is seen.
They are staggered from antenna to antenna: no gap wider than about a thousandth of a window is missed."""


ChainTables = tuple[Array, Array, Array, NDArray[np.int64]]
"""The `images`, the `window` and the `mirrors` of a `Chain`, and its `facets` as an array."""


@dataclass(frozen=True, eq=False)
class Chain:
    """Straight mirrors in the order in which a ray from the antenna meets them.

    Attributes
    ----------
    facets : tuple of int
        Numbers of the mirrors among the facets of the `Outline`; empty for the line of sight.
    mirrors : (bounces, 2, 2) array [m]
        Start and end of these facets.
    images : (bounces + 1, n, 2) array [m]
        The n antennas, their images in the first mirror, the images of these in the second mirror, and so on.
    window : (n, 2, 2) array [m]
        Start and end of the part of the last mirror that each antenna reaches; NaN where an antenna reaches no part,
        and for the line of sight.
    """

    facets: tuple[int, ...]
    mirrors: Array
    images: Array
    window: Array

    @property
    def mirrors_and_sides(self) -> tuple[tuple[int, int], ...]:
        """Number and side of each mirror; the side is 0, as all mirrors of this chain are flat."""
        return tuple((facet, 0) for facet in self.facets)

    @property
    def count(self) -> int:
        """Number of antennas."""
        return int(self.images.shape[1])

    @property
    def tables(self) -> ChainTables:
        """Images, windows, mirrors and their numbers, as kernels take them."""
        return self.images, self.window, self.mirrors, np.array(self.facets, dtype=np.int64)

    def of(self, antennas: NDArray[np.intp]) -> Chain:
        """The same chain from some of the antennas only."""
        return replace(self, images=self.images[:, antennas], window=self.window[antennas])


@dataclass(frozen=True, eq=False)
class Points:
    """The points at which paths end: scatterers, receivers, or samples of a mirror.

    Attributes
    ----------
    position : (p, 2) array [m]
    normal : (p, 2) array
        Unit normal of the side from which the point is seen; zero where it is seen from all sides.
    enclosing_face : (p,) array of int
        Number of the obstacle that a path has to cross to reach the point, as the face of the wall that the point lies
        in; -1 for none.
    """

    position: Array
    normal: Array
    enclosing_face: NDArray[np.int64]

    @classmethod
    def free(cls, position: Array) -> Points:
        """Points that are seen from all sides."""
        return cls(position, np.zeros_like(position), np.full(len(position), -1, dtype=np.int64))


def chains(antennas: Array, outline: Outline, bounces: int) -> list[Chain]:
    """All chains of up to `bounces` mirrors over which any antenna sees a part of the last mirror.

    The line of sight, a chain without mirrors, comes first.

    Parameters
    ----------
    antennas : (n, 2) array [m]
    outline : Outline
    bounces : int

    Returns
    -------
    list of Chain
        Sorted by their number of mirrors.
    """
    no_window = np.full((len(antennas), 2, 2), np.nan)
    generation = [Chain((), np.empty((0, 2, 2)), antennas[None], no_window)]
    found = list(generation)
    for _ in range(bounces):
        longer = (_extend(chain, facet, outline) for chain in generation for facet in range(len(outline.facets)))
        generation = [chain for chain in longer if chain is not None]
        found += generation
    return found


def _extend(chain: Chain, facet: int, outline: Outline) -> Chain | None:
    """The chain with one more mirror, or None if no antenna sees that mirror over the chain."""
    if chain.facets and chain.facets[-1] == facet:
        return None
    start, end = outline.facets[facet]
    image = chain.images[-1]
    normal = segment_normal(start, end)
    # An antenna on the line of the mirror sees the mirror edge-on: it reflects nothing then.
    lit = np.abs(signed_distance(image, start, normal)) > TOUCH
    first, last = np.zeros(len(image)), np.ones(len(image))
    if chain.facets:
        first, last = _reached_part(start, end, image, chain.window)
    lit &= last > first
    if not lit.any():
        return None
    first, last = np.where(lit, first, 0.0), np.where(lit, last, 0.0)
    ends = start + np.stack([first, last], axis=1)[..., None] * (end - start)
    window = np.where(lit[:, None, None], ends, np.nan)
    if not _seen_by_any(window, chain.tables, outline.sharp_obstacles):
        return None
    return Chain(
        facets=(*chain.facets, facet),
        mirrors=np.concatenate([chain.mirrors, outline.facets[facet][None]]),
        images=np.concatenate([chain.images, reflect(image, start, normal)[None]]),
        window=window,
    )


def _reached_part(start: Array, end: Array, image: Array, window: Array) -> tuple[Array, Array]:
    """The part of a facet that rays from images (n, 2) through windows (n, 2, 2) reach: its ends, (n,) each.

    The ends are fractions of the facet's length; obstacles are ignored. The region that the rays reach lies between the
    two rays through the ends of the window, and beyond the window: three linear functions are positive there.
    """
    a, b = window[:, 0], window[:, 1]
    turned = cross2(a - image, b - image) < 0.0
    a, b = np.where(turned[:, None], b, a), np.where(turned[:, None], a, b)
    beyond = cross2(start - a, b - a), cross2(end - a, b - a)
    first, last = np.zeros(len(image)), np.ones(len(image))
    for at_start, at_end in (
        (cross2(a - image, start - image), cross2(a - image, end - image)),
        (cross2(start - image, b - image), cross2(end - image, b - image)),
        beyond,
    ):
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = at_start / (at_start - at_end)
        first = np.where(at_start < 0.0, np.where(at_end > 0.0, np.maximum(first, zero), np.inf), first)
        last = np.where((at_end < 0.0) & (at_start >= 0.0), np.minimum(last, zero), last)
    # Rays reach no part of a facet that lies on the line of the window, or whose window is empty.
    lit = np.maximum(*beyond) > TOUCH * np.linalg.norm(b - a, axis=-1)
    return first, np.where(lit, last, -np.inf)


@njit(error_model="numpy", nogil=True)
def follow(
    px: float,
    py: float,
    enclosing_face: int,
    antenna: int,
    chain: ChainTables,
    obstacles: Obstacles,
    sharp: int,
    cosines: Array,
) -> tuple[complex, float]:
    """Share of the amplitude that arrives, and length [m], of the path from an antenna over a chain to the point p.

    The share is 0 where p is not seen, and that of `penumbras` at the edges of shadows and mirrors. Where the obstacles
    have the wavelength 0, all these edges are sharp; otherwise the ends of the mirror at place `sharp` of the chain are
    (-1 for none). It is 1/2 where the path grazes a sharp end, since the field on the edge of a beam is half of that
    inside. For example, every monostatic path in a dihedral corner passes its vertex, and each of the two orders of
    reflection then contributes a half.

    The folded path is followed back from p: each leg runs towards the next image, up to the mirror of that image.
    ``cosines[i]`` receives the cosine of the angle of incidence on mirror i.
    """
    images, window, mirrors, numbers = chain
    beyond, wavelength = obstacles[2], obstacles[3]
    bounces = mirrors.shape[0]
    ix, iy = images[bounces, antenna, 0], images[bounces, antenna, 1]
    length = np.sqrt((ix - px) ** 2 + (iy - py) ** 2)
    share = 1.0 + 0.0j
    if bounces > 0 and wavelength == 0.0:
        share *= _within(px, py, ix, iy, window[antenna])
        if share == 0.0:
            return 0.0j, length
    x, y, gone, last = px, py, 0.0, -1
    for level in range(bounces, 0, -1):
        mirror, number = mirrors[level - 1], numbers[level - 1]
        ix, iy = images[level, antenna, 0], images[level, antenna, 1]
        dx, dy = ix - x, iy - y
        left = np.sqrt(dx * dx + dy * dy)
        ux, uy = dx / left, dy / left
        ax, ay = mirror[0, 0], mirror[0, 1]
        sx, sy = mirror[1, 0] - ax, mirror[1, 1] - ay
        denominator = ux * sy - uy * sx
        along_ray = ((ax - x) * sy - (ay - y) * sx) / denominator
        cosines[level - 1] = abs(denominator) / np.sqrt(sx * sx + sy * sy)
        if wavelength > 0.0:
            # A point on the last mirror, or on the same side of it as the image, is not seen in it. Where the path
            # leads over the vertex of a corner, it met both mirrors at once, and has its share already.
            if not (-TOUCH if level < bounces else TOUCH) < along_ray < left - TOUCH:
                return 0.0j, length
            if level - 1 == sharp:
                share *= _within(x, y, ix, iy, mirror)
            elif along_ray > TOUCH:
                share *= through_mirror(x, y, ux, uy, gone, length, mirror, beyond[number], wavelength)
        hit_x, hit_y = x + along_ray * ux, y + along_ray * uy
        if share != 0.0:
            share *= let_through(x, y, hit_x, hit_y, gone, length, last, number, obstacles, enclosing_face)
        if share == 0.0:
            return 0.0j, length
        x, y, gone, last, enclosing_face = hit_x, hit_y, gone + along_ray, number, -1
    ox, oy = images[0, antenna, 0], images[0, antenna, 1]
    return share * let_through(x, y, ox, oy, gone, length, last, -1, obstacles, enclosing_face), length


@njit(error_model="numpy", nogil=True)
def _within(px: float, py: float, ix: float, iy: float, window: Array) -> float:
    """Whether the line from the point p to an image leads through the window (2, 2): 1 or 0, and 1/2 on its end."""
    dx, dy = ix - px, iy - py
    length = np.sqrt(dx * dx + dy * dy)
    ax, ay = window[0, 0], window[0, 1]
    sx, sy = window[1, 0] - ax, window[1, 1] - ay
    denominator = dx * sy - dy * sx
    along_ray = ((ax - px) * sy - (ay - py) * sx) / denominator
    # A point on the last mirror, or on the same side of it as the image, is not seen in it.
    if not TOUCH < along_ray * length < length - TOUCH:
        return 0.0
    along_window = ((ax - px) * dy - (ay - py) * dx) / denominator
    end = EDGE / np.sqrt(sx * sx + sy * sy)
    if not -end < along_window < 1.0 + end:
        return 0.0
    return 1.0 if end < along_window < 1.0 - end else 0.5


@njit(makes_arrays=True, error_model="numpy", nogil=True)
def _seen_by_any(next_window: Array, chain: ChainTables, obstacles: Obstacles) -> bool:
    """Whether any antenna sees a sample point of its window on the next mirror over the chain."""
    scratch = np.empty(chain[2].shape[0])
    antennas = next_window.shape[0]
    probes = PROBES // antennas + 1
    for probe in range(-2, probes):
        for n in range(antennas):
            if np.isnan(next_window[n, 0, 0]):
                continue
            # The ends of the window come first: all monostatic paths in a corner pass its vertex.
            u = probe + 2.0 if probe < 0 else (probe + (n + 0.5) / antennas) / probes
            x = next_window[n, 0, 0] + u * (next_window[n, 1, 0] - next_window[n, 0, 0])
            y = next_window[n, 0, 1] + u * (next_window[n, 1, 1] - next_window[n, 0, 1])
            if follow(x, y, -1, n, chain, obstacles, -1, scratch)[0] != 0.0:
                return True
    return False


@dataclass(frozen=True, eq=False)
class ChainPaths:
    """The paths over one chain.

    Attributes
    ----------
    antenna, point : (paths,) arrays of int
        Numbers of the antenna and of the point that each path connects.
    length : (paths,) array [m]
    share : (paths,) complex array
        Share of the amplitude: 1, less in the penumbra of an edge, or 1/2 for a path along the edge of a beam.
    cosine : (bounces, paths) array
        Cosine of the angle of incidence on each mirror.
    end_cosine : (paths,) array
        Cosine of the angle between the path and the normal at the point.
    """

    antenna: NDArray[np.intp]
    point: NDArray[np.intp]
    length: Array
    share: NDArray[np.complex64]
    cosine: Array
    end_cosine: Array

    def spread(self, wavelength: Array) -> Complex:
        """Amplitude ``share / sqrt(length)``, (1, paths), the same at every wavelength: flat mirrors do not focus."""
        return np.asarray(self.share / np.sqrt(self.length))[None]


def trace(chain: Chain, points: Points, outline: Outline, *, sharp: int = -1) -> ChainPaths:
    """All paths from the antennas over the chain to the points that are not obstructed, or only in part.

    Parameters
    ----------
    chain : Chain
    points : Points
    outline : Outline
        Mirrors and obstacles of the scene.
    sharp : int
        Place in the chain of a mirror that has no penumbra, since `edges` adds the waves of its ends; -1 for none.

    Returns
    -------
    ChainPaths
        Sorted by antenna, then by point.
    """
    shape = (chain.images.shape[1], len(points.position))
    share, length, end_cosine = np.zeros(shape, np.complex64), np.empty(shape), np.empty(shape)
    cosine = np.empty((*shape, len(chain.facets)))
    in_shares(
        _trace,
        shape[0],
        points.position,
        points.normal,
        points.enclosing_face,
        chain.tables,
        outline.obstacles,
        sharp,
        share,
        length,
        cosine,
        end_cosine,
    )
    antenna, point = seen = np.nonzero(share)
    return ChainPaths(antenna, point, length[seen], share[seen], cosine[seen].T.copy(), end_cosine[seen])


@njit(error_model="numpy", nogil=True)
def _trace(
    position: Array,
    normal: Array,
    enclosing_face: NDArray[np.int64],
    chain: ChainTables,
    obstacles: Obstacles,
    sharp: int,
    share: NDArray[np.complex64],
    length: Array,
    cosine: Array,
    end_cosine: Array,
    first: int,
    last: int,
) -> None:
    """Fill rows `first` to `last` of the (n, p) tables of the paths; the share stays 0 where there is no path."""
    images = chain[0]
    bounces = images.shape[0] - 1
    for n in range(first, last):
        for p in range(position.shape[0]):
            px, py = position[p, 0], position[p, 1]
            # The last leg arrives from the direction of the last image, whatever the number of mirrors.
            dx, dy = images[bounces, n, 0] - px, images[bounces, n, 1] - py
            facing = dx * normal[p, 0] + dy * normal[p, 1]
            if facing <= 0.0 and (normal[p, 0] != 0.0 or normal[p, 1] != 0.0):
                continue
            share[n, p], length[n, p] = follow(px, py, enclosing_face[p], n, chain, obstacles, sharp, cosine[n, p])
            end_cosine[n, p] = facing / length[n, p]
