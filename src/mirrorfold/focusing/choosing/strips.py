"""Images in strips, where the tables of the whole image do not fit into the memory.

Each strip is focused as a problem of its own, with fewer pixels and smaller tables, and its error is measured. The
tolerance holds for all strips together: a dark strip without echoes may have a larger relative error than a bright one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from mirrorfold.common.forecasts import Parts
from mirrorfold.common.memory import room_below
from mirrorfold.errors import InputError
from mirrorfold.focusing.predicting.cost import proof_cost
from mirrorfold.focusing.problem import Problem

if TYPE_CHECKING:
    from mirrorfold.focusing.choosing.choice import Option

MOST_STRIPS = 64
"""A strip of 1 / MOST_STRIPS of the rows, or fewer, is not divided further: the sum over all pairs then takes less
memory, and hardly more time."""

SAMPLE_COPIES = 2
"""Copies of the samples of one frame that are held at once: as they were given, and as the algorithm sorts them."""

ROOM_SHARE = 0.8
"""Share of the remaining memory that tables may fill: not all that one strip frees is available to the next."""

CODE_BYTES = 1.2e8
"""Memory [bytes] of the compiled kernels, which are loaded with the first image."""


class Strip(NamedTuple):
    """Some rows of an image, along z of a volume, along y of a plane image.

    Attributes
    ----------
    problem : Problem
        The problem on the pixels of the strip.
    rows : pair of slice
        Where the strip lies along the axes z and y of the whole image.
    option : Option
        The fastest algorithm whose tables fit into the memory.
    """

    problem: Problem
    rows: tuple[slice, slice]
    option: Option


def room_for_tables(problem: Problem, frames: int, limit: float | None, *, samples_held: bool) -> float:
    """Memory [bytes] that is left for tables and buffers beside samples, images and compiled code.

    Parameters
    ----------
    problem : Problem
    frames : int
    limit : float [bytes], optional
        Memory that the process may hold in all; by default what is free.
    samples_held : bool
        Whether the samples are in memory already, so that only their copies need more.
    """
    in_memory = frames * samples_bytes(problem) if samples_held else 0.0
    held = CODE_BYTES + sum(held_parts(problem, frames).values()) - in_memory
    return ROOM_SHARE * (room_below(limit) - held)


def samples_bytes(problem: Problem) -> float:
    """Size of the samples of one frame [bytes]."""
    return 8.0 * problem.pairs * problem.k.size


def held_parts(problem: Problem, frames: int) -> Parts:
    """Memory [bytes] of the samples and of the images while images are made, by name."""
    copies = SAMPLE_COPIES + frames - 1
    return {"samples": copies * samples_bytes(problem), "images": 8.0 * problem.pixels * frames}


def table_bytes(problem: Problem, option: Option) -> float:
    """Memory [bytes] of an algorithm and of the measurement of its error, beside samples and image."""
    return option.cost.nbytes + proof_cost(problem).nbytes


def divide(problem: Problem, options: Callable[[Problem], list[Option]], room: float) -> list[Strip]:
    """Strips whose tables fit into the memory: the whole image if its tables fit, else its halves, divided in turn.

    Tables are larger for pixels nearer to the array. A few rows next to the array, whose fast tables never fit, are
    imaged by the sum over all pairs.

    Parameters
    ----------
    problem : Problem
    options : callable
        The algorithms worth taking for a problem, the fastest first, the sum over all pairs last.
    room : float [bytes]
        Memory for tables, buffers and the measurement of the error, of one strip at a time.

    Raises
    ------
    InputError
        If not even the sum over all pairs fits.
    """
    rows = slice(0, problem.z.size if problem.z.size > 1 else problem.y.size)
    return _divided(problem, rows, options, room)


def _divided(whole: Problem, rows: slice, options: Callable[[Problem], list[Option]], room: float) -> list[Strip]:
    """The strips of some rows of the whole image."""
    volume = whole.z.size > 1
    part = replace(whole, z=whole.z[rows]) if volume else replace(whole, y=whole.y[rows])
    where = (rows, slice(None)) if volume else (slice(None), rows)
    fastest, *others = options(part)
    needed = table_bytes(part, fastest)
    if needed <= room:
        return [Strip(part, where, fastest)]
    total, count = (whole.z.size if volume else whole.y.size), rows.stop - rows.start
    exact = others[-1] if others else fastest
    summed = [Strip(part, where, exact)] if table_bytes(part, exact) <= room else []
    if count < 2 or MOST_STRIPS * count <= total:
        if summed:
            return summed
        raise InputError(
            f"memory: an image of {whole.pixels} pixels from {samples_bytes(whole) / 1e9:.3g} GB of samples needs "
            f"{(table_bytes(part, exact) - room) / 1e9:.3g} GB more than it may have, though it is made in strips; ask "
            "for fewer pixels, close other programs, or raise the limit"
        )
    middle = (rows.start + rows.stop) // 2
    halves = [_divided(whole, slice(*ends), options, room) for ends in ((rows.start, middle), (middle, rows.stop))]
    if summed and all(strip.option.fast is None for half in halves for strip in half):
        return summed
    return [strip for half in halves for strip in half]
