"""`FocusPlan`: what focusing prepares for one geometry, to image frame after frame."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mirrorfold.common.settings import takes
from mirrorfold.common.types import Progress
from mirrorfold.focusing.checks import make_problem, samples_of_frame
from mirrorfold.focusing.choosing.caching import PlanCache, plan_cache
from mirrorfold.focusing.choosing.choice import EXACT_SHARE
from mirrorfold.focusing.choosing.proven import prove
from mirrorfold.focusing.exact.accuracy import exact_kernel_error, white_noise
from mirrorfold.focusing.exact.exact_sum import focus_exact
from mirrorfold.focusing.labels import Labels
from mirrorfold.focusing.settings import FocusSettings

FRAMES = 20
"""Number of frames that a plan is assumed to image: building it may take the time that it saves on this many."""


@takes(FocusSettings, without=("normalization", "memory_limit"))
class FocusPlan:
    """Prepared focusing of one geometry: all that does not depend on the samples is computed once, for many frames.

    Parameters
    ----------
    sweep : xarray.Dataset
        A sweep, or only its geometry: ``frequency`` [Hz] and ``tx_position``, ``rx_position`` [m] (or
        ``antenna_position`` for one moving antenna).
    **given
    plans : PlanCache, optional
        As in `focus`.

    Attributes
    ----------
    x, y, z : 1D arrays [m]
        The pixels.
    tolerance : float
    algorithm : str
        ``"polar"`` for the fast algorithm of line arrays, by way of a polar grid; ``"factorized"`` for factorised
        back-projection, for arrays of any shape; ``"exact"`` for the sum over all pairs.
    error : float
        Relative L2 error of the image of white noise, measured against the float64 sum on random pixels.
    build_time : float [s]
    nbytes : int
        Memory of the plan's tables [bytes].

    Raises
    ------
    InputError
        As `focus`.

    Notes
    -----
    A plan may be used from several threads at once.
    """

    def __init__(self, sweep: xr.Dataset, *, plans: PlanCache | None = None, **given: Any) -> None:
        start = time.perf_counter()
        settings = FocusSettings().with_given(**given)
        sweep, self._problem = make_problem(sweep, settings)
        self.tolerance = float(settings.tolerance)
        self._scaled = self._problem.in_wavelengths
        noise = white_noise(self._scaled)
        proven = prove(self._scaled, self.tolerance, noise, plan_cache if plans is None else plans, FRAMES)
        self._fast = None if proven is None else proven.plan
        exact_tolerance = EXACT_SHARE * self.tolerance
        self.error = exact_kernel_error(self._scaled, noise, exact_tolerance) if proven is None else proven.error
        self._labels = Labels(sweep, self._problem, settings)
        self.x, self.y, self.z = self._problem.x, self._problem.y, self._problem.z
        self.build_time = time.perf_counter() - start

    @property
    def algorithm(self) -> str:
        """``"polar"``, ``"factorized"`` or ``"exact"``."""
        return "exact" if self._fast is None else self._fast.algorithm

    @property
    def nbytes(self) -> int:
        """Memory of the plan's tables [bytes]."""
        return 0 if self._fast is None else self._fast.nbytes

    def __repr__(self) -> str:
        shape = " x ".join(str(n) for n in self._problem.shape)
        return (
            f"FocusPlan({self._problem.pairs} pairs, {self._problem.k.size} frequencies -> {shape} pixels "
            f"(z, y, x), {self.algorithm}, error {self.error:.1e}, {self.nbytes / 2**20:.0f} MiB, "
            f"built in {self.build_time:.2f} s)"
        )

    def __call__(self, s: ArrayLike | xr.DataArray | xr.Dataset, progress: Progress | None = None) -> xr.DataArray:
        """Image one frame.

        Parameters
        ----------
        s : (frequency, tx, rx) or, of one moving antenna, (frequency, position) array, or the sweep of a frame
            Frequencies that an xarray carries along, and the positions of a sweep, are compared with those of the plan.
        progress : callable (done, total), optional

        Returns
        -------
        xarray.DataArray
            The image as `focus` returns it, (y, x) or (z, y, x), to be folded or plotted. Its attr `error` is that
            of the plan, measured on white noise.

        Raises
        ------
        InputError
            If the frame's shape, frequencies or positions are not those of the plan's geometry, or its samples are no
            finite complex numbers.
        """
        values = self.values(s, progress).reshape(self._problem.shape)
        return self._labels.image(values, {"algorithm": self.algorithm, "error": self.error})

    def values(
        self, s: ArrayLike | xr.DataArray | xr.Dataset, progress: Progress | None = None
    ) -> NDArray[np.complex64]:
        """Image one frame without labels, (z, y, x), or (y, x) where there is one z: for real time.

        Parameters
        ----------
        s : array
            As for calling the plan.
        progress : callable (done, total), optional

        Raises
        ------
        InputError
            As for calling the plan.
        """
        data = samples_of_frame(s, self._problem, self._labels.attrs["wave_speed"])
        if self._fast is None:
            image = focus_exact(self._scaled, data, EXACT_SHARE * self.tolerance, progress)
        else:
            image = self._fast(data, progress)
        return image[0] if self._problem.z.size == 1 else image
