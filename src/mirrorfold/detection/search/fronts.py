"""Step 2, after the fit: where the face of a wall lies within the depth over which its echoes are spread.

A wall is taken for a slab. It scatters on its face; inside, where waves decay; and at its back, which is dimmed by all
that lies before it. The shares of the three, and the thickness, are not known. Therefore many slabs are tried, each
with its face at many depths. Each predicts a profile of power across the wall, blurred by the resolution cell, and the
better it agrees with that of the image, the likelier it is. The position of the face is the mean of all that are tried,
weighted with their likelihood, and its standard error is their standard deviation.

The logarithm of the mean power of N independent speckles has the error ``1 / sqrt(N)`` (Goodman, Speckle Phenomena in
Optics, 2007). At depths closer to each other than the cell is wide, these errors are nearly the same; for a face alone
at all depths, since all of them show the same speckle.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array, Complex, Index, Mask
from mirrorfold.common.windows import half_amplitude_width, hann, spectrum_of
from mirrorfold.detection.mirrors.mirror import WALL_CELLS, WALL_WAVELENGTHS, Mirror
from mirrorfold.detection.search.fit import blocks, cell_side
from mirrorfold.detection.views.view import DEVIATION, View

STEP = 0.1
"""Step of depths, in standard deviations of the cell across the wall; much finer than the profile resolves."""

STEPS_APART = 5
"""Number of steps between the depths at which profiles are compared: half a standard deviation, which shows all that
the cell resolves."""

LOBE = 6.0
"""Half-length of the profile of the cell itself, in its standard deviations."""

BEFORE, BEYOND = 4.0, 2.0
"""The profile begins `BEFORE` standard deviations in front of the centroids of power, and ends `BEYOND` behind the
deepest wall."""

SHIFTS = np.arange(-4.0, 0.6, STEP)
"""Depths of the face that are tried, in standard deviations behind the centroids of power: the mean depth of a slab
is at most 3.5, with `THICKEST` and `LARGEST_BACK`."""

THINNEST, THICKEST, THICKNESSES = 0.5, 5.0, 8
"""Least and largest thickness of slabs, in standard deviations of the cell, and number of thicknesses: thinner slabs
look like a face alone, thicker ones like the thickest."""

DECAYS = 1.0, 3.0
"""Inside a slab, the power is constant, or decays to ``exp(-x)`` at its back, with these values of x."""

SHARES = 5
"""The shares of the power from the face, the inside and the back are tried in steps of ``1 / SHARES``."""

LARGEST_BACK = 0.4
"""Largest share of the power that the back of a slab scatters: it is dimmed by all that lies before it."""

TABLE_STEP, LARGEST_Q = 2.0**-8, 16.0
"""Step and end of the table of the window's power against q: interpolated to 1e-5 of its peak, and 1e-8 at its end."""

FINE_SAMPLES, HANN_POINTS = 128, 256
"""Samples of a window's spectrum in the inverse of its length, so many that it is right to 1e-4 of its peak between
them; and number of weights where only the window's name is known."""

FLOOR = 0.01
"""Power, relative to the profile's peak, that may not be of the wall: side lobes of brighter echoes, 20 dB down."""

INEXACT = 0.05
"""Relative error of profiles, from interpolation and from the change of the cell along a wall."""

MOST_SPECKLES = 200
"""Largest number of independent speckles that are used; their error is 7 %. Where a wall shows more, the places are
used at which the cell is narrowest across the wall, because these resolve its depth best."""

FEWEST = 10
"""Least number of independent speckles with which a wall can be found to scatter from inside. With fewer, whose error
is a third, the wall is taken to scatter on its face alone, but all slabs add to its standard error."""

BLOCK_CELLS = 6.0
"""Profiles are averaged over blocks of so many cells. Then the blocks are averaged, each relative to its own power, so
that a bright block has no more weight than others."""

STRAY = 4.0
"""Mean squared deviation of a block from the median block, in multiples of the variance of speckle, at which its weight
is one half: it shows another object, too."""

TAIL = 0.2
"""Behind its peak, a profile is used down to this power, relative to the peak: what lies deeper may be of other
objects, and says nothing of the face."""

END_CELLS, END_SHARE = 1.5, 0.25
"""Length that is left out at either end of a wall, in cells, as it may show the side of an adjoining wall; but at most
this share of its length, so that half of a short wall is left."""

