"""Step 2 in three dimensions, second half: flat sheets of echoes are mirrors.

Planes are proposed by three echoes of neighbouring directions, judged by the echoes they pass near (random sample
consensus: Fischler and Bolles, Comm. ACM 24, 1981), refitted to the volume by centroids across them, and tested: large
enough, filled and flat. Their extent is the set of beams that show them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, binary_fill_holes, binary_opening, label

from mirrorfold.common.geometry import reflect, unit
from mirrorfold.detection.volume_echoes import Cloud, RadarVolume

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

MINIMUM_SIZE = 0.40
"""Smallest width and height of a mirror [m]: a torso is a sheet of 0.3 m that bulges less than it speckles."""

SMALLEST_FILL = 0.5
"""Share of its beams in which a mirror's own echo must stand."""

LARGEST_SAGITTA = 0.010
"""A sheet that bulges by more than this [m] is curved: an object, not a plane mirror."""

LARGEST_DEVIATION = 1.2
"""Deviation of a mirror's centroids, relative to the footprint of the beam and `INSIDE_DEVIATION` together: walls show
up to 0.8, for they average over the footprint, the flattest parts of a body 1.3 and more."""

INSIDE_DEVIATION = 0.004
"""What volume scattering adds at most to the deviation of a wall's centroids [m]."""

PROPOSALS = 300
"""Triples drawn for each plane: one in ten falls on a wall that holds a third of the echoes, hence never none."""

PARTNER_STEPS = (5, 18)
"""How many beams the other two echoes of a triple are away: beyond the speckle of one beam, within one wall."""

JUDGES = 3000
"""Echoes, evenly drawn, that judge a proposal."""

FEWEST_ECHOES = 30
"""A sheet of fewer echoes says too little about its direction."""

MAXIMUM_PLANES = 24
FAILURES = 2
"""A room has a dozen visible walls; after so many proposals in a row that are no mirrors there are no more."""

FOOTPRINT = 0.354
"""Standard deviation of the two-way beam's power, in beam radii: ``1 / (2 sqrt 2)``."""

GAP_BEAMS = 3
"""A wall goes on behind gaps of this many beams: speckle fades over one or two."""

PROFILE_STEP = 0.001
PROFILE_REACH = 0.06
"""Step and half-length of the mean profile across a wall [m]: volume scattering reaches 1-3 cm deep."""

LARGEST_DEPTH = 0.04
"""Deepest volume scattering that the leading edge of a wall is corrected for [m]."""

CLIP = 2.0
"""Echoes weigh with their amplitude up to this many times the median, so that glints do not steer a fit."""


@dataclass(frozen=True, eq=False)
class PlaneMirror:
    """A plane mirror detected in a raster volume.

    Attributes
    ----------
    center : (3,) array [m]
        Mean of its face, in the coordinates of the volume (a mirror seen through another is a ghost itself).
    normal : (3,) array
        Unit normal, towards the radar.
    outline : (n, 3) array [m]
        Corners of the hull of all that is seen of it.
    beams : (azimuths * elevations,) bool array
        Which beams meet it.
    strength : float
        Median normalised amplitude of its echoes.
    angle_error : float [degree]
    offset_error : float [m]
        Standard errors of the fitted plane's direction and of its position at the center.
    fill : float
        Share of its beams that show its echo.
    depth : float [m]
        How deep the centroid of its echoes lies behind its face.
    """

    center: Array
    normal: Array
    outline: Array = field(repr=False)
    beams: Mask = field(repr=False)
    strength: float = 1.0
    angle_error: float = 0.0
    offset_error: float = 0.0
    fill: float = 1.0
    depth: float = 0.0

    @property
    def right(self) -> Array:
        """Horizontal unit vector in the plane, (3,)."""
        across = np.cross([0.0, 0.0, 1.0], self.normal)
        return unit(across) if np.linalg.norm(across) > 1e-6 else np.array([1.0, 0.0, 0.0])

    @property
    def extent(self) -> tuple[float, float]:
        """Width along `right` and height across it [m]."""
        up = np.cross(self.normal, self.right)
        return float(np.ptp(self.outline @ self.right)), float(np.ptp(self.outline @ up))

    @property
    def start(self) -> Array:
        """One end of its horizontal middle line, (3,) [m]."""
        along = (self.outline - self.center) @ self.right
        return np.asarray(self.center + along.min() * self.right)

    @property
    def end(self) -> Array:
        """The other end, (3,) [m]."""
        along = (self.outline - self.center) @ self.right
        return np.asarray(self.center + along.max() * self.right)

    @property
    def length(self) -> float:
        """Width along `right` [m]."""
        return self.extent[0]

    def beside(self, points: Array) -> Array:
        """Signed distance [m] of points (..., 3) from the plane, positive on the radar's side."""
        return np.asarray((points - self.center) @ self.normal)

    def crossing(self, volume: RadarVolume) -> Array:
        """Range [m] at which each beam meets the mirror, (beams,); infinite where it does not."""
        return np.where(self.beams, plane_ranges(volume, self.normal, self.center), np.inf)

    def reflected(self, other: PlaneMirror) -> PlaneMirror:
        """The mirror image of this mirror in `other`."""
        turned = reflect(self.center + self.normal, other.center, other.normal)
        center = reflect(self.center, other.center, other.normal)
        return replace(
            self, center=center, normal=turned - center, outline=reflect(self.outline, other.center, other.normal)
        )


