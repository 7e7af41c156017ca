"""Step 2, after the fit: where the face of a wall is, which its echoes surround.

A wall is a slab. It scatters on its face; inside, where waves decay; and at its back, which is dimmer than what stands
before it. How much of each is not known, nor how thick the slab is. So every slab is tried at every place in front of
the centres of power. It is as likely as the profile that it would show, blurred by the resolution cell, agrees with the
image. The face is at the mean of these places by their likelihood, and as uncertain as they differ.

The logarithm of the mean power of N independent speckles errs by ``1 / sqrt(N)`` (Goodman, Speckle Phenomena in Optics,
2007), and so slowly along the depth as the cell is wide; that of a face alone, which all depths see, more slowly still.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mirrorfold.common.types import Array, Index
from mirrorfold.detection.mirrors.mirror import WALL_CELLS, WALL_WAVELENGTHS, Mirror
from mirrorfold.detection.search.fit import blocks, cell_side
from mirrorfold.detection.views.view import DEVIATION, View

STEP = 0.1
"""Step of depths in standard deviations of the cell across the wall: a fraction of what the profile tells."""

EVERY = 5
"""So many steps apart the profile is compared: half a standard deviation, which shows all that the cell resolves."""

LOBE = 6.0
"""Half-length of the cell's own profile, in its standard deviations."""

BEFORE, BEYOND = 4.0, 2.0
"""The profile begins so many standard deviations before the centres of power and ends so many behind the deepest
wall."""

SHIFTS = np.arange(-4.0, 0.6, STEP)
"""Where the face is tried, in standard deviations behind the centres of power: the mean depth of a wall that scatters
down to `THICKEST` is at most half of that."""

THINNEST, THICKEST, THICKNESSES = 0.5, 5.0, 8
"""Of slabs, in standard deviations of the cell: thinner ones look like a face alone, thicker ones like the thickest."""

DECAYS = 1.0, 3.0
"""Inside a slab the power does not decay, or decays to ``exp(-x)`` at its back, with these x."""

SHARES = 5
"""Shares of face, inside and back are tried in steps of one in so many."""

LARGEST_BACK = 0.4
"""Share of the power that the back of a slab scatters: it is dimmed by all that stands before it."""

FLOOR = 0.01
"""Power relative to the profile's peak that may come from elsewhere: side lobes of brighter echoes, 20 dB down."""

INEXACT = 0.05
"""Relative error of profiles by interpolation and by the change of the cell along a wall."""

ENOUGH = 200
"""So many independent speckles, an error of 7 %, are enough: where a wall shows more, those where the cell is narrowest
across it are taken, which leave the least open."""

FEWEST = 10
"""Fewer independent speckles, an error of a third, do not move a mirror, but tell how far it may be off."""

BLOCK_CELLS = 6.0
"""Profiles are averaged over so many cells, and then over these blocks, relative to their power each: a bright block
weighs no more than others."""

STRAY = 4.0
"""A block that differs from most by more than so many times the variance of speckle shows another object, too."""

TAIL = 0.2
"""Behind its peak, a profile counts down to this power, relative to the peak: what is deeper may be of other objects,
and says nothing of the face."""

END_CELLS = 1.5
"""This many cells at the ends of a wall may show the side of what adjoins it."""

PLACES = 9
"""Of a wall, evenly drawn, at which the cell across it is looked at."""

COHERENCES = 5
"""Classes of slabs by how far speckle is correlated along the depth."""


class Slabs(NamedTuple):
    """How walls scatter: power at depths [standard deviations], (slabs, depths), and depths' variance, (slabs,). The
    first scatters on its face alone.
    """

    power: Array
    variance: Array
    thickness: Array


class Front(NamedTuple):
    """How far [m] the face of a wall lies in front of the centres of power, and its standard error [m]."""

    depth: float
    error: float


@lru_cache(1)
def slabs() -> Slabs:
    """All slabs that are tried."""
    depth = np.arange(0.0, THICKEST + 1.5 * STEP, STEP)
    face = np.zeros(depth.size)
    face[0] = 1.0
    power, thickness = [face], [0.0]
    shares = [(i / SHARES, k / SHARES) for i in range(SHARES) for k in range(SHARES + 1 - i)]
    for thick in np.geomspace(THINNEST, THICKEST, THICKNESSES):
        back = np.maximum(1.0 - np.abs(depth - thick) / STEP, 0.0)
        for decay in (0.0, *DECAYS):
            inside = np.exp(-decay * depth / thick) * np.clip((thick - depth) / STEP + 0.5, 0.0, 1.0)
            inside[0] *= 0.5
            inside /= inside.sum()
            for of_face, of_back in shares:
                rest = 1.0 - of_face - of_back
                if of_back <= LARGEST_BACK and (rest > 1e-9 or decay == 0.0):
                    power.append(of_face * face + rest * inside + of_back * back)
                    thickness.append(thick)
    table = np.array(power)
    return Slabs(table, table @ depth**2 - (table @ depth) ** 2, np.array(thickness))