BEAM_CELLS, BEAM_SAMPLES = 2.5, 161
"""Distance to either side, in resolution cells, over which the power of a beam is summed up, and number of samples: it
holds the main lobe and the first side lobes of an array, each with a dozen samples or more."""

GRAZING = 0.087
"""Least cosine of an angle of incidence, that of 85 degrees: closer to the wall, the tangent says nothing any more."""

PLACES = 9
"""Number of places on a wall, evenly drawn, for which the profile of the cell is computed."""

LEAST_UNCORRELATED = 0.1
"""Least value of ``1 - k`` in `_face_decorrelation`: where it is less, the speckle of a face changes within a third of
a standard deviation of the cell, which is finer than the depths at which profiles are compared."""

COHERENCES = 5
"""Number of classes of slabs, by how far their speckle is correlated along the depth."""


class Slabs(NamedTuple):
    """Models of walls: their power at depths behind the face, (slabs, depths), the variance of the depth, weighted with
    that power, (slabs,), and the thickness, (slabs,); in standard deviations of the cell. The first model scatters on
    its face alone.
    """

    power: Array
    variance: Array
    thickness: Array


class Front(NamedTuple):
    """How far [m] the face of a wall lies in front of the centroids of power, and its standard error [m]."""

    depth: float
    error: float


@lru_cache(1)
def slabs() -> Slabs:
    """All models of walls that are tried."""
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


@lru_cache(4)
def _slab_spectra(length: int) -> Complex:
    """Spectra of the power of all `slabs`, filled up to the given number of samples, (slabs, length // 2 + 1)."""
    return np.fft.rfft(slabs().power, length)


def find_front(mirror: Mirror, view: View) -> Front:
    """Where the face of a wall is, given the mirror that was fitted to the centroids of power."""
    places = mirror.places(view)
    along = (places - mirror.center) @ mirror.tangents.T
    independent = max(mirror.independent(view), 1.0)
    side = cell_side(along, independent)
    chosen, independent = _best_resolved(view.extent(places, mirror.normal), along, side, independent)
    spread = DEVIATION * float(np.sqrt(np.mean(view.extent(places[chosen], mirror.normal) ** 2)))
    deepest = min(WALL_CELLS * view.cell_at(mirror.center), WALL_WAVELENGTHS * view.wavelength) / spread
    depth = np.arange(-BEFORE, min(deepest, THICKEST) + BEYOND, STEP * STEPS_APART)
    power = mirror.profiles(view, places, np.broadcast_to(spread * depth, (len(places), depth.size)))[1]
    profile, uneven = _mean_profile(power[chosen], along[chosen], side)
    if not profile.any():
        return Front(0.0, spread)
    last = profile.argmax() + np.append(np.flatnonzero(profile[profile.argmax() :] < TAIL), depth.size)[0]
    profile, uneven, depth = (values[: last + 1] for values in (profile, uneven, depth))

    models = slabs()
    possible = models.thickness <= deepest
    # The golden ratio draws places from all over a line or a plane.
    drawn = places[chosen[(np.modf(0.618034 * np.arange(1, PLACES + 1))[0] * chosen.size).astype(np.intp)]]
    predicted = _predicted(possible, cell_across(mirror, view, drawn, spread), depth)
    variance = models.variance[possible]
    decorrelation = _face_decorrelation(mirror, view, drawn) + variance / (1.0 + variance)
    likelihood = _likelihood(profile, uneven, predicted, decorrelation, depth, independent)
    # Prior probability: a face alone is as likely as all slabs together.
    likelihood[0] += np.log(max(variance.size - 1.0, 1.0))
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    # A wall that probably is a face alone is taken for one.
    taken = weight[:1] if weight[0].sum() > 0.5 or independent < FEWEST else weight
    at = float((taken @ SHIFTS).sum() / max(taken.sum(), np.finfo(float).tiny))
    weight = weight.sum(axis=0)
    return Front(-spread * at, spread * float(np.sqrt(weight @ (SHIFTS - at) ** 2)))