def plane_ranges(volume: RadarVolume, normal: Array, center: Array) -> Array:
    """Range [m] at which each beam meets an endless plane, (beams,); infinite where it does not."""
    towards = volume.sight.reshape(-1, 3) @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        range_ = float((center - volume.origin) @ normal) / towards
    return np.where(range_ > 0.0, range_, np.inf)


def spread_across(volume: RadarVolume, range_: Array, cosine: Array) -> Array:
    """Standard deviation [m], across a surface met at that cosine, of the echoes that a beam gathers on it.

    The beam's footprint, seen obliquely, and the range cell (for a Hann window, of power, 0.3 of its width).
    """
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    return np.hypot(FOOTPRINT * volume.width(range_) * sine, 0.3 * volume.range_cell * cosine)


def find_planes(
    cloud: Cloud, volume: RadarVolume, *, usable: Mask | None = None, minimum_size: float = MINIMUM_SIZE, seed: int = 0
) -> list[PlaneMirror]:
    """Plane mirrors among the echoes of a volume, from the largest.

    Parameters
    ----------
    cloud : Cloud
    volume : RadarVolume
    usable : (n,) bool array, optional
        Echoes that may be evidence; all by default.
    minimum_size : float [m]
        Smallest width and height.
    seed : int
        Of the random proposals.
    """
    generator = np.random.default_rng(seed)
    free = np.ones(cloud.range.size, dtype=bool) if usable is None else usable.copy()
    found: list[PlaneMirror] = []
    failures = 0
    for _ in range(MAXIMUM_PLANES):
        open_ = np.flatnonzero(free)
        if open_.size < FEWEST_ECHOES or failures > FAILURES:
            break
        proposal = _propose(cloud.take(open_), volume, generator)
        if proposal is None:
            break
        mirror, member = _settle(*proposal, cloud, free, volume, minimum_size)
        if mirror is None:
            failures += 1
            free &= ~member
            if not member.any():
                break
            continue
        failures = 0
        found.append(mirror)
        cosine = np.abs(volume.sight.reshape(-1, 3)[cloud.beam] @ mirror.normal)
        across = volume.range_cell + 4.0 * spread_across(volume, cloud.range, cosine)
        free &= ~(mirror.beams[cloud.beam] & (np.abs(mirror.beside(cloud.position)) < across + mirror.depth))
    return sorted(found, key=lambda mirror: -float(mirror.beams.sum()))