def find_front(mirror: Mirror, view: View) -> Front:
    """The face of the wall of a mirror that was fitted to the centres of power."""
    places = mirror.places(view)
    along = (places - mirror.center) @ mirror.tangents.T
    independent = max(mirror.independent(view), 1.0)
    side = cell_side(along, independent)
    chosen, independent = _sharpest(view.extent(places, mirror.normal), along, side, independent)
    spread = DEVIATION * float(np.sqrt(np.mean(view.extent(places[chosen], mirror.normal) ** 2)))
    deepest = min(WALL_CELLS * view.cell_at(mirror.center), WALL_WAVELENGTHS * view.wavelength) / spread
    depth = np.arange(-BEFORE, min(deepest, THICKEST) + BEYOND, STEP * EVERY)
    power = mirror.profiles(view, places, np.broadcast_to(spread * depth, (len(places), depth.size)))[1]
    profile, uneven = _mean_profile(power[chosen], along[chosen], side)
    if not profile.any():
        return Front(0.0, spread)
    last = profile.argmax() + np.append(np.flatnonzero(profile[profile.argmax() :] < TAIL), depth.size)[0]
    profile, uneven, depth = (values[: last + 1] for values in (profile, uneven, depth))

    kinds = slabs()
    possible = kinds.thickness <= deepest
    # The golden ratio draws places from all over a line or a plane.
    drawn = places[chosen[(np.modf(0.618034 * np.arange(1, PLACES + 1))[0] * chosen.size).astype(np.intp)]]
    shown = _shown(kinds.power[possible], cell_across(mirror, view, drawn, spread), depth)
    variance = kinds.variance[possible]
    coherence = _askew(mirror, view, drawn) + variance / (1.0 + variance)
    likelihood = _likelihood(profile, uneven, shown, coherence, depth, independent)
    # Beforehand a face alone is as likely as all slabs together.
    likelihood[0] += np.log(max(variance.size - 1.0, 1.0))
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    # What may well be a face alone is taken for one.
    taken = weight[:1] if weight[0].sum() > 0.5 or independent < FEWEST else weight
    at = float((taken @ SHIFTS).sum() / max(taken.sum(), np.finfo(float).tiny))
    weight = weight.sum(axis=0)
    return Front(-spread * at, spread * float(np.sqrt(weight @ (SHIFTS - at) ** 2)))


def _sharpest(across: Array, along: Array, side: float, independent: float) -> tuple[Index, float]:
    """Places not at the ends of a wall, in `ENOUGH` cells of the narrowest across it; and how many cells these are."""
    first, last = along.min(axis=0), along.max(axis=0)
    end = np.minimum(END_CELLS * side, 0.25 * (last - first))
    inner = np.flatnonzero(np.all((along >= first + end) & (along <= last - end), axis=1))
    inner = inner if inner.size else np.arange(len(across))  # echoes from elsewhere may blur all but the ends
    independent *= inner.size / len(across)
    count = int(np.ceil(inner.size * min(1.0, ENOUGH / independent)))
    return np.sort(inner[np.argsort(across[inner], kind="stable")[:count]]), min(independent, ENOUGH)


def _mean_profile(power: Array, along: Array, side: float) -> tuple[Array, Array]:
    """Mean power (depths,) of places (n, depths), with a peak of one, each block as strong as any other; and the
    variance of that mean by how much blocks differ.
    """
    block = blocks(along, side, BLOCK_CELLS, fewest=3)
    count = np.bincount(block)
    total = np.zeros((count.size, power.shape[1]))
    np.add.at(total, block, power)
    total = np.maximum(total[count >= 0.5 * np.median(count)], 0.0)
    lit = total[total.sum(axis=1) > 0.0]
    if len(lit) < 2:
        return np.zeros(power.shape[1]), np.zeros(power.shape[1])
    lit /= lit.sum(axis=1, keepdims=True)
    usual = np.median(lit, axis=0)
    stray = np.mean((lit / (usual + FLOOR * usual.max()) - 1.0) ** 2, axis=1)
    trust = 1.0 / (1.0 + (stray * BLOCK_CELLS / STRAY) ** 2)
    trust /= trust.sum()
    mean = trust @ lit
    return mean / mean.max(), trust**2 @ (lit - mean) ** 2 / (1.0 - trust.max()) / mean.max() ** 2


