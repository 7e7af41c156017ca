"""Which algorithm focuses a problem: the one with the least predicted time.

Each fast algorithm is laid out first: its sizes are found (sectors, nodes, blocks of antennas), but no tables are made.
This takes some hundredths of a second, and tells what building the plan and making an image will cost. A fast algorithm
is taken if plan and images together cost clearly less than the exact kernel, so that a wrong prediction costs little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mirrorfold.common.forecasts import GIGABYTE, total
from mirrorfold.focusing.choosing.facts import Choice, OptionFacts
from mirrorfold.focusing.choosing.strips import divide, held_parts, table_bytes
from mirrorfold.focusing.fast.factorized import Division, FactorizedPlan
from mirrorfold.focusing.fast.line_array import Layout, LineArrayPlan
from mirrorfold.focusing.predicting.cost import Cost, exact_cost, proof_cost
from mirrorfold.focusing.problem import Problem, UnsuitedError

FEWEST_PAIR_PIXELS = 1e8
"""Pairs times pixels below which no fast algorithm is laid out: the exact kernel takes half a second of one core."""

NO_OTHER_BELOW = 0.15
"""If a fast algorithm takes less than this share of the exact kernel's time, no other one is laid out."""

LARGEST_TIME_SHARE = 0.7
"""A fast algorithm, its plan included, is taken only below this share of the exact kernel's time."""

EXACT_SHARE = 0.5
"""Tolerance that the exact kernel is given, as a share of the tolerance of the image."""

FastPlan = LineArrayPlan | FactorizedPlan

FAST_ALGORITHMS: tuple[type[FastPlan], ...] = (LineArrayPlan, FactorizedPlan)


@dataclass(frozen=True, eq=False)
class Option:
    """An algorithm that could focus a problem.

    Attributes
    ----------
    algorithm : str
    tolerance : float
        Relative L2 error for which the algorithm is laid out.
    cost : Cost
    layout : object, optional
        The sizes from which a fast plan is made.
    fast : type, optional
        The class of the plan; None for the exact kernel.
    """

    algorithm: str
    tolerance: float
    cost: Cost
    layout: Any = None
    fast: type[FastPlan] | None = None

    def make(self, problem: Problem) -> FastPlan:
        """Make the plan, with all its tables.

        Raises
        ------
        UnsuitedError
            If the plan turns out to need more than its layout foresaw.
        """
        assert self.fast is not None
        return self.fast(problem, self.tolerance, self.layout)


def options(problem: Problem, tolerance: float, frames: int = 1) -> list[Option]:
    """The algorithms that are worth taking, the fastest first; the last one is the exact kernel.

    Parameters
    ----------
    problem : Problem
    tolerance : float
        Largest relative L2 error.
    frames : int
        Number of images that will be made.
    """
    return [option for option, why in _weighed(problem, tolerance, frames, NO_OTHER_BELOW) if not why]


def lay_out(fast: type[FastPlan], problem: Problem, tolerance: float) -> Option:
    """A fast algorithm, laid out for a tolerance.

    Raises
    ------
    UnsuitedError
        If the algorithm does not suit the problem.
    """
    layout: Layout | Division = fast.lay_out(problem, tolerance)
    return Option(fast.algorithm, tolerance, layout.cost, layout, fast)


def pays(option: Option, exact: Option, frames: int) -> bool:
    """Whether a fast algorithm costs clearly less than the exact kernel, both in elapsed time and in processor time."""
    whole, processor = exact.cost.seconds(frames), exact.cost.processor_seconds(frames)
    return (
        option.cost.seconds(frames) < LARGEST_TIME_SHARE * whole
        and option.cost.processor_seconds(frames) < LARGEST_TIME_SHARE * processor
    )


def _weighed(problem: Problem, tolerance: float, frames: int, plenty: float = 0.0) -> list[tuple[Option, str]]:
    """Every algorithm with the reason not to take it, empty if there is none; the fastest first, the exact kernel last.

    Once an algorithm takes less than the share `plenty` of the exact kernel's time, no further one is laid out.
    """
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
        if option.cost.seconds(frames) < plenty * exact.cost.seconds(frames):
            break
    return [*sorted(found, key=lambda each: each[0].cost.seconds(frames)), (exact, "")]


def explain(
    problem: Problem,
    tolerance: float,
    frames: int = 1,
    remarks: Sequence[str] = (),
    room: float = float("inf"),
) -> Choice:
    """The choice for a problem, in words and numbers; `room` [bytes] is left for tables, buffers and proof."""
    axes = {"z": problem.z, "y": problem.y, "x": problem.x}
    problem = problem.in_wavelengths  # the form in which it will be focused
    weighed = _weighed(problem, tolerance, frames)
    chosen = next(option for option, why in weighed if not why)
    proof = proof_cost(problem)
    tables, seconds, said = table_bytes(problem, chosen), (chosen.cost + proof).seconds(frames), list(remarks)
    if tables > room:
        strips = divide(problem, lambda part: options(part, tolerance, frames), room)
        tables = max(table_bytes(strip.problem, strip.option) for strip in strips)
        seconds = sum((strip.option.cost + proof_cost(strip.problem)).seconds(frames) for strip in strips)
        said.append(f"The memory does not hold the tables of the whole image: it is made in {len(strips)} strips.")
    facts = []
    for option, why in weighed:
        known = option.cost.frame < float("inf")
        reason = why or ("the fastest" if option is chosen else f"{chosen.algorithm} is faster")
        if len(weighed) == 1:
            reason = "so little work that no plan pays"
        facts.append(
            OptionFacts(
                algorithm=option.algorithm,
                chosen=option is chosen,
                why=reason,
                building_s=option.cost.building if known else None,
                frame_s=Cost(0.0, option.cost.frame).seconds() if known else None,
                total_s=(option.cost + proof).seconds(frames) if known else None,
                memory_gb=option.cost.nbytes / GIGABYTE if known else None,
            )
        )
    return Choice(
        kind="choice",
        algorithm=chosen.algorithm,
        focusing_s=seconds,
        memory_gb=(tables + total(held_parts(problem, frames))) / GIGABYTE,
        dimensions={name: int(axis.size) for name, axis in axes.items()},
        extent={name: [float(axis[0]), float(axis[-1])] for name, axis in axes.items()},
        pixels=problem.pixels,
        tolerance=tolerance,
        options=facts,
        remarks=said,
    )