def _best_resolved(across: Array, along: Array, side: float, independent: float) -> tuple[Index, float]:
    """The places at which the cell is narrowest across the wall, without its ends, in at most `MOST_SPECKLES` cells.

    Returns the numbers of these places, and how many independent cells they fill.
    """
    first, last = along.min(axis=0), along.max(axis=0)
    end = np.minimum(END_CELLS * side, END_SHARE * (last - first))
    inner = np.flatnonzero(np.all((along >= first + end) & (along <= last - end), axis=1))
    inner = inner if inner.size else np.arange(len(across))  # echoes from elsewhere may blur all but its ends
    independent *= inner.size / len(across)
    count = int(np.ceil(inner.size * min(1.0, MOST_SPECKLES / independent)))
    return np.sort(inner[np.argsort(across[inner], kind="stable")[:count]]), min(independent, MOST_SPECKLES)


def _mean_profile(power: Array, along: Array, side: float) -> tuple[Array, Array]:
    """Mean profile (depths,) of profiles (n, depths) at positions `along` a wall, normalised to a peak of one.

    Each block of the wall is normalised to the same power, and outliers among the blocks have less weight. Also the
    variance of that mean, (depths,), from how much the blocks differ.
    """
    block = blocks(along, side, BLOCK_CELLS, fewest=3)
    count = np.bincount(block)
    total = np.zeros((count.size, power.shape[1]))
    np.add.at(total, block, power)
    total = np.maximum(total[count >= 0.5 * np.median(count)], 0.0)
    bright = total[total.sum(axis=1) > 0.0]
    if len(bright) < 2:
        return np.zeros(power.shape[1]), np.zeros(power.shape[1])
    bright /= bright.sum(axis=1, keepdims=True)
    usual = np.median(bright, axis=0)
    stray = np.mean((bright / (usual + FLOOR * usual.max()) - 1.0) ** 2, axis=1)
    trust = 1.0 / (1.0 + (stray * BLOCK_CELLS / STRAY) ** 2)
    trust /= trust.sum()
    mean = trust @ bright
    return mean / mean.max(), trust**2 @ (bright - mean) ** 2 / (1.0 - trust.max()) / mean.max() ** 2


def cell_across(mirror: Mirror, view: View, places: Array, spread: float) -> Array:
    """Profile of a face alone, up to `LOBE` times the `spread` [m] to both sides, (2 LOBE / STEP + 1,).

    At the angle of incidence a, the face is ``x tan(a)`` farther away at the distance x beside the line of sight. So at
    the depth z the power is ``sum over x of W(z / cos(a) + x tan(a)) B(x)``, with B the power of the beam, and W that
    of the spectrum of the window over frequency, at q in half its width at half amplitude. The result is the mean over
    the `places`.
    """
    depth = spread * STEP * np.arange(-round(LOBE / STEP), round(LOBE / STEP) + 1)
    cosine, tangent = _incidence(mirror, view, places)
    aside = np.linspace(-BEAM_CELLS, BEAM_CELLS, BEAM_SAMPLES)
    cells = 2.0 / view.range_cell / TABLE_STEP
    predicted = np.zeros((len(places), depth.size))
    _through_cell(
        cells * depth[None] / cosine[:, None], cells * (view.cross_cell(places) * tangent)[:, None] * aside,
        view.beam_power(aside), _window_power(view.window.tobytes()), predicted,
    )  # fmt: skip
    return np.mean(predicted / predicted.sum(axis=1, keepdims=True), axis=0)


@lru_cache(4)
def _window_power(weights: bytes) -> Array:
    """Power of a window's spectrum, W of `cell_across`, at q in steps of `TABLE_STEP` up to `LARGEST_Q`; then zero.

    The `weights` (n,) are real numbers in double precision, as bytes; without any, they are those of Hann.
    """
    window = np.frombuffer(weights) if weights else hann(HANN_POINTS)
    level = spectrum_of(window, FINE_SAMPLES)
    q = np.arange(0.0, LARGEST_Q, TABLE_STEP) * 0.5 * half_amplitude_width(window)
    return np.append(np.interp(q, np.arange(level.size) / FINE_SAMPLES, level, right=0.0) ** 2, [0.0, 0.0])


@njit(nogil=True, error_model="numpy")
def _through_cell(depth: Array, farther: Array, beam: Array, window: Array, out: Array) -> None:
    """``sum over x of window[|depth[n, z] + farther[n, x]|] beam[x]``, interpolated in the window, (n, z)."""
    for n in range(depth.shape[0]):
        for x in range(beam.size):
            for z in range(depth.shape[1]):
                at = min(abs(depth[n, z] + farther[n, x]), window.size - 2.0)
                first = int(at)
                value = window[first] + (at - first) * (window[first + 1] - window[first])
                out[n, z] += beam[x] * value


