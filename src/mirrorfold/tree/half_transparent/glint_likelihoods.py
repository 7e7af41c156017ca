"""How likely the spectra of echoes behind a wall are, if they are glints or echoes of rough objects: for many walls.

`mirrorfold.tree.half_transparent.wall_glints` explains the model. A wall is met twice, there and back, so that it
multiplies spectra by R^2 or T^2 (`mirrorfold.common.slabs`). For each echo, wall, and kind, reflected or passed:

- The best glint of all delays and powers of frequency explains the share E of the power of the whole echo, which is the
  projection of its spectra on those of the glint. The misfit is 1 - E.
- The best spectrum that both polarizations share leaves a misfit as in `mirrorfold.tree.half_transparent.panes`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array
from mirrorfold.tree.half_transparent.misfits import REORDERED, over_walls, unparallel, wall_waves
from mirrorfold.tree.half_transparent.panes import Pairs, Spectra, power_of

SCALES = 10.0 ** np.arange(-4.0, -0.4, 0.5)
"""Scales of error that are averaged over: power of the error over that of the echo. They range from 1 % of the
amplitude, which is what the model of plane waves leaves out (`mirrorfold.simulation.rays.slabs`), to no agreement."""

UNLIKE = np.log(10.0) / 20.0 * np.array([0.3, 1.0, 3.0])
"""Standard deviations that are tried, of the level [neper] and phase [rad] of a glint in TE against TM, up to a sign:
small for conductors, larger beside a rough surface."""

LEVELS = np.log(10.0) / 20.0 * 40.0
"""Span of the levels of TM against TE [neper] if nothing is known of them: 40 dB."""

LANES = 8
"""Sums over frequency are padded to a multiple of this number, of which a core adds up as many at once."""

DELAY_STEP, DELAYS = 0.1, 15
"""Step of the delays of a glint against the place of its echo that are tried, in range cells; and their number, later
and as many earlier: the highest point of a ridge is seldom sampled."""

GLINT_NUMBERS = 2.5
"""Free complex numbers in the spectra of a glint: an amplitude in either polarization, and a delay, which is real."""


Tables = tuple[Any, ...]
"""What `likelihoods` needs of the echoes, see `tables`."""


def tables(pairs: Pairs, whole: Spectra, taper: Array, powers: tuple[float, ...]) -> Tables:
    """What does not depend on the wall.

    Parameters
    ----------
    pairs : Pairs
        The echoes behind the wall.
    whole : (2, n, m) complex array
        Spectra of the whole echoes in TE and TM.
    taper : (m,) array
        The window over frequency that these spectra contain.
    powers : tuple of float
        Powers of frequency with which the amplitude of glints may fall.
    """
    k, n = pairs.wavenumber, pairs.independent
    offset = np.pad(k - k.mean(), (0, -k.size % LANES))
    turns = 2.0 * np.outer(DELAY_STEP * pairs.cell * np.arange(DELAYS + 1), offset)
    falls = (k / k.mean()) ** np.array(powers)[:, None]
    # Numbers that a model leaves free, and the constant of each likelihood: that of a random direction.
    left = np.array([2.0 * n - GLINT_NUMBERS, n - 0.5])
    usual = np.log(SCALES.size) - gammaln(2.0 * n - left) + gammaln(2.0 * n)
    return (
        *(k, pairs.angle, whole * taper, power_of(whole).sum(axis=(0, 2)), pairs.products, pairs.power, pairs.noise),
        *(falls, (falls * taper) ** 2, np.cos(turns), np.sin(turns)),
        *(left, usual, SCALES, np.stack([0.5 * LEVELS / UNLIKE.size / UNLIKE**2, 0.5 / UNLIKE**2])),
    )


def likelihoods(
    permittivity: NDArray[np.complex128], thickness: Array, rms_height: Array, of: Tables, kinds: int = 2
) -> Array:
    """Logarithms of the likelihoods of reflected and of passed echoes over those of arbitrary spectra, (kinds, w, n).

    Parameters
    ----------
    permittivity, thickness, rms_height : (w,) arrays
        Of the walls; thickness and rms height of the faces in [m].
    of : tuple of array
        The `tables` of the echoes.
    kinds : int
        One for reflected echoes alone.
    """
    out = np.empty((kinds, thickness.size, of[1].size))  # of[1] are the angles
    over_walls(_likelihoods, thickness.size, permittivity, thickness, rms_height, *of, out)
    return out


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=REORDERED)
def _likelihoods(  # type: ignore[no-untyped-def]
    permittivity, thickness, rms_height, wavenumber, angle, whole, power, ratio, total, noise, falls, law, cosine, sine,
    left, usual, scales, prior, out, start, stop,
):  # fmt: skip
    """`likelihoods` of the walls from `start` to `stop`."""
    wave = np.empty((2, 2, wavenumber.size), np.complex128)  # of both kinds, in both polarizations
    explained = np.empty((falls.shape[0], 2 * cosine.shape[0] - 1))
    sent, both = np.empty((2, *explained.shape), np.complex128), np.zeros((2, cosine.shape[1]))
    for w in range(start, stop):
        for n in range(angle.size):
            wall_waves(permittivity[w], thickness[w], rms_height[w], wavenumber, angle[n], wave)
            for kind in range(out.shape[0]):
                share, unlike = _glint(wave[kind], whole[:, n], falls, law, cosine, sine, both, sent, explained)
                misfit = min(max(1.0 - share / power[n], 0.0), 1.0)
                glint = _averaged(misfit, noise[n], left[0], usual[0], scales) + _prior(unlike, prior)
                misfit = unparallel(wave[kind], ratio[n]) / total[n]
                rough = _averaged(misfit, noise[n], left[1], usual[1], scales)
                out[kind, w, n] = _log_sum(glint, rough) - np.log(2.0)


@njit(nogil=True, error_model="numpy", fastmath=REORDERED)
def _log_sum(a, b):  # type: ignore[no-untyped-def]
    """``log(exp(a) + exp(b))``."""
    return max(a, b) + np.log1p(np.exp(-abs(a - b)))


@njit(nogil=True, error_model="numpy", fastmath=REORDERED)
def _averaged(misfit, noise, left, usual, scales):  # type: ignore[no-untyped-def]
    """Logarithm of the likelihood of a misfit, averaged over the `scales` of its error, less the `usual` one.

    The model leaves so many complex dimensions unexplained as `left` says.
    """
    largest = -1e300
    for scale in scales:
        variance = scale + noise
        largest = max(largest, left * (np.log(left / variance) - misfit / variance))
    total = 0.0
    for scale in scales:
        variance = scale + noise
        total += np.exp(left * (np.log(left / variance) - misfit / variance) - largest)
    return largest + np.log(total) - usual


@njit(nogil=True, error_model="numpy", fastmath=REORDERED)
def _prior(unlike, prior):  # type: ignore[no-untyped-def]
    """Logarithm of the prior of the squared difference of a glint's levels in TE and TM, averaged over `UNLIKE`.

    `prior` (2, spreads) holds the weight of each spread, and the factor of the exponent.
    """
    total = 0.0
    for i in range(prior.shape[1]):
        total += prior[0, i] * np.exp(-prior[1, i] * unlike)
    return np.log(max(total, 1e-300))


@njit(nogil=True, error_model="numpy", fastmath=REORDERED)
def _glint(wave, whole, falls, law, cosine, sine, both, sent, explained):  # type: ignore[no-untyped-def]
    """Power of an echo that the best glint explains; and its squared difference of levels in TE and TM, up to a sign.

    Parameters
    ----------
    wave, whole : (2, m) arrays
        By which the wall multiplies the spectra, and the tapered spectra of the echo.
    falls, law : (powers, m) arrays
        Amplitude of glints against frequency; and its square, with the square of the taper.
    cosine, sine : (delays, m or more) arrays
        Of the phase by which each delay turns the spectra, from none on.
    both : (2, m or more) array
        Room for real and imaginary parts; zero beyond m.
    sent, explained : (2, powers, all delays) and (powers, all delays) arrays
        Filled: the sum of the spectra against those of glints, and the power that each glint explains.
    """
    middle = cosine.shape[0] - 1
    best, best_p, best_d = -1.0, 0, 0
    for p in range(falls.shape[0]):
        for d in range(explained.shape[1]):
            explained[p, d] = 0.0
        for i in range(2):
            power = 0.0
            for m in range(falls.shape[1]):
                passed, back = wave[i, m], whole[i, m] * wave[i, m].conjugate() * falls[p, m]
                power += (passed.real**2 + passed.imag**2) * law[p, m]
                both[0, m], both[1, m] = back.real, back.imag
            for d in range(middle + 1):
                # The sums of cosines and of sines serve the delay and its negative.
                a, b, c, s = 0.0, 0.0, 0.0, 0.0
                for m in range(cosine.shape[1]):
                    a += both[0, m] * cosine[d, m]
                    b += both[1, m] * sine[d, m]
                    c += both[1, m] * cosine[d, m]
                    s += both[0, m] * sine[d, m]
                later, earlier = complex(a - b, c + s) / power, complex(a + b, c - s) / power
                sent[i, p, middle + d], sent[i, p, middle - d] = later, earlier
                explained[p, middle + d] += (later.real**2 + later.imag**2) * power
                if d:
                    explained[p, middle - d] += (earlier.real**2 + earlier.imag**2) * power
        for d in range(explained.shape[1]):
            if explained[p, d] > best:
                best, best_p, best_d = explained[p, d], p, d
    difference = np.log(sent[0, best_p, best_d] / sent[1, best_p, best_d])
    phase = difference.imag - np.pi * np.round(difference.imag / np.pi)
    return _peak(explained), difference.real**2 + phase**2


@njit(nogil=True, error_model="numpy", fastmath=REORDERED)
def _peak(explained):  # type: ignore[no-untyped-def]
    """The maximum of values (powers, delays), interpolated by parabolas between neighbouring delays."""
    best = 0.0
    for p in range(explained.shape[0]):
        at = min(max(np.argmax(explained[p]), 1), explained.shape[1] - 2)
        before, here, after = explained[p, at - 1], explained[p, at], explained[p, at + 1]
        best, bend = max(best, before, here, after), before - 2.0 * here + after
        if bend < 0.0:
            beside = min(max(0.5 * (before - after) / bend, -0.5), 0.5)
            best = max(best, here - 0.25 * (before - after) * beside)
    return best
