"""How likely the spectra of echoes behind a wall are: for many walls, echoes that they reflect, and that pass.

`mirrorfold.tree.half_transparent.wall_glints` explains the model. A wall is met twice, there and back, so that it
multiplies spectra by R^2 or T^2 (`mirrorfold.common.slabs`), called W here. For each echo, wall, and kind, reflected or
passed, two misfits count:

- *The ratio.* If the wall is right, ``W_TM s_TE`` and ``W_TE s_TM`` are equal up to one factor, for the spectra s of a
  long piece around the echo. Both are cut out at the echo, and compared. The factor, which is the object's, should be
  near plus or minus one.
- *The glint.* ``conj(W_TE) s_TE + conj(W_TM) s_TM`` is the part of the spectra that is along the wall's. The best glint
  of all delays and powers of frequency explains a share of its power; the misfit is the rest. Or the object is rough,
  and its spectrum may be any.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from mirrorfold.common.decibels import NEPER
from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array
from mirrorfold.tree.half_transparent.misfits import REORDERED, over_walls, wall_waves
from mirrorfold.tree.half_transparent.panes import Pairs, Spectra, power_of

SCALES = 10.0 ** np.arange(-6.0, -0.4, 0.5)
"""Scales of error that are averaged over: power of the error over that of the echo, from 0.1 % of the amplitude, which
the ratio of clear glints reaches in rays, to no agreement."""

UNLIKE = NEPER * np.array([0.03, 0.1, 0.3, 1.0, 3.0])
"""Standard deviations that are tried, of the level [neper] and phase [rad] of an object in TE against TM, up to a sign:
small for conductors, larger for rough and for dielectric objects."""

LEVELS = NEPER * 40.0
"""Span of the levels of TM against TE [neper] if nothing is known of them: 40 dB."""

LANES = 8
"""Sums over frequency are padded to a multiple of this number, of which a core adds up as many at once."""

DELAY_STEP, DELAYS = 0.1, 15
"""Step of the delays of a glint against the place of its echo that are tried, in range cells; and their number, later
and as many earlier: the highest point of a ridge is seldom sampled."""

GATE, GATE_SHARE = 0.5 * np.arange(-3.0, 4.0), 2.0 / 3.0
"""Places, in range cells from the echo, at which both polarizations are compared under a Hann window of two cells half
length; and this length over that of the window of `Pairs`, with which the number of independent values falls."""

GLINT_NUMBERS, RATIO_NUMBERS = 1.5, 1.0
"""Free complex numbers in the spectrum of a glint: an amplitude, and a delay, which is real; and in the ratio of two
polarizations."""


Tables = tuple[Any, ...]
"""What `likelihoods` needs of the echoes, see `tables`."""


def tables(pairs: Pairs, whole: Spectra, long: Spectra, taper: Array, powers: tuple[float, ...]) -> Tables:
    """What does not depend on the wall.

    `whole` and `long` (2, n, m) are the spectra of whole echoes in TE and TM, and of long pieces around them, which
    contain the window over frequency `taper` (m,). The amplitude of glints may fall with any of the `powers` of
    frequency.
    """
    k = pairs.wavenumber
    offset = np.pad(k - k.mean(), (0, -k.size % LANES))
    turns = 2.0 * np.outer(DELAY_STEP * pairs.cell * np.arange(DELAYS + 1), offset)
    falls = (k / k.mean()) ** np.array(powers)[:, None] * taper
    turned, gate = np.exp(2j * np.outer(GATE * pairs.cell, k - k.mean())), np.cos(0.25 * np.pi * GATE) ** 4
    power = np.einsum("j,pnj->n", gate, power_of(long @ turned.T))
    # Independent complex numbers of each part; how many a model leaves free; and the constant of each likelihood: that
    # of a random direction.
    every = pairs.independent * np.array([1.0, 2.0 * GATE_SHARE])
    left = every - [GLINT_NUMBERS, 0.5 * every[1] + RATIO_NUMBERS]
    usual = np.log(SCALES.size) - gammaln(every - left) + gammaln(every)
    return (
        *(k, pairs.angle, whole, long, power, pairs.noise, turned, gate, taper**2 / np.sum(taper**2)),
        *(falls, falls**2, np.cos(turns), np.sin(turns)),
        *(left, usual, SCALES, np.stack([0.5 * LEVELS / UNLIKE.size / UNLIKE**2, 0.5 / UNLIKE**2])),
    )


def likelihoods(
    permittivity: NDArray[np.complex128], thickness: Array, rms_height: Array, of: Tables, kinds: int = 2
) -> Array:
    """Logarithms of the likelihoods of reflected and of passed echoes over those of arbitrary spectra, (kinds, w, n).

    The walls have a permittivity, a thickness [m] and an rms height of the faces [m], (w,) each; `of` are the `tables`
    of the echoes. With one of the two `kinds`, of reflected echoes alone.
    """
    out = np.empty((kinds, thickness.size, of[1].size))  # of[1] are the angles
    over_walls(_likelihoods, thickness.size, permittivity, thickness, rms_height, *of, out)
    return out


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=REORDERED)
def _likelihoods(  # type: ignore[no-untyped-def]
    permittivity, thickness, rms_height, wavenumber, angle, whole, long, power, noise, turned, gate, weight, falls, law,
    cosine, sine, left, usual, scales, prior, out, start, stop,
):  # fmt: skip
    """`likelihoods` of the walls from `start` to `stop`."""
    wave = np.empty((2, 2, wavenumber.size), np.complex128)  # of both kinds, in both polarizations
    sides, both = np.empty((2, wavenumber.size), np.complex128), np.zeros((2, cosine.shape[1]))
    explained = np.empty((falls.shape[0], 2 * cosine.shape[0] - 1))
    for w in range(start, stop):
        for n in range(angle.size):
            wall_waves(permittivity[w], thickness[w], rms_height[w], wavenumber, angle[n], wave)
            delay = thickness[w] * (np.sqrt(permittivity[w] - np.sin(angle[n]) ** 2).real - np.cos(angle[n]))
            for kind in range(out.shape[0]):
                misfit, factor = _ratio(wave[kind], long[:, n], wavenumber, kind * delay, turned, gate, weight, sides)
                ratio = _averaged(misfit / power[n], noise[n], left[1], usual[1], scales) + _prior(factor, prior)
                misfit = _glint(wave[kind], whole[:, n], factor, falls, law, cosine, sine, both, explained)
                glint = _averaged(misfit, noise[n], left[0], usual[0], scales)
                out[kind, w, n] = ratio + _log_sum(glint, 0.0) - np.log(2.0)


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
def _prior(factor, prior):  # type: ignore[no-untyped-def]
    """Logarithm of the prior of the `factor` of TM against TE of an object, averaged over `UNLIKE`.

    `prior` (2, spreads) holds the weight of each spread, and the factor of the exponent.
    """
    phase = np.angle(factor)
    phase -= np.pi * np.round(phase / np.pi)
    unlike, total = np.log(max(abs(factor), 1e-300)) ** 2 + phase**2, 0.0
    for i in range(prior.shape[1]):
        total += prior[0, i] * np.exp(-prior[1, i] * unlike)
    return np.log(max(total, 1e-300))


@njit(nogil=True, error_model="numpy", fastmath=REORDERED)
def _ratio(wave, long, wavenumber, delay, turned, gate, weight, sides):  # type: ignore[no-untyped-def]
    """Power of an echo in which TE and TM disagree about the wave (2, m) of a wall; and the factor of TM against TE.

    Parameters
    ----------
    wave, long : (2, m) arrays
        By which the wall multiplies the spectra, and the spectra of a long piece around the echo.
    wavenumber, weight : (m,) arrays
        In [rad/m]; and the power of the taper.
    delay : float [m]
        By which the wall is late: twice, once by either polarization.
    turned, gate : (places, m) and (places,) arrays
        From spectra to places around the echo, and the window there.
    sides : (2, m) array
        Room for both sides of the equation.
    """
    middle, norm = wavenumber[wavenumber.size // 2], 0.0
    for m in range(wavenumber.size):
        te, tm = wave[0, m], wave[1, m]
        norm += weight[m] * (te.real**2 + te.imag**2 + tm.real**2 + tm.imag**2)
        nearer = np.exp(2j * (wavenumber[m] - middle) * delay)
        sides[0, m], sides[1, m] = long[0, m] * tm * nearer, long[1, m] * te * nearer
    power_te, power_tm, along = 0.0, 0.0, 0.0j
    for j in range(gate.size):
        a, b = 0.0j, 0.0j
        for m in range(wavenumber.size):
            a += sides[0, m] * turned[j, m]
            b += sides[1, m] * turned[j, m]
        power_te += gate[j] * (a.real**2 + a.imag**2)
        power_tm += gate[j] * (b.real**2 + b.imag**2)
        along += gate[j] * a.conjugate() * b
    power = max(power_te + power_tm, 1e-300)
    apart = 2.0 * max(power_te * power_tm - along.real**2 - along.imag**2, 0.0) / power
    size = np.sqrt(power_tm / max(power_te, 1e-300))
    return apart / max(norm, 1e-300), size * np.exp(1j * np.angle(along))


@njit(nogil=True, error_model="numpy", fastmath=REORDERED)
def _glint(wave, whole, factor, falls, law, cosine, sine, both, explained):  # type: ignore[no-untyped-def]
    """Share of the power of an echo, as far as it is along the wave (2, m) of a wall, that the best glint leaves.

    Parameters
    ----------
    wave, whole : (2, m) arrays
        By which the wall multiplies the spectra, and the spectra of the echo.
    factor : complex
        TM against TE of the object.
    falls, law : (powers, m) arrays
        Amplitude of glints against frequency, with the taper; and its square.
    cosine, sine : (delays, m or more) arrays
        Of the phase by which each delay turns the spectra, from none on.
    both : (2, m or more) array
        Room for real and imaginary parts; zero beyond m.
    explained : (powers, all delays) array
        Filled: the power that each glint explains.
    """
    middle, total = cosine.shape[0] - 1, 0.0
    for p in range(falls.shape[0]):
        power = 0.0
        for m in range(falls.shape[1]):
            te, tm = wave[0, m], factor * wave[1, m]
            strength = te.real**2 + te.imag**2 + tm.real**2 + tm.imag**2
            along = te.conjugate() * whole[0, m] + tm.conjugate() * whole[1, m]
            if p == 0:
                total += (along.real**2 + along.imag**2) / max(strength, 1e-300)
            power += strength * law[p, m]
            both[0, m], both[1, m] = along.real * falls[p, m], along.imag * falls[p, m]
        for d in range(middle + 1):
            # The sums of cosines and of sines serve the delay and its negative.
            a, b, c, s = 0.0, 0.0, 0.0, 0.0
            for m in range(cosine.shape[1]):
                a += both[0, m] * cosine[d, m]
                b += both[1, m] * sine[d, m]
                c += both[1, m] * cosine[d, m]
                s += both[0, m] * sine[d, m]
            explained[p, middle + d] = ((a - b) ** 2 + (c + s) ** 2) / power
            explained[p, middle - d] = ((a + b) ** 2 + (c - s) ** 2) / power
    return min(max(1.0 - _peak(explained) / total, 0.0), 1.0)


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