def _incidence(mirror: Mirror, view: View, places: Array) -> tuple[Array, Array]:
    """Cosine, at least `GRAZING`, and tangent of the angle of incidence at places (n, d) on a mirror, (n,) each."""
    offset = places - view.radar
    cosine = np.clip(np.abs(offset @ mirror.normal) / np.linalg.norm(offset, axis=1), GRAZING, 1.0)
    return cosine, np.sqrt(1.0 - cosine**2) / cosine


def _face_decorrelation(mirror: Mirror, view: View, places: Array) -> float:
    """How fast the speckle of a face changes with depth, because the cell lies askew to it: the mean k / (1 - k).

    k is the squared correlation of the extents of a Gaussian cell along the normal and along the wall. Over a depth z,
    the speckle of a face has the correlation ``exp(-(k / (1 - k)) (z / s)^2 / 4)``, with s the standard deviation of
    the cell across the wall. For a slab whose depth has the `variance` v, ``v / (1 + v)`` is added to ``k / (1 - k)``.
    """
    _, tangent = _incidence(mirror, view, places)
    range_, cross = view.range_cell**-2.0, view.cross_cell(places) ** -2.0
    k = (tangent * (range_ - cross)) ** 2 / ((range_ + tangent**2 * cross) * (tangent**2 * range_ + cross))
    return float(np.mean(k / np.maximum(1.0 - k, LEAST_UNCORRELATED)))


def _predicted(possible: Mask, cell: Array, depth: Array) -> Array:
    """Logarithm of the profile of each slab at the given depths, its face at each of `SHIFTS`, (slabs, shifts, depths).

    They are the `possible` ones of all `slabs`. A profile is the convolution of the power of a slab with that of the
    `cell` (m,), plus `FLOOR`.
    """
    length = slabs().power.shape[1] + cell.size - 1
    profile = np.maximum(np.fft.irfft(_slab_spectra(length)[possible] * np.fft.rfft(cell, length), length), 0.0)
    profile = np.log(profile / profile.max(axis=1, keepdims=True) + FLOOR)
    at = np.rint((depth - SHIFTS[:, None] + LOBE) / STEP).astype(np.intp)
    return np.where((at >= 0) & (at < length), profile[:, np.clip(at, 0, length - 1)], np.log(FLOOR))


def _likelihood(
    profile: Array, uneven: Array, predicted: Array, decorrelation: Array, depth: Array, independent: float
) -> Array:  # fmt: skip
    """Logarithm of the likelihood of each slab, its face at each of `SHIFTS`, (slabs, shifts).

    The logarithm of the measured `profile` (depths,) has Gaussian errors. Those of speckle are ``1 / sqrt(N)`` with N
    `independent` speckles, and their correlation over a depth z, in standard deviations of the cell, is ``exp(-D z^2 /
    4)``, with D the `decorrelation` (slabs,). Where the variance between blocks, `uneven` (depths,), is larger, the
    rest is not speckle, and not correlated. `predicted` is the result of `_predicted`.
    """
    level = profile + FLOOR
    measured, speckle = np.log(level), profile / level
    other = INEXACT**2 + (0.5 * FLOOR / level) ** 2 + np.maximum(uneven / level**2 - speckle**2 / independent, 0.0)
    square = np.subtract.outer(depth, depth) ** 2 / 4.0
    result = np.empty(predicted.shape[:2])
    classes = np.digitize(decorrelation, np.quantile(decorrelation, np.arange(1, COHERENCES) / COHERENCES))
    classes[0] = -1  # a face alone
    for number in np.unique(classes):
        alike = np.flatnonzero(classes == number)
        correlation = np.exp(-decorrelation[alike].mean() * square)
        covariance = np.outer(speckle, speckle) * correlation / independent + np.diag(other)
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        error, one = (measured - predicted[alike]) @ root.T, root.sum(axis=1)
        error -= (error @ one / (one @ one))[..., None] * one  # the brightness of the wall is unknown
        result[alike] = np.log(np.diag(root)).sum() - 0.5 * np.einsum("nsz,nsz->ns", error, error)
    return result