def _propose(cloud: Cloud, volume: RadarVolume, generator: np.random.Generator) -> tuple[Array, Array] | None:
    """Normal and a point of the plane near most echoes, weighted by clipped amplitude."""
    weight = np.minimum(cloud.amplitude, CLIP * np.median(cloud.amplitude))
    order = np.argsort(cloud.beam, kind="stable")
    cloud, weight = cloud.take(order), weight[order]
    total = np.cumsum(weight)
    seeds = np.searchsorted(total, generator.uniform(0.0, total[-1], PROPOSALS))
    low, high = PARTNER_STEPS
    turn = generator.uniform(0.0, 2.0 * np.pi, PROPOSALS)
    # The second partner stands at a right angle to the first, more or less.
    turns = np.stack([turn, turn + generator.uniform(0.25 * np.pi, 0.75 * np.pi, PROPOSALS)])
    steps = generator.uniform(low, high, (2, PROPOSALS))
    rows = volume.shape[1]
    first = np.searchsorted(cloud.beam, np.arange(rows * volume.shape[0] + 1))
    triples = [seeds]
    valid = np.ones(PROPOSALS, dtype=bool)
    for angle, away in zip(turns, steps, strict=True):
        column = cloud.beam[seeds] // rows + np.rint(away * np.cos(angle)).astype(np.intp)
        row = cloud.beam[seeds] % rows + np.rint(away * np.sin(angle)).astype(np.intp)
        valid &= (column >= 0) & (column < volume.shape[0]) & (row >= 0) & (row < rows)
        beam = np.where(valid, column * rows + row, 0)
        partner = np.full(PROPOSALS, -1)
        for i in np.flatnonzero(valid & (first[beam + 1] > first[beam])):
            there = np.arange(first[beam[i]], first[beam[i] + 1])
            partner[i] = there[np.argmin(np.abs(cloud.range[there] - cloud.range[seeds[i]]))]
        valid &= partner >= 0
        triples.append(partner)
    a, b, c = (cloud.position[t[valid]] for t in triples)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    good = length > 1e-9
    if not good.any():
        return None
    normal, a = normal[good] / length[good, None], a[good]
    judge = np.linspace(0, cloud.range.size - 1, min(JUDGES, cloud.range.size)).astype(np.intp)
    votes = np.zeros(len(normal))
    sight = volume.sight.reshape(-1, 3)[cloud.beam[judge]]
    _judge(cloud.position[judge], sight, volume.width(cloud.range[judge]), weight[judge],
           normal, a, 0.5 * volume.range_cell, votes)  # fmt: skip
    best = int(np.argmax(votes))
    return normal[best], a[best]


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _judge(points, sight, width, weight, normal, on_plane, cell, votes):  # type: ignore[no-untyped-def]
    """Sum of the weights of the echoes within a cell and half a footprint of each plane."""
    for h in range(votes.size):
        n0, n1, n2 = normal[h]
        offset = on_plane[h, 0] * n0 + on_plane[h, 1] * n1 + on_plane[h, 2] * n2
        total = 0.0
        for i in range(weight.size):
            distance = abs(points[i, 0] * n0 + points[i, 1] * n1 + points[i, 2] * n2 - offset)
            cosine = sight[i, 0] * n0 + sight[i, 1] * n1 + sight[i, 2] * n2
            if distance < cell + 0.5 * width[i] * np.sqrt(max(1.0 - cosine * cosine, 0.0)):
                total += weight[i]
        votes[h] = total


def _near(cloud: Cloud, volume: RadarVolume, normal: Array, center: Array) -> Mask:
    """Echoes that may belong to a plane: within three standard deviations of a beam's echo on it."""
    cosine = np.abs(volume.sight.reshape(-1, 3)[cloud.beam] @ normal)
    return np.abs((cloud.position - center) @ normal) < 3.0 * spread_across(volume, cloud.range, cosine)


def _settle(
    normal: Array, center: Array, cloud: Cloud, free: Mask, volume: RadarVolume, minimum_size: float
) -> tuple[PlaneMirror | None, Mask]:
    """The mirror that a proposal grows to, None if it is none; and the echoes that it was judged by."""
    for _ in range(4):
        member = free & _near(cloud, volume, normal, center)
        if member.sum() < FEWEST_ECHOES:
            return None, member
        normal, center = _least_squares(cloud, volume, member, normal)
    beams = _largest_region(cloud, volume, member, normal, center)
    member &= beams[cloud.beam]
    for _ in range(3):
        if member.sum() < FEWEST_ECHOES:
            return None, member
        normal, center = _least_squares(cloud, volume, member, normal)
        near = _near(cloud, volume, normal, center)
        beams = _largest_region(cloud, volume, free & near, normal, center)
        member = free & near & beams[cloud.beam]
    if member.sum() < FEWEST_ECHOES or beams.sum() < FEWEST_ECHOES:
        return None, member
    normal = normal * -np.sign((center - volume.origin) @ normal)
    fill = np.unique(cloud.beam[member]).size / max(int(beams.sum()), 1)
    points = _face(volume, normal, center, beams)
    mirror = PlaneMirror(center, normal, points, beams, fill=fill)
    if fill < SMALLEST_FILL or min(mirror.extent) < minimum_size or _sagitta(cloud, mirror, member) > LARGEST_SAGITTA:
        return None, member
    normal, center, angle_error, offset_error, flat = _refit(volume, mirror)
    if not flat:
        return None, member
    depth = _leading_edge(volume, normal, center, beams)
    center = center + depth * normal
    points = _face(volume, normal, center, beams)
    middle = points.mean(axis=0)
    return (
        PlaneMirror(
            center=middle, normal=normal, outline=_hull(points, normal), beams=beams,
            strength=float(np.median(cloud.amplitude[member])), angle_error=angle_error, offset_error=offset_error,
            fill=min(fill, 1.0), depth=depth,
        ),
        member,
    )  # fmt: skip


