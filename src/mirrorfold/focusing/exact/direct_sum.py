"""The focusing sum in float64, term by term: slow, obviously right, the reference for all other algorithms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import for_each
from mirrorfold.focusing.problem import Problem


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=True)
def sum_frequency(data, tx_re, tx_im, rx_re, rx_im, out):  # type: ignore[no-untyped-def]
    """out[p] = sum_i tx[p, i] sum_k data[i, k] rx[p, k] in float64."""
    transmitters, receivers = data.shape
    row_re, row_im = np.empty(receivers), np.empty(receivers)
    out[:] = 0.0
    for i in range(transmitters):
        for k in range(receivers):
            row_re[k], row_im[k] = data[i, k].real, data[i, k].imag
        for p in range(out.size):
            re, im = 0.0, 0.0
            for k in range(receivers):
                re += row_re[k] * rx_re[p, k] - row_im[k] * rx_im[p, k]
                im += row_re[k] * rx_im[p, k] + row_im[k] * rx_re[p, k]
            out[p] += complex(re * tx_re[p, i] - im * tx_im[p, i], re * tx_im[p, i] + im * tx_re[p, i])


@njit(nogil=True, error_model="numpy")
def sum_positions(data, weight, taper, k, path):  # type: ignore[no-untyped-def]
    """sum_m taper[m] sum_i data[m, i] weight[i] exp(j k[m] path[i]) in float64."""
    total = 0.0 + 0.0j
    for m in range(k.size):
        at_frequency = 0.0 + 0.0j
        for i in range(path.size):
            at_frequency += data[m, i] * weight[i] * np.exp(1j * k[m] * path[i])
        total += taper[m] * at_frequency
    return total


def direct_sum(problem: Problem, s: NDArray[np.complexfloating], points: NDArray[np.float64]) -> NDArray[np.complex128]:
    """The focusing sum in float64, term by term, at points (n, 3) [m]: the reference for all other algorithms."""
    tx_range = np.linalg.norm(points[:, None, :] - problem.tx[None, :, :], axis=-1)
    rx_range = np.linalg.norm(points[:, None, :] - problem.rx[None, :, :], axis=-1)
    if problem.monostatic:
        total = np.empty(len(points), dtype=np.complex128)
        weight = (problem.tx_weight * problem.rx_weight).astype(np.complex128)
        taper, path = problem.taper.astype(np.complex128), tx_range + rx_range

        def one_point(p: int) -> None:
            total[p] = sum_positions(s, weight, taper, problem.k, path[p])

        for_each(one_point, range(len(points)))
        return total
    terms = np.zeros((problem.k.size, len(points)), dtype=np.complex128)

    def one_frequency(m: int) -> None:
        tx = np.exp(1j * problem.k[m] * tx_range)
        rx = (tx if problem.coincident else np.exp(1j * problem.k[m] * rx_range)) * problem.rx_weight
        tx = tx * problem.tx_weight
        tx_re, tx_im = np.ascontiguousarray(tx.real), np.ascontiguousarray(tx.imag)
        rx_re, rx_im = np.ascontiguousarray(rx.real), np.ascontiguousarray(rx.imag)
        sum_frequency(s[m], tx_re, tx_im, rx_re, rx_im, terms[m])

    for_each(one_frequency, range(problem.k.size))
    return problem.taper @ terms
