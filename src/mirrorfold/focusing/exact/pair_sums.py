"""Samples from reflecting points, and the focusing sum, for any array: matrix products with tables of phases.

With the phase factors ``E_i(p) = exp(j k_m R_i(p))`` and the reflectivities x of the points, samples and image at one
frequency are products of matrices::

    S_m = conj(E_tx) diag(x) conj(E_rx)^T,        I_m(p) = sum_i E_i(p) (S_m E_rx)_i(p).

Both take 8 x pairs x pixels floating-point operations per frequency. The tables E, made anew for every block of pixels,
take some 30 x (tx + rx) x pixels, which is less from about a dozen elements on. The two directions are adjoint to each
other to rounding, since they use the same tables.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.kernels import njit
from mirrorfold.common.phasor import unit_phasor
from mirrorfold.common.threads import cpu_count, for_each, one_thread
from mirrorfold.common.types import Array
from mirrorfold.focusing.problem import Problem

PIXELS_A_BLOCK = 1024
"""Pixels of a block: the tables of a hundred antennas on them stay in the second-level cache."""


@njit(nogil=True, error_model="numpy", fastmath=True)
def fill_phases(path, turns_per_metre, out):  # type: ignore[no-untyped-def]
    """out[i, p] = exp(2 pi j turns_per_metre path[i, p])."""
    for i in range(path.shape[0]):
        for p in range(path.shape[1]):
            re, im = unit_phasor(path[i, p] * turns_per_metre)
            out[i, p] = complex(re, im)


class PairSums:
    """Sums over all pairs, from reflectivities of points to samples and from samples to the image at the points.

    Parameters
    ----------
    problem : Problem
        Antennas, wavenumbers, weights and taper; its pixels are not used.
    points : (n, 3) array [m]
    """

    def __init__(self, problem: Problem, points: Array) -> None:
        self.problem, self.points = problem, points
        self._starts = list(range(0, len(points), PIXELS_A_BLOCK))
        weight = (problem.taper, problem.tx_weight, problem.rx_weight)
        self._taper, self._tx_weight, self._rx_weight = (each.astype(np.complex64) for each in weight)
        frequencies = np.arange(problem.k.size)
        self._shares = [share for share in np.array_split(frequencies, 4 * cpu_count()) if share.size]

    def focus(self, s: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Image (n,) at the points, of samples (frequencies, tx, rx) or, monostatic, (frequencies, tx)."""
        problem = self.problem
        images = np.zeros((len(self._shares), len(self.points)), dtype=np.complex64)

        def sum_share(number: int) -> None:
            for part, tables in self._blocks():
                for m in self._shares[number]:
                    tx, rx = tables(m)
                    if problem.monostatic:
                        summed = (s[m] * (self._tx_weight * self._rx_weight)) @ tx
                    else:
                        weighed = s[m] * (self._tx_weight[:, None] * self._rx_weight)
                        summed = np.einsum("ip,ip->p", tx, weighed @ rx)
                    images[number, part] += self._taper[m] * summed

        with one_thread():
            for_each(sum_share, range(len(self._shares)))
        return np.asarray(images.sum(axis=0))

    def samples(self, image: NDArray[np.complex64], s: NDArray[np.complex64]) -> None:
        """The adjoint: add to `s` (frequencies, ...) the samples of reflectivities (n,), with conjugate weights."""
        problem = self.problem

        def sum_share(number: int) -> None:
            for part, tables in self._blocks():
                x = image[part]
                if not x.any():
                    continue
                for m in self._shares[number]:
                    tx, rx = tables(m)
                    taper = self._taper[m].conj()
                    if problem.monostatic:
                        summed = (x.conj() @ tx.T).conj()
                        s[m] += taper * (self._tx_weight * self._rx_weight).conj() * summed
                    else:
                        summed = ((tx * x.conj()) @ rx.T).conj()
                        s[m] += taper * (self._tx_weight[:, None] * self._rx_weight).conj() * summed

        with one_thread():
            for_each(sum_share, range(len(self._shares)))

    def _blocks(self):  # type: ignore[no-untyped-def]
        """Blocks of points, each with a function from a frequency's index to its tables E, (tx, n) and (rx, n)."""
        problem = self.problem
        for start in self._starts:
            part = slice(start, min(start + PIXELS_A_BLOCK, len(self.points)))
            points = self.points[part]
            # An antenna that receives only its own echoes has the path out and back.
            ways = 2.0 if problem.monostatic else 1.0
            path = ways * np.linalg.norm(problem.tx[:, None] - points, axis=-1)
            shared = problem.monostatic or problem.coincident
            other = path if shared else np.linalg.norm(problem.rx[:, None] - points, axis=-1)
            tx = np.empty(path.shape, dtype=np.complex64)
            rx = tx if shared else np.empty(other.shape, dtype=np.complex64)

            def tables(  # type: ignore[no-untyped-def]
                m, path=path, other=other, tx=tx, rx=rx, shared=shared
            ) -> tuple[NDArray[np.complex64], NDArray[np.complex64]]:
                turns = float(problem.k[m]) / (2.0 * np.pi)
                fill_phases(path, turns, tx)
                if not shared:
                    fill_phases(other, turns, rx)
                return tx, rx

            yield part, tables
