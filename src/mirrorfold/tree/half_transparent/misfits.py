"""How badly echoes in two polarizations fit walls: for many walls at once, in one pass over their frequencies.

The formulas are those of `mirrorfold.common.slabs`, for smooth faces. What a slab delays, it delays alike in both
polarizations, so that the way that the wave would go without it does not matter here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import in_shares
from mirrorfold.common.types import Array

REORDERED = {"reassoc", "contract", "arcp", "nsz"}
"""What compiled sums may do: be reordered, so that a core adds up several terms at once. NaN stays NaN."""

LANES = 8
"""Frequencies are padded to a multiple of this number, of which a core computes as many at once."""

WORTH_SHARING = 32
"""Number of walls from which on the cores share them: a core takes some 0.1 ms for so many with a few dozen echoes."""


def padded(te: Array, tm: Array, mixed: NDArray[np.complex128]) -> Array:
    """Powers (n, m) of echoes in both polarizations, and TM times the conjugate of TE, as `misfits` takes them."""
    powers = np.stack([te, tm, mixed.real, mixed.imag], axis=1)
    return np.pad(powers, ((0, 0), (0, 0), (0, -powers.shape[2] % LANES)))


def misfits(
    permittivity: NDArray[np.complex128], thickness: Array, wavenumber: Array, angle: Array, powers: Array
) -> Array:
    """Power of echoes that is not parallel to what walls reflect, and to what passes through them, (2, w, n).

    Parameters
    ----------
    permittivity, thickness : (w,) arrays
        Of the walls; thickness in [m].
    wavenumber : (m,) array [rad/m]
        In equal steps.
    angle : (n,) array [rad]
        Angles of incidence of the echoes.
    powers : (n, 4, ...) array
        Of the echoes, from `padded`.
    """
    step = (wavenumber[-1] - wavenumber[0]) / max(wavenumber.size - 1, 1)
    out = np.empty((2, thickness.size, angle.size))
    work = permittivity, thickness, float(wavenumber[0]), float(step), angle, powers, out
    if thickness.size < WORTH_SHARING:
        _misfits(*work, 0, thickness.size)
    else:
        in_shares(lambda *share: _misfits(*work, *share), thickness.size)
    return out


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=REORDERED)
def _misfits(permittivity, thickness, first, step, angle, powers, out, start, stop):  # type: ignore[no-untyped-def]
    """`misfits` of the walls from `start` to `stop`."""
    count = powers.shape[2]
    way_re, way_im = np.empty(count), np.empty(count)
    r_re, r_im, s_re, s_im = np.empty((4, 2))
    for w in range(start, stop):
        eps, width = permittivity[w], thickness[w]
        for n in range(angle.size):
            cosine = np.cos(angle[n])
            q = np.sqrt(eps - np.sin(angle[n]) ** 2)
            way, turn = np.exp(-1j * width * first * q), np.exp(-1j * width * step * q)
            for m in range(count):
                way_re[m], way_im[m] = way.real, way.imag
                way *= turn
            for i in range(2):
                outside = cosine if i == 0 else eps * cosine
                r = (outside - q) / (outside + q)
                s = 1.0 - r * r
                r_re[i], r_im[i], s_re[i], s_im[i] = r.real, r.imag, s.real, s.imag
            out[0, w, n], out[1, w, n] = _one_wall(way_re, way_im, r_re, r_im, s_re, s_im, powers[n])


@njit(nogil=True, error_model="numpy", fastmath=REORDERED)
def _one_wall(way_re, way_im, r_re, r_im, s_re, s_im, power):  # type: ignore[no-untyped-def]
    """The two misfits of one echo, for the waves once through a wall, (m,), and its coefficients, (2,), TE and TM.

    The coefficients are r, the reflection of a face, and ``s = 1 - r^2``, the transmission of both faces.
    """
    left, passed = 0.0, 0.0
    left_re, left_im, passed_re, passed_im = 0.0, 0.0, 0.0, 0.0
    a_re, a_im, b_re, b_im = r_re[0], r_im[0], r_re[1], r_im[1]
    c_re, c_im, d_re, d_im = s_re[0], s_im[0], s_re[1], s_im[1]
    for m in range(way_re.size):
        p_re, p_im = way_re[m], way_im[m]
        # TE: `t` is what passes, `u` what is reflected.
        o_re, o_im = a_re * p_re - a_im * p_im, a_re * p_im + a_im * p_re
        n_re, n_im = 1.0 - o_re * o_re + o_im * o_im, -2.0 * o_re * o_im
        f_re, f_im = c_re * p_re - c_im * p_im, c_re * p_im + c_im * p_re
        scale = 1.0 / (n_re * n_re + n_im * n_im)
        t_re, t_im = (f_re * n_re + f_im * n_im) * scale, (f_im * n_re - f_re * n_im) * scale
        u_re, u_im = a_re - t_re * o_re + t_im * o_im, a_im - t_re * o_im - t_im * o_re
        # TM: `v` is what passes, `x` what is reflected.
        o_re, o_im = b_re * p_re - b_im * p_im, b_re * p_im + b_im * p_re
        n_re, n_im = 1.0 - o_re * o_re + o_im * o_im, -2.0 * o_re * o_im
        f_re, f_im = d_re * p_re - d_im * p_im, d_re * p_im + d_im * p_re
        scale = 1.0 / (n_re * n_re + n_im * n_im)
        v_re, v_im = (f_re * n_re + f_im * n_im) * scale, (f_im * n_re - f_re * n_im) * scale
        x_re, x_im = b_re - v_re * o_re + v_im * o_im, b_im - v_re * o_im - v_im * o_re
        te, tm, mixed_re, mixed_im = power[0, m], power[1, m], power[2, m], power[3, m]
        # The wall is met twice, there and back: powers are squared, and so is TE times the conjugate of TM.
        u, x = (u_re * u_re + u_im * u_im) ** 2, (x_re * x_re + x_im * x_im) ** 2
        e_re, e_im = u_re * x_re + u_im * x_im, u_im * x_re - u_re * x_im
        scale = 1.0 / max(u + x, 1e-300)
        left += (x * te + u * tm) * scale
        e_re, e_im = (e_re * e_re - e_im * e_im) * scale, 2.0 * e_re * e_im * scale
        left_re += e_re * mixed_re - e_im * mixed_im
        left_im += e_re * mixed_im + e_im * mixed_re
        t, v = (t_re * t_re + t_im * t_im) ** 2, (v_re * v_re + v_im * v_im) ** 2
        e_re, e_im = t_re * v_re + t_im * v_im, t_im * v_re - t_re * v_im
        scale = 1.0 / max(t + v, 1e-300)
        passed += (v * te + t * tm) * scale
        e_re, e_im = (e_re * e_re - e_im * e_im) * scale, 2.0 * e_re * e_im * scale
        passed_re += e_re * mixed_re - e_im * mixed_im
        passed_im += e_re * mixed_im + e_im * mixed_re
    return left - 2.0 * np.hypot(left_re, left_im), passed - 2.0 * np.hypot(passed_re, passed_im)
