"""Which algorithm focuses a problem: the one that will take the least time, as the cost model counts it.

Every fast path is laid out first, which takes some hundredths of a second and tells what building its plan and making
an image will cost. A fast path is taken where plan and images together cost well less than by the exact kernel, so that
a mistaken prediction, too, costs little.
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
"""Below this many pairs times pixels the exact kernel takes half a second of one core, and nothing else is laid out."""

PLENTY = 0.15
"""Share of the exact kernel's time under which a fast path is so good that no other is laid out."""

ADVANTAGE = 0.7
"""Share of the exact kernel's time that a fast path, its plan included, must keep under."""

EXACT_SHARE = 0.5
"""Share of the tolerance that the exact kernel is asked for."""

FastPlan = LineArrayPlan | FactorizedPlan

FAST_ALGORITHMS: tuple[type[FastPlan], ...] = (LineArrayPlan, FactorizedPlan)


@dataclass(frozen=True, eq=False)
class Option:
    """An algorithm that could focus a problem.

    Attributes
    ----------
    algorithm : str
    tolerance : float
        For which the algorithm is laid out.
    cost : Cost
    layout : object, optional
        What a fast plan is made of.
    fast : type, optional
        The class of the plan; None for the exact kernel.
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
    return [option for option, why in _weighed(problem, tolerance, frames, PLENTY) if not why]


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


def _weighed(problem: Problem, tolerance: float, frames: int, plenty: float = 0.0) -> list[tuple[Option, str]]:
    """Every algorithm and what speaks against it, the fastest first; against the exact kernel, the last, nothing does.

    Once an algorithm takes less than `plenty` of the exact kernel's time, no further algorithm is laid out.
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
    """The choice for a problem, in words and numbers; `room` is for tables, buffers and proof [bytes]."""
    axes = {"z": problem.z, "y": problem.y, "x": problem.x}
    problem = problem.in_wavelengths  # as it will be focused
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