def _least_squares(cloud: Cloud, volume: RadarVolume, member: Mask, normal: Array) -> tuple[Array, Array]:
    """Total least squares with weights: amplitude, clipped, over the variance of an echo's place."""
    points = cloud.position[member]
    cosine = np.abs(volume.sight.reshape(-1, 3)[cloud.beam[member]] @ normal)
    weight = np.minimum(cloud.amplitude[member], CLIP * np.median(cloud.amplitude[member]))
    weight = weight / spread_across(volume, cloud.range[member], cosine) ** 2
    return _weighted_plane(points, weight)


def _weighted_plane(points: Array, weight: Array) -> tuple[Array, Array]:
    """Normal and centroid of the plane with the least weighted squared distances."""
    center = weight @ points / weight.sum()
    offset = points - center
    return np.linalg.eigh((offset * weight[:, None]).T @ offset)[1][:, 0], center


def _largest_region(cloud: Cloud, volume: RadarVolume, member: Mask, normal: Array, center: Array) -> Mask:
    """The largest connected set of beams that show a plane, its small gaps closed, (beams,)."""
    meets = plane_ranges(volume, normal, center) <= volume.range[-1]
    lit = np.zeros(volume.shape, dtype=bool)
    lit.ravel()[cloud.beam[member]] = True
    pad = GAP_BEAMS + 1
    closed = binary_closing(np.pad(lit, pad), iterations=GAP_BEAMS)[pad:-pad, pad:-pad]
    # Threads of chance echoes do not join two walls.
    closed = binary_opening(np.pad(closed, 2, mode="edge"), iterations=2)[2:-2, 2:-2]
    regions, count = label(closed)
    if not count:
        return np.zeros(lit.size, dtype=bool)
    largest = 1 + int(np.argmax(np.bincount(regions.ravel())[1:]))
    return np.asarray(binary_fill_holes(regions == largest)).ravel() & meets


def _face(volume: RadarVolume, normal: Array, center: Array, beams: Mask) -> Array:
    """Where the beams meet the plane, (n, 3) [m]."""
    range_ = plane_ranges(volume, normal, center)[beams]
    return np.asarray(volume.origin + range_[:, None] * volume.sight.reshape(-1, 3)[beams])


def _sagitta(cloud: Cloud, mirror: PlaneMirror, member: Mask) -> float:
    """How far [m] the best paraboloid through the echoes bulges over the extent of the mirror."""
    offset = cloud.position[member] - mirror.center
    half = 0.5 * np.array(mirror.extent)
    u, v = offset @ mirror.right / half[0], offset @ np.cross(mirror.normal, mirror.right) / half[1]
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    bend = np.linalg.lstsq(terms, offset @ mirror.normal, rcond=None)[0][3:]
    return float(np.max(np.abs(bend[[0, 2]])))


def _refit(volume: RadarVolume, mirror: PlaneMirror) -> tuple[Array, Array, float, float, bool]:
    """The plane through the centres of power of all its beams: normal, a point, both standard errors, and its flatness.

    A beam gathers echoes from all of its footprint, symmetrically about its axis: their centre of power lies on the
    plane, where single echoes are off by the footprint.
    """
    normal, center = mirror.normal, mirror.center
    sight = volume.sight.reshape(-1, 3)
    beams = np.flatnonzero(mirror.beams)
    for _ in range(3):
        predicted = plane_ranges(volume, normal, center)[beams]
        cosine = np.abs(sight[beams] @ normal)
        spread = spread_across(volume, predicted, cosine)
        half = (3.0 * spread + 0.5 * LARGEST_DEPTH) / cosine
        centroid, power = np.zeros(beams.size), np.zeros(beams.size)
        _centroids(volume.amplitude.reshape(-1, volume.range.size), beams, predicted, half, float(volume.range[0]),
                   volume.step, 2.0 * volume.noise**2, centroid, power)  # fmt: skip
        good = power > 0.0
        points = volume.origin + centroid[good, None] * sight[beams[good]]
        weight = 1.0 / spread[good] ** 2
        across = (points - center) @ normal
        deviation = 1.4826 * float(np.median(np.abs(across - np.median(across)))) + 1e-9
        weight = weight / (1.0 + (np.abs(across - np.median(across)) / (2.0 * deviation)) ** 4)
        fitted, center = _weighted_plane(points, weight)
        normal = fitted * np.sign(fitted @ normal)
    # Beams a beam radius apart see the same speckle: fewer of them are independent.
    shared = float(np.mean(np.maximum(volume.width(predicted) / (volume.beam_step * predicted), 1.0) ** 2))
    independent = max(float(good.sum()) / shared, 3.0)
    size = float(np.sqrt(np.linalg.eigvalsh(np.cov(points.T))[1]))
    offset_error = deviation / np.sqrt(independent)
    flat = deviation <= LARGEST_DEVIATION * float(np.hypot(np.median(spread), INSIDE_DEVIATION))
    return normal, center, float(np.degrees(offset_error / max(size, 1e-6))), offset_error, flat


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _centroids(amplitude, beams, predicted, half, first, step, noise, centroid, power):  # type: ignore[no-untyped-def]
    """Centre of power [m] of each beam within `half` of its predicted range, the mean noise power taken off."""
    for i in range(beams.size):
        low = max(int(np.ceil((predicted[i] - half[i] - first) / step)), 0)
        high = min(int((predicted[i] + half[i] - first) / step), amplitude.shape[1] - 1)
        moment = 0.0
        for n in range(low, high + 1):
            excess = amplitude[beams[i], n] ** 2 - noise
            power[i] += excess
            moment += n * excess
        if power[i] > 0.0:
            centroid[i] = first + step * moment / power[i]


