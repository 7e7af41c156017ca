"""Which algorithm focuses a problem: the fastest whose image of the very data proves exact enough."""

from __future__ import annotations

import warnings
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.settings import takes
from mirrorfold.common.types import Progress
from mirrorfold.focusing.accuracy import measured_error
from mirrorfold.focusing.checks import check_measurement, make_problem
from mirrorfold.focusing.factorized import FactorizedPlan
from mirrorfold.focusing.line_array import LineArrayPlan
from mirrorfold.focusing.nodes import UnsuitedError
from mirrorfold.focusing.problem import Problem
from mirrorfold.focusing.settings import FocusSettings

REFINEMENTS = 3
"""Tries at a finer tolerance each before the next algorithm takes over."""

FEWEST_PAIR_PIXELS = 2e8
"""Below this many pairs times pixels the exact kernel needs no more time than building a plan."""

SAMPLING_MARGIN = 0.8
"""Share of the tolerance that the error measured on a sample of pixels must keep under."""

FastPlan = LineArrayPlan | FactorizedPlan

FAST_ALGORITHMS: tuple[type[FastPlan], ...] = (LineArrayPlan, FactorizedPlan)
"""In the order in which they are tried: the first is the faster, the second suits any array."""


class Proven(NamedTuple):
    """A fast plan, with the image it made and the relative L2 error that was measured on it."""

    plan: FastPlan
    image: NDArray[np.complex64]
    error: float


class PlanCache:
    """Keeps the fast plan that was made last, for whoever focuses sweep after sweep of one geometry.

    A plan depends on geometry, frequencies, weights, pixels and tolerance, and not on the samples. Several threads may
    use one cache at once; each is handed the plan that suits its problem.
    """

    def __init__(self) -> None:
        self._latest: tuple[type[FastPlan], bytes, float, FastPlan] | None = None

    def plan(self, algorithm: type[FastPlan], problem: Problem, tolerance: float) -> FastPlan:
        """The plan of an algorithm, the one that is kept where it suits.

        Raises
        ------
        UnsuitedError
            If the algorithm does not suit the problem.
        """
        wanted, latest = (algorithm, problem.key, tolerance), self._latest
        if latest is None or latest[:3] != wanted:
            latest = None
            self.clear()  # before the next is made: two need not fit into memory
            latest = (*wanted, algorithm(problem, tolerance))
            self._latest = latest
        return latest[3]

    def clear(self) -> None:
        """Forget the plan, and free its memory."""
        self._latest = None

    @property
    def nbytes(self) -> int:
        """Memory of the plan that is kept [bytes]."""
        return 0 if self._latest is None else self._latest[3].nbytes


plan_cache = PlanCache()
"""The cache of all calls that name none of their own."""


def worth_a_plan(problem: Problem) -> bool:
    """Whether the image is so large that a fast plan may pay."""
    return problem.pairs * problem.pixels >= FEWEST_PAIR_PIXELS


@takes(FocusSettings)
def prepare(geometry: xr.Dataset, **given: Any) -> PlanCache:
    """Make the plan that `focus` will try first, from a sweep's geometry alone: while its samples are still being read.

    Parameters
    ----------
    geometry : xarray.Dataset
        A sweep, or only its ``frequency`` [Hz] and ``tx_position``, ``rx_position`` [m] (or ``antenna_position``).
    **given

    Returns
    -------
    PlanCache
        To be given to `focus` as `plans`. Empty where the sum over all pairs is as fast.

    Raises
    ------
    InputError
        As `focus`, which also gives the warnings.
    """
    settings, plans = FocusSettings().with_given(**given), PlanCache()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        problem = make_problem(check_measurement(geometry), settings)
    if worth_a_plan(problem):
        for algorithm in FAST_ALGORITHMS:
            with suppress(UnsuitedError):
                plans.plan(algorithm, problem, settings.tolerance)
                break
    return plans


def choose(
    problem: Problem,
    tolerance: float,
    s: NDArray[np.complex64],
    plans: PlanCache,
    progress: Progress | None = None,
) -> Proven | None:
    """The coarsest fast plan that images `s` within the tolerance; None where the exact kernel must do it.

    Parameters
    ----------
    problem : Problem
    tolerance : float
        Largest relative L2 error.
    s : (frequencies, tx, rx) or, monostatic, (frequencies, tx) array
    plans : PlanCache
        Where plans are looked for, and kept.
    progress : callable (done, total), optional
    """
    if not worth_a_plan(problem):
        return None
    for algorithm in FAST_ALGORITHMS:
        target = tolerance
        for _ in range(REFINEMENTS):
            try:
                plan = plans.plan(algorithm, problem, target)
            except UnsuitedError:
                break
            image = plan(s, progress)
            error = measured_error(problem, image, s)
            if error <= SAMPLING_MARGIN * tolerance:
                return Proven(plan, image, error)
            target *= min(0.5, 0.5 * tolerance / error)
    return None
