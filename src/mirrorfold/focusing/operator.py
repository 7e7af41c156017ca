"""`FocusOperator`: the samples that reflecting pixels make, and focusing as the adjoint, for inverse problems."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import LinearOperator

from mirrorfold.common.arguments import wrong_kind
from mirrorfold.common.settings import takes
from mirrorfold.common.types import Mask
from mirrorfold.errors import InputError
from mirrorfold.focusing.checks import make_problem, samples_of_frame
from mirrorfold.focusing.choosing.proven import REFINEMENTS, SAMPLING_MARGIN
from mirrorfold.focusing.exact.accuracy import measured_error, white_noise
from mirrorfold.focusing.exact.pair_sums import PairSums
from mirrorfold.focusing.fast.line_array import LineArrayPlan, lay_out
from mirrorfold.focusing.labels import Labels
from mirrorfold.focusing.lines.transpose import sector_samples
from mirrorfold.focusing.predicting.cost import pair_sums_cost
from mirrorfold.focusing.problem import Problem, UnsuitedError
from mirrorfold.focusing.settings import FocusSettings

APPLICATIONS = 200
"""Number of times that an operator is assumed to be applied: its tables may take the time that they save on so many."""


@takes(FocusSettings, without=("normalization", "memory_limit", "taper", "apodization"))
class FocusOperator(LinearOperator):  # type: ignore[misc]  # SciPy has no types
    """The linear model of a measurement, from the reflectivities of the pixels to the samples, and its adjoint.

    Forward, for the chosen channels (m, i, k) of frequency, transmitter and receiver::

        s[m, i, k] = sum_p x[p] exp(-j k_m (R_i(p) + R_k(p))),

    with the distances R of pixel p from the antennas; for one moving antenna the path is ``2 R_i(p)``. The adjoint is
    the focusing sum ``I[p] = sum_m,i,k s[m, i, k] exp(+j k_m (R_i(p) + R_k(p)))`` of `focus` with all weights one: the
    matched filter, or delay and sum. The loss of amplitude by spreading of the waves counts as part of the
    reflectivity, as in the images of `focus`.

    This class is a `scipy.sparse.linalg.LinearOperator`: the solvers of SciPy take it, and those of PyLops through
    ``pylops.aslinearoperator``. Several frames at once are the columns of a matrix.

    Parameters
    ----------
    sweep : xarray.Dataset
        A sweep, or only its geometry: ``frequency`` [Hz] and ``tx_position``, ``rx_position`` [m] (or
        ``antenna_position`` for one moving antenna).
    channels : bool array, optional
        True where a channel is measured, of shape (frequency, tx, rx) or (frequency, position), or a shape that can
        be broadcast to it. By default the sweep's variable ``measured``; without it, all channels.
    **given

    Attributes
    ----------
    shape : (int, int)
        Samples, pixels.
    channels : bool array
    algorithm : str
        ``"polar"`` for the fast algorithm of line arrays and its transpose, ``"exact"`` for the sums over all pairs.
    error : float
        Relative L2 error of the image of white noise, measured against the float64 sum; at most `tolerance`. The
        forward direction uses the transposed tables, so that the two directions are adjoint to each other to the
        rounding of single precision, some 1e-7, whatever the error.

    Raises
    ------
    InputError
        As `focus`; if the channels do not fit to the sweep, or there are none.

    See Also
    --------
    focus : The adjoint with weights over frequency and elements.

    Examples
    --------
    >>> import numpy as np
    >>> import mirrorfold as mf
    >>> elements = np.column_stack([np.linspace(-0.02, 0.02, 9), np.zeros(9), np.zeros(9)])
    >>> samples, frequency = np.ones((5, 9, 9), dtype=complex), np.linspace(78e9, 79e9, 5)
    >>> sweep = mf.make_sweep(samples, frequency=frequency, tx_position=elements, rx_position=elements)
    >>> operator = mf.FocusOperator(sweep, x=np.linspace(-0.1, 0.1, 21), y=np.linspace(0.3, 0.5, 11))
    >>> operator.shape
    (405, 231)
    """

    def __init__(
        self,
        sweep: xr.Dataset,
        *,
        channels: ArrayLike | None = None,
        **given: Any,
    ) -> None:
        settings = FocusSettings(taper="uniform").with_given(**given)
        sweep, self._problem = make_problem(sweep, settings)
        self.channels = _channels(sweep, self._problem, channels)
        self._labels = Labels(sweep, self._problem, settings)
        scaled = self._problem.in_wavelengths
        self._implementation, self.error = _proven(scaled, float(settings.tolerance))
        self.algorithm = self._implementation.algorithm
        super().__init__(np.complex64, (int(self.channels.sum()), self._problem.pixels))

    def samples(self, sweep: xr.Dataset | ArrayLike) -> NDArray[np.complex64]:
        """The samples (n,) of the operator's channels, from a sweep or an array of the full shape.

        Raises
        ------
        InputError
            If shape, frequencies or positions are others, or the samples are no finite complex numbers.
        """
        return samples_of_frame(sweep, self._problem, self._labels.attrs["wave_speed"])[self.channels]

    def all_samples(self, values: ArrayLike) -> NDArray[np.complex64]:
        """Samples that reflectivities (pixels,) give on all channels, chosen or not, in the shape of a whole sweep."""
        return self._implementation.samples(np.asarray(values, dtype=np.complex64).reshape(self._problem.shape))

    def image(self, values: ArrayLike) -> xr.DataArray:
        """Values (pixels,) as an image with its coordinates and attributes, as `focus` returns it.

        Raises
        ------
        InputError
            If there are not as many values as pixels.
        """
        flat = np.asarray(values, dtype=np.complex64)
        if flat.size != self._problem.pixels:
            raise InputError(f"there are {flat.size} values, expected one for each of {self._problem.pixels} pixels")
        return self._labels.image(flat.reshape(self._problem.shape), {"algorithm": self.algorithm, "error": self.error})

    def _matvec(self, x: NDArray[Any]) -> NDArray[np.complex64]:
        return self.all_samples(x)[self.channels]

    def _rmatvec(self, s: NDArray[Any]) -> NDArray[np.complex64]:
        data = np.zeros(self._problem.data_shape, dtype=np.complex64)
        data[self.channels] = np.asarray(s).ravel()
        return self._implementation.focus(data).ravel()


class _Exact:
    """Both directions as sums over all pairs and pixels."""

    algorithm = "exact"

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._sums = PairSums(problem, problem.points(np.arange(problem.pixels)))

    def focus(self, s: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Image (z, y, x) of samples."""
        return self._sums.focus(s).reshape(self._problem.shape)

    def samples(self, image: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Samples of an image (z, y, x)."""
        s = np.zeros(self._problem.data_shape, dtype=np.complex64)
        self._sums.samples(image.ravel(), s)
        return s


class _Fast:
    """Both directions by the sectors of a line array's plan; pixels nearer than these by the sums over all pairs."""

    algorithm = "polar"

    def __init__(self, plan: LineArrayPlan) -> None:
        self._plan = plan
        self._near = []
        for part in plan.parts:
            near = np.zeros(plan.problem.shape, dtype=bool)
            if part.box is not None:
                near[part.box] = part.near
            self._near.append((near, PairSums(part.part.problem, plan.problem.points(np.flatnonzero(near)))))

    def focus(self, s: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Image (z, y, x) of samples."""
        image = np.zeros(self._plan.problem.shape, dtype=np.complex64)
        for part, (near, sums) in zip(self._plan.parts, self._near, strict=True):
            data = np.ascontiguousarray(s[self._pairs(part)])
            for sector in part.sectors:
                sector(data, image.reshape(-1, image.shape[-1]))
            if near.any():
                image[near] += sums.focus(data)
        return image

    def samples(self, image: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Samples of an image (z, y, x)."""
        s = np.zeros(self._plan.problem.data_shape, dtype=np.complex64)
        for part, (near, sums) in zip(self._plan.parts, self._near, strict=True):
            data = np.zeros(part.part.problem.data_shape, dtype=np.complex64)
            for sector in part.sectors:
                sector_samples(sector, image.reshape(-1, image.shape[-1]), data)
            if near.any():
                sums.samples(image[near], data)
            s[self._pairs(part)] += data
        return s

    def _pairs(self, part: Any) -> tuple[Any, ...]:
        """Index that picks the samples of a part of the antennas out of those of all."""
        if part.part.problem.data_shape == self._plan.problem.data_shape:
            return (slice(None),)
        return slice(None), part.part.tx[:, None], part.part.rx[None, :]


def _channels(sweep: xr.Dataset, problem: Problem, channels: ArrayLike | None) -> Mask:
    """The chosen channels as a mask of the data's shape."""
    if channels is None:
        channels = sweep["measured"].values if "measured" in sweep.variables else True
    try:
        chosen = np.asarray(channels)
    except (TypeError, ValueError):
        raise wrong_kind("channels", channels, "an array of true and false") from None
    if chosen.dtype != bool:
        raise InputError(f"channels: holds {chosen.dtype}, expected an array of true and false")
    try:
        mask = np.broadcast_to(chosen, problem.data_shape).copy()
    except ValueError:
        raise InputError(
            f"channels: has shape {chosen.shape}, expected {problem.data_shape} or what can be broadcast to it"
        ) from None
    if not mask.any():
        raise InputError("channels: none is true; choose the channels that are measured")
    return mask


def _proven(problem: Problem, tolerance: float) -> tuple[_Fast | _Exact, float]:
    """The fast algorithm, refined until white noise is imaged within the tolerance, else the exact sums; the error."""
    noise = white_noise(problem)
    finer = tolerance
    for _ in range(REFINEMENTS):
        try:
            fast = _Fast(LineArrayPlan(problem, finer, lay_out(problem, finer, pair_sums_cost, APPLICATIONS)))
        except UnsuitedError:
            break
        error = measured_error(problem, fast.focus(noise), noise)
        if error <= SAMPLING_MARGIN * tolerance:
            return fast, error
        finer *= min(0.5, 0.5 * tolerance / error)
    exact = _Exact(problem)
    return exact, measured_error(problem, exact.focus(noise), noise)