def _leading_edge(volume: RadarVolume, normal: Array, center: Array, beams: Mask) -> float:
    """How far [m] the face of a wall lies in front of the centroids of its echoes.

    The mean power across the wall is a Gaussian of known width, the footprint's, for what scatters on the face,
    and the same convolved with an exponential decay for what scatters inside (Grushka, Anal. Chem. 44, 1972).
    """
    from scipy.optimize import least_squares
    from scipy.special import erfcx

    which = np.flatnonzero(beams)
    predicted = plane_ranges(volume, normal, center)[which]
    cosine = np.abs(volume.sight.reshape(-1, 3)[which] @ normal)
    spread = spread_across(volume, predicted, cosine)
    z = np.arange(-PROFILE_REACH, PROFILE_REACH + 0.5 * PROFILE_STEP, PROFILE_STEP)
    profile = np.zeros(z.size)
    _stack(volume.amplitude.reshape(-1, volume.range.size), which, predicted, 1.0 / cosine, float(volume.range[0]),
           volume.step, 2.0 * volume.noise**2, z, profile)  # fmt: skip
    if profile.max() <= 0.0:
        return 0.0
    profile /= profile.max()
    sigma = float(np.sqrt(np.mean(spread**2)))

    def model(p: Array) -> Array:
        at, width, face, inside, depth = p
        s = sigma * width
        t = (z - at) / s
        gauss = np.exp(-0.5 * t**2)
        rate = s / depth
        with np.errstate(over="ignore", invalid="ignore"):
            tail = np.sqrt(np.pi / 2.0) * rate * erfcx((rate - t) / np.sqrt(2.0)) * gauss
        tail = np.where(np.isfinite(tail), tail, rate * np.sqrt(2.0 * np.pi) * np.exp(0.5 * rate**2 - rate * t))
        return np.asarray(face * gauss + inside * tail)

    start = np.array([-0.3 * sigma, 1.0, 0.5, 0.5, 0.006])
    low, high = [-LARGEST_DEPTH, 0.95, 0.0, 0.0, 0.001], [LARGEST_DEPTH, 1.05, 4.0, 8.0, LARGEST_DEPTH]
    fit = least_squares(lambda p: model(p) - profile, start, bounds=(low, high))
    return float(np.clip(-fit.x[0], 0.0, LARGEST_DEPTH))


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _stack(amplitude, beams, predicted, stretch, first, step, noise, z, profile):  # type: ignore[no-untyped-def]
    """Mean power at the depths z behind a plane, over beams; each weighs with its own total."""
    line = np.empty(z.size)
    for i in range(beams.size):
        total = 0.0
        for k in range(z.size):
            at = (predicted[i] + z[k] * stretch[i] - first) / step
            n = int(at)
            line[k] = 0.0
            if at >= 0.0 and n + 1 < amplitude.shape[1]:
                share = at - n
                value = amplitude[beams[i], n] * (1.0 - share) + amplitude[beams[i], n + 1] * share
                line[k] = value * value - noise
            total += line[k]
        if total > 0.0:
            for k in range(z.size):
                profile[k] += line[k] / total


def _hull(points: Array, normal: Array) -> Array:
    """Corners of the convex hull of points (n, 3) of a plane, in order."""
    from scipy.spatial import ConvexHull

    across = np.cross([0.0, 0.0, 1.0], normal)
    right = unit(across) if np.linalg.norm(across) > 1e-6 else np.array([1.0, 0.0, 0.0])
    flat = np.stack([points @ right, points @ np.cross(normal, right)], axis=1)
    return np.asarray(points[ConvexHull(flat).vertices])
