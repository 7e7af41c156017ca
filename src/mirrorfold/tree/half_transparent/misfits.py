"""How badly echoes in two polarizations fit walls, for many walls at once.

A wall is met twice, there and back: it multiplies spectra by R^2 or T^2, see `mirrorfold.common.slabs`. An object is
taken to return both polarizations alike, up to a phase. So at each frequency the pair (TE, TM) of an echo should be
parallel to that of R^2 or of T^2, up to a phase that is the same at all frequencies.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import in_shares
from mirrorfold.common.types import Array

REORDERED = {"reassoc", "contract", "arcp", "nsz"}
"""What compiled sums may do: be reordered, so that a core adds up several terms at once. NaN stays NaN."""

WORTH_SHARING = 32
"""Number of walls from which on the cores share them: one core takes some 0.1 ms for so many."""


def misfits(
    permittivity: NDArray[np.complex128],
    thickness: Array,
    wavenumber: Array,
    angle: Array,
    ratio: NDArray[np.complex128],
) -> Array:
    """Power of echoes that is not parallel to what walls reflect, and to what passes through them, (2, w, n).

    The walls have a permittivity and a thickness [m], (w,) each. The echoes have an `angle` of incidence [rad], (n,),
    and as `ratio` (n, 3, m), at each `wavenumber` (m,) [rad/m], the powers of TE and of TM, and TM times the conjugate
    of TE. Wavenumbers are in equal steps.
    """
    out = np.empty((2, thickness.size, angle.size))
    over_walls(_misfits, thickness.size, permittivity, thickness, wavenumber, angle, ratio, out)
    return out


def over_walls(kernel: Any, count: int, *work: Any) -> None:
    """Call ``kernel(*work, start, stop)`` for all walls, on all cores if there are enough of them."""
    if count < WORTH_SHARING:
        kernel(*work, 0, count)
    else:
        in_shares(kernel, count, *work)


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=REORDERED)
def _misfits(permittivity, thickness, wavenumber, angle, ratio, out, start, stop):  # type: ignore[no-untyped-def]
    """`misfits` of the walls from `start` to `stop`."""
    wave = np.empty((2, 2, wavenumber.size), np.complex128)
    for w in range(start, stop):
        for n in range(angle.size):
            wall_waves(permittivity[w], thickness[w], 0.0, wavenumber, angle[n], wave)
            for kind in range(2):
                out[kind, w, n] = unparallel(wave[kind], ratio[n])


@njit(nogil=True, error_model="numpy", fastmath=REORDERED)
def wall_waves(eps, thickness, rms_height, wavenumber, angle, wave):  # type: ignore[no-untyped-def]
    """R^2 and T^2 of a wall in TE and TM, into wave (2, 2, m), at `wavenumber` (m,) [rad/m] in equal steps."""
    cosine, first = np.cos(angle), wavenumber[0]
    step = (wavenumber[-1] - first) / max(wavenumber.size - 1, 1)
    q = np.sqrt(eps - np.sin(angle) ** 2)
    for i in range(2):
        outside = cosine if i == 0 else eps * cosine
        r = (outside - q) / (outside + q)
        s = 1.0 - r * r
        way, turn = np.exp(-1j * thickness * first * q), np.exp(-1j * thickness * step * q)
        straight, turn_back = np.exp(1j * thickness * first * cosine), np.exp(1j * thickness * step * cosine)
        for m in range(wavenumber.size):
            front, within, entry = 1.0, 1.0, 1.0
            if rms_height > 0.0:
                height = (wavenumber[m] * rms_height) ** 2
                front, within = np.exp(-2.0 * height * cosine**2), np.exp(-2.0 * height * q.real**2)
                entry = np.exp(-height * (q.real - cosine) ** 2)
            once = r * way * within
            to_and_fro = 1.0 - once * once
            passed = s * way * to_and_fro.conjugate() * (entry / (to_and_fro.real**2 + to_and_fro.imag**2))
            reflected = r * front - passed * once
            passed *= straight
            wave[0, i, m], wave[1, i, m] = reflected * reflected, passed * passed
            way, straight = way * turn, straight * turn_back


@njit(nogil=True, error_model="numpy", fastmath=REORDERED)
def unparallel(wave, ratio):  # type: ignore[no-untyped-def]
    """Power of an echo, its `ratio` (3, m) as in `misfits`, that is not parallel to the wave (2, m) of a wall."""
    left, along = 0.0, 0.0j
    for m in range(wave.shape[1]):
        te, tm = wave[0, m], wave[1, m]
        power_te, power_tm = te.real**2 + te.imag**2, tm.real**2 + tm.imag**2
        scale = 1.0 / max(power_te + power_tm, 1e-300)
        left += (power_tm * ratio[0, m].real + power_te * ratio[1, m].real) * scale
        along += te * tm.conjugate() * ratio[2, m] * scale
    return left - 2.0 * abs(along)
