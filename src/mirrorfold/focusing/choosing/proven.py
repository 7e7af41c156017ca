"""Images by a fast algorithm whose error is measured on the image itself.

The predicted error of a fast algorithm holds for white noise. The error on the given samples is therefore measured, on
random pixels against the float64 sum. While it is too large, the plan is made anew at a finer tolerance; if that takes
too many tries or no longer saves time, the next algorithm is tried, and at last the exact kernel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Progress
from mirrorfold.focusing.choosing.caching import PlanCache
from mirrorfold.focusing.choosing.choice import FastPlan, lay_out, pays
from mirrorfold.focusing.choosing.strips import table_bytes
from mirrorfold.focusing.exact.accuracy import measured_error
from mirrorfold.focusing.problem import Problem, UnsuitedError

REFINEMENTS = 3
"""Number of plans that are tried for one algorithm, each at a finer tolerance, before it is given up."""

SAMPLING_MARGIN = 0.8
"""Largest measured error that is accepted, as a share of the tolerance: it is an estimate from a sample of pixels."""


class Proven(NamedTuple):
    """A fast plan, an image that it made, and the relative L2 error measured on this image."""

    plan: FastPlan
    image: NDArray[np.complex64]
    error: float


def prove(
    problem: Problem,
    tolerance: float,
    s: NDArray[np.complex64],
    plans: PlanCache,
    frames: int = 1,
    progress: Progress | None = None,
    room: float = float("inf"),
    goal: float | None = None,
) -> Proven | None:
    """The fastest plan that images the samples `s` within the tolerance; None where the exact kernel must image them.

    Parameters
    ----------
    problem : Problem
    tolerance : float
        Largest relative L2 error.
    s : (frequencies, tx, rx) or, monostatic, (frequencies, tx) array
        Samples of one frame.
    plans : PlanCache
        Where plans are looked for, and kept.
    frames : int
        Number of images that will be made.
    progress : callable (done, total), optional
    room : float [bytes]
        Memory for tables, buffers and the measurement of the error.
    goal : float, optional
        Relative L2 error to accept, by default the tolerance. A dark strip of an image may have a larger one, because
        its share in the error of the whole image is small.
    """
    goal = tolerance if goal is None else goal
    *fast, exact = plans.options(problem, tolerance, frames)
    for option in fast:
        assert option.fast is not None
        for _ in range(REFINEMENTS):
            if table_bytes(problem, option) > room:
                break
            try:
                plan = plans.plan(option, problem)
            except UnsuitedError:
                break
            image = plan(s, progress)
            error = measured_error(problem, image, s)
            if error <= SAMPLING_MARGIN * goal:
                plans.settle(problem, tolerance, frames, option)
                return Proven(plan, image, error)
            try:
                option = lay_out(option.fast, problem, option.tolerance * min(0.5, 0.5 * goal / error))
            except UnsuitedError:
                break
            if not pays(option, exact, frames):
                break
    return None
