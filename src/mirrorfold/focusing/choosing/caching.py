"""A cache for the choice of the algorithm and the tables of a fast one, for the next sweep of the same geometry."""

from __future__ import annotations

import warnings
from contextlib import suppress
from typing import Any

import xarray as xr

from mirrorfold.common.settings import takes
from mirrorfold.focusing.checks import make_problem
from mirrorfold.focusing.choosing.choice import FastPlan, Option, options
from mirrorfold.focusing.choosing.strips import room_for_tables, table_bytes
from mirrorfold.focusing.problem import Problem, UnsuitedError
from mirrorfold.focusing.settings import FocusSettings


class PlanCache:
    """Keeps the last choice of an algorithm and the last fast plan, for sweep after sweep of one geometry.

    Both depend on geometry, frequencies, weights, pixels and tolerance, but not on the samples. Several threads may
    use one cache at once; each gets the plan of its own problem.
    """

    def __init__(self) -> None:
        self._latest: tuple[str, bytes, float, FastPlan] | None = None
        self._choice: tuple[bytes, float, int, list[Option]] | None = None

    def options(self, problem: Problem, tolerance: float, frames: int = 1) -> list[Option]:
        """The result of `choice.options`, kept until it is asked for with other arguments."""
        wanted, choice = (problem.key, tolerance, frames), self._choice
        if choice is None or choice[:3] != wanted:
            choice = (*wanted, options(problem, tolerance, frames))
            self._choice = choice
        return choice[3]

    def plan(self, option: Option, problem: Problem) -> FastPlan:
        """The plan of an option: the kept one if it was made for this option and problem, else a new one, then kept.

        Raises
        ------
        UnsuitedError
            If the algorithm does not suit the problem.
        """
        wanted, latest = (option.algorithm, problem.key, option.tolerance), self._latest
        if latest is None or latest[:3] != wanted:
            latest = None
            self._latest = None  # before the next is made: two need not fit into memory
            latest = (*wanted, option.make(problem))
            self._latest = latest
        return latest[3]

    def settle(self, problem: Problem, tolerance: float, frames: int, option: Option) -> None:
        """Keep only this option and the exact sum for the next time: the faster options have proven too coarse."""
        exact = self.options(problem, tolerance, frames)[-1]
        self._choice = (problem.key, tolerance, frames, [option, exact])

    def clear(self) -> None:
        """Forget plan and choice, and free their memory."""
        self._latest = self._choice = None

    @property
    def nbytes(self) -> int:
        """Memory of the plan that is kept [bytes]."""
        return 0 if self._latest is None else self._latest[3].nbytes


plan_cache = PlanCache()
"""The cache of all calls that are given no `plans`."""


@takes(FocusSettings)
def prepare(geometry: xr.Dataset, *, plans: PlanCache | None = None, **given: Any) -> PlanCache:
    """Make the plan that `focus` will try first, from a sweep's geometry alone: while its samples are still being read.

    Parameters
    ----------
    geometry : xarray.Dataset
        A sweep, or only its ``frequency`` [Hz] and ``tx_position``, ``rx_position`` [m] (or ``antenna_position``).
    plans : PlanCache, optional
        Where the plan is kept; by default a new one.
    **given

    Returns
    -------
    PlanCache
        To be given to `focus` as `plans`. It holds no plan where the sum over all pairs is as fast, or where the
        memory does not hold the plan of the whole image.

    Raises
    ------
    InputError
        As `focus`, which also gives the warnings.
    """
    settings, plans = FocusSettings().with_given(**given), PlanCache() if plans is None else plans
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        problem = make_problem(geometry, settings)[1].in_wavelengths
    best = plans.options(problem, float(settings.tolerance))[0]
    room = room_for_tables(problem, 1, settings.memory_limit, samples_held=False)
    if best.fast and table_bytes(problem, best) <= room:
        with suppress(UnsuitedError):
            plans.plan(best, problem)
    return plans
