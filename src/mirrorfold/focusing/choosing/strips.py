"""Images in strips, where the tables of the whole image do not fit into the memory.

A strip is a problem of its own, with fewer pixels and smaller tables. Its error is measured like that of a whole image;
all strips together keep to the tolerance, so that a strip without echoes may have a larger error for its power.
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
"""Beyond so many, the sum over all pairs takes less memory, and hardly more time."""

SAMPLE_COPIES = 2
"""Copies of the samples of one frame that are held at once: as they came, and as the algorithm sorts them."""

ROOM_SHARE = 0.8
"""Share of the memory left that tables may fill: not all that one strip has freed is there for the next."""

CODE_BYTES = 1.2e8
"""Memory of the compiled kernels, which are loaded with the first image."""


class Strip(NamedTuple):
    """Some rows of an image: along z of a volume, along y of a plane.

    Attributes
    ----------
    problem : Problem
    rows : slice
        Into the axes (z, y, x) of the whole image.
    option : Option
        The fastest algorithm that fits.
    """

    problem: Problem
    rows: tuple[slice, slice]
    option: Option


def room_for_tables(problem: Problem, frames: int, limit: float | None, *, samples_held: bool) -> float:
    """Memory [bytes] that samples and images leave for tables and buffers.

    Parameters
    ----------
    problem : Problem
    frames : int
    limit : float [bytes], optional
        Of all that this process may hold; by default what is free.
    samples_held : bool
        Whether the samples are in memory already.
    """
    copies = SAMPLE_COPIES - 1 if samples_held else SAMPLE_COPIES
    held = CODE_BYTES + copies * samples_bytes(problem) + 8.0 * problem.pixels * frames
    return ROOM_SHARE * (room_below(limit) - held)


def samples_bytes(problem: Problem) -> float:
    """Size of the samples of one frame [bytes]."""
    return 8.0 * problem.pairs * problem.k.size


def held_parts(problem: Problem, frames: int) -> Parts:
    """What samples and images take while images are made, by name [bytes]."""
    copies = SAMPLE_COPIES + frames - 1
    return {"samples": copies * samples_bytes(problem), "images": 8.0 * problem.pixels * frames}


def table_bytes(problem: Problem, option: Option) -> float:
    """What an algorithm and the proof of its image take beside samples and image [bytes]."""
    return option.cost.nbytes + proof_cost(problem).nbytes


def divide(problem: Problem, options: Callable[[Problem], list[Option]], room: float) -> list[Strip]:
    """Strips whose algorithms fit: the whole where it does, else its halves, and theirs.

    Tables grow towards the array. A few rows next to it, whose fast tables never fit, are summed over all pairs.

    Parameters
    ----------
    problem : Problem
    options : callable
        The algorithms worth taking for a problem, the fastest first, the sum over all pairs last.
    room : float [bytes]
        For tables, buffers and the proof of each image.

    Raises
    ------
    InputError
        If not even the sum over all pairs fits.
    """
    rows = slice(0, problem.z.size if problem.z.size > 1 else problem.y.size)
    return _divided(problem, rows, options, room)


def _divided(whole: Problem, rows: slice, options: Callable[[Problem], list[Option]], room: float) -> list[Strip]:
    """The strips of some rows."""
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