def cell_across(mirror: Mirror, view: View, places: Array, spread: float) -> Array:
    """Mean power that a face alone shows at depths up to `LOBE` spreads [m] to both sides of it, (2 LOBE / STEP + 1,).

    Where waves arrive at the angle a to the normal, the face is ``x tan(a)`` farther away at a distance x beside the
    line of sight. The depth z shows ``sum over x of W(z / cos(a) + x tan(a)) B(x)``, with the power B of the beam and
    that of the window, W: of Hann's ``(sinc(q) / (1 - q^2))^2``, q in half its width at half amplitude.
    """
    depth = spread * STEP * np.arange(-round(LOBE / STEP), round(LOBE / STEP) + 1)
    cosine, tangent = _incidence(mirror, view, places)
    aside = np.linspace(-2.5, 2.5, 161)
    range_ = depth / cosine[:, None, None] + (aside[:, None] * (view.cross_cell(places) * tangent)[:, None, None])
    q = 2.0 * range_ / view.range_cell
    q = np.where(np.abs(np.abs(q) - 1.0) < 1e-6, q + 1e-5, q)
    shown = np.einsum("nxz,x->nz", (np.sinc(q) / (1.0 - q**2)) ** 2, view.beam_power(aside))
    return np.mean(shown / shown.sum(axis=1, keepdims=True), axis=0)


def _incidence(mirror: Mirror, view: View, places: Array) -> tuple[Array, Array]:
    """Cosine and tangent of the angle of incidence at places on a mirror, up to 85 degrees, (n,)."""
    offset = places - view.radar
    cosine = np.clip(np.abs(offset @ mirror.normal) / np.linalg.norm(offset, axis=1), 0.087, 1.0)
    return cosine, np.sqrt(1.0 - cosine**2) / cosine


def _askew(mirror: Mirror, view: View, places: Array) -> float:
    """How fast the speckle of a face changes with depth, relative to that of a deep wall: as the cell lies askew to it.

    A Gaussian cell has a correlation of its extents along the normal and along the wall, of which k is the square. The
    speckle of a face is then correlated over a depth z as ``exp(-(k / (1 - k)) (z / s)^2 / 4)``, with s the cell's
    standard deviation across the wall; that of a deep wall as with one more in the place of ``k / (1 - k)``.
    """
    _, tangent = _incidence(mirror, view, places)
    range_, cross = view.range_cell**-2.0, view.cross_cell(places) ** -2.0
    k = (tangent * (range_ - cross)) ** 2 / ((range_ + tangent**2 * cross) * (tangent**2 * range_ + cross))
    return float(np.mean(k / np.maximum(1.0 - k, 0.1)))


def _shown(power: Array, cell: Array, depth: Array) -> Array:
    """Logarithm of what each slab shows at depths, with its face at each of `SHIFTS`, (slabs, shifts, depths)."""
    length = power.shape[1] + cell.size - 1
    profile = np.maximum(np.fft.irfft(np.fft.rfft(power, length) * np.fft.rfft(cell, length), length), 0.0)
    profile = np.log(profile / profile.max(axis=1, keepdims=True) + FLOOR)
    at = np.rint((depth - SHIFTS[:, None] + LOBE) / STEP).astype(np.intp)
    return np.where((at >= 0) & (at < length), profile[:, np.clip(at, 0, length - 1)], np.log(FLOOR))


def _likelihood(
    profile: Array, uneven: Array, shown: Array, coherence: Array, depth: Array, independent: float
) -> Array:  # fmt: skip
    """Logarithm of the likelihood of each slab at each of `SHIFTS`, (slabs, shifts): the profile's errors are Gaussian.

    Speckle errs by ``1 / sqrt(N)``; what differs more between blocks is not speckle.
    """
    level = profile + FLOOR
    measured, speckle = np.log(level), profile / level
    other = INEXACT**2 + (0.5 * FLOOR / level) ** 2 + np.maximum(uneven / level**2 - speckle**2 / independent, 0.0)
    square = np.subtract.outer(depth, depth) ** 2 / 4.0
    result = np.empty(shown.shape[:2])
    classes = np.digitize(coherence, np.quantile(coherence, np.arange(1, COHERENCES) / COHERENCES))
    classes[0] = -1  # a face alone
    for number in np.unique(classes):
        alike = np.flatnonzero(classes == number)
        correlation = np.exp(-coherence[alike].mean() * square)
        covariance = np.outer(speckle, speckle) * correlation / independent + np.diag(other)
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        error, one = (measured - shown[alike]) @ root.T, root.sum(axis=1)
        error -= (error @ one / (one @ one))[..., None] * one  # how bright the wall is, is not known
        result[alike] = np.log(np.diag(root)).sum() - 0.5 * np.einsum("nsz,nsz->ns", error, error)
    return result
