"""Which algorithm focuses a problem: the one that will take the least time, as the cost model counts it.

Every fast path is laid out first, which takes some hundredths of a second and tells what building its plan and making
an image will cost. It is taken where all of that is well below the cost of the exact kernel, so that a mistaken
prediction, too, costs little.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import xarray as xr

from mirrorfold.common.records import Number, Record, fact
from mirrorfold.common.settings import takes
from mirrorfold.focusing.checks import check_measurement, make_problem
from mirrorfold.focusing.cost import Cost, exact_cost, proof_cost
from mirrorfold.focusing.factorized import Division, FactorizedPlan
from mirrorfold.focusing.lattice import UnsuitedError
from mirrorfold.focusing.line_array import Layout, LineArrayPlan
from mirrorfold.focusing.problem import Problem
from mirrorfold.focusing.settings import FocusSettings

FEWEST_PAIR_PIXELS = 2e7
"""Below this many pairs times pixels the exact kernel takes a tenth of a second, and nothing else is thought of."""

ADVANTAGE = 0.7
"""Share of the exact kernel's time that a fast path, its plan included, must keep under."""

EXACT_SHARE = 0.5
"""Of the tolerance, for the exact kernel."""

FastPlan = LineArrayPlan | FactorizedPlan

FAST_ALGORITHMS: tuple[type[FastPlan], ...] = (LineArrayPlan, FactorizedPlan)


@dataclass(frozen=True, eq=False)
class Option:
    """An algorithm that could focus a problem.

    Attributes
    ----------
    algorithm : str
    tolerance : float
        For which it is laid out.
    cost : Cost
    layout : object, optional
        What a fast plan is made of.
    fast : type, optional
        Of a fast plan; None for the exact kernel.
    """

    algorithm: str
    tolerance: float
    cost: Cost
    layout: Any = None
    fast: type[FastPlan] | None = None

    def make(self, problem: Problem) -> FastPlan:
        """The plan.

        Raises
        ------
        UnsuitedError
            If the problem turns out harder than it was laid out for.
        """
        assert self.fast is not None
        return self.fast(problem, self.tolerance, self.layout)


def options(problem: Problem, tolerance: float, frames: int = 1) -> list[Option]:
    """The algorithms worth taking, the fastest first; the exact kernel is the last.

    Parameters
    ----------
    problem : Problem
    tolerance : float
        Largest relative L2 error.
    frames : int
        Images that will be made.
    """
    found = _weighed(problem, tolerance, frames)
    return [option for option, why in found if not why] if len(found) > 1 else [found[0][0]]


def lay_out(fast: type[FastPlan], problem: Problem, tolerance: float) -> Option:
    """A fast path, laid out for a tolerance.

    Raises
    ------
    UnsuitedError
        If it does not suit the problem.
    """
    layout: Layout | Division = fast.lay_out(problem, tolerance)
    return Option(fast.algorithm, tolerance, layout.cost, layout, fast)


def pays(option: Option, exact: Option, frames: int) -> bool:
    """Whether a fast path is well below the exact kernel's cost, on all cores and in processor time."""
    return option.cost.seconds(frames) < ADVANTAGE * exact.cost.seconds(frames) and option.cost.processor_seconds(
        frames
    ) < ADVANTAGE * exact.cost.processor_seconds(frames)


def _weighed(problem: Problem, tolerance: float, frames: int) -> list[tuple[Option, str]]:
    """Every algorithm, the fastest first, and what speaks against it; nothing against the exact kernel, the last."""
    exact = Option("exact", tolerance, exact_cost(problem, problem.pixels, EXACT_SHARE * tolerance))
    if problem.pairs * problem.pixels < FEWEST_PAIR_PIXELS:
        return [(exact, "")]
    found = []
    for fast in FAST_ALGORITHMS:
        try:
            option = lay_out(fast, problem, tolerance)
        except UnsuitedError as error:
            found.append((Option(fast.algorithm, tolerance, Cost(float("inf"), float("inf")), None, fast), str(error)))
            continue
        found.append((option, "" if pays(option, exact, frames) else "the exact kernel takes hardly more time"))
    return [*sorted(found, key=lambda each: each[0].cost.seconds(frames)), (exact, "")]


class OptionFacts(Record):
    """An algorithm that could focus a sweep."""

    algorithm: str
    chosen: bool
    why: str = fact("it is chosen or not, one sentence")
    building_s: Number = fact("for the plan, once")
    frame_s: Number = fact("for each image")
    seconds: Number = fact("for plan, images and the measurement of their error")
    memory_bytes: Number = fact("of tables and buffers")


class Choice(Record):
    """Which algorithm will focus a sweep, and what else was possible."""

    algorithm: str = fact('"polar", "factorized" or "exact"')
    seconds: float = fact("predicted, on as many idle cores as there are")
    memory_bytes: float = fact("predicted, samples and image included")
    pixels: int
    tolerance: float
    options: list[OptionFacts]


@takes(FocusSettings)
def choose_algorithm(geometry: xr.Dataset, *, frames: int = 1, **given: Any) -> Choice:
    """Which algorithm `focus` will take, what else is possible, and the predicted time and memory of each.

    Parameters
    ----------
    geometry : xarray.Dataset
        A sweep, or only its ``frequency`` [Hz] and ``tx_position``, ``rx_position`` [m] (or ``antenna_position``).
    frames : int, default 1
        Images that will be made with one plan.
    **given

    Returns
    -------
    Choice
        Times are those of this machine with all its cores idle. Its speed is measured when it is first asked for, in a
        quarter of a second, and kept in the user's cache folder.

    Raises
    ------
    InputError
        As `focus`.
    """
    settings = FocusSettings().with_given(**given)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        problem = make_problem(check_measurement(geometry), settings)
    return explain(problem, float(settings.tolerance), frames)


def explain(problem: Problem, tolerance: float, frames: int = 1) -> Choice:
    """The choice for a problem, in words and numbers."""
    weighed = _weighed(problem, tolerance, frames)
    chosen = next(option for option, why in weighed if not why)
    proof = proof_cost(problem)
    facts = []
    for option, why in weighed:
        known = option.cost.frame < float("inf")
        reason = why or ("the fastest" if option is chosen else f"{chosen.algorithm} is faster")
        if option is chosen and len(weighed) == 1:
            reason = "so small that no plan pays"
        facts.append(
            OptionFacts(
                algorithm=option.algorithm,
                chosen=option is chosen,
                why=reason,
                building_s=option.cost.building if known else None,
                frame_s=Cost(0.0, option.cost.frame).seconds() if known else None,
                seconds=(option.cost + proof).seconds(frames) if known else None,
                memory_bytes=option.cost.nbytes if known else None,
            )
        )
    samples = 8.0 * problem.pairs * problem.k.size
    return Choice(
        algorithm=chosen.algorithm,
        seconds=(chosen.cost + proof).seconds(frames),
        memory_bytes=chosen.cost.nbytes + samples + 8.0 * problem.pixels * frames + proof.nbytes,
        pixels=problem.pixels,
        tolerance=tolerance,
        options=facts,
    )
