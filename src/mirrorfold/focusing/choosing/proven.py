"""Images by a fast path, proven exact enough on the very data; else made anew, finer, or by the exact kernel."""

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
"""Tries, each at a finer tolerance, before the exact kernel takes over."""

SAMPLING_MARGIN = 0.8
"""Share of the tolerance that the error measured on a sample of pixels must keep under."""


class Proven(NamedTuple):
    """A fast plan, with the image it made and the relative L2 error that was measured on it."""

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
    """The fastest plan that images `s` within the tolerance; None where the exact kernel must do it.

    Parameters
    ----------
    problem : Problem
    tolerance : float
        Largest relative L2 error.
    s : (frequencies, tx, rx) or, monostatic, (frequencies, tx) array
    plans : PlanCache
        Where plans are looked for, and kept.
    frames : int
        Images that will be made.
    progress : callable (done, total), optional
    room : float [bytes]
        For tables, buffers and the proof.
    goal : float, optional
        Error to accept, by default the tolerance. A dark strip of an image may have a larger error, for its share in
        the error of the whole is small.
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
