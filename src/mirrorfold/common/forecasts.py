"""Forecasts of the memory that a step will take, from the sizes of its arrays; too much is refused before the work.

A step has stages, and each stage holds named parts in memory at once, with their bytes. The forecast is the stage that
holds most. The program itself and its compiled kernels, 0.2 to 0.3 GB, are not included.
"""

from __future__ import annotations

import logging
from typing import Literal

from mirrorfold.common.memory import check_room
from mirrorfold.common.records import Record, fact

GIGABYTE = 1e9

Parts = dict[str, float]
"""The size of each array [bytes], by its name."""

log = logging.getLogger("mirrorfold")
"""Forecasts are logged here at the level INFO; the command line shows them with ``--verbose``."""


class Forecast(Record):
    """The memory that a command would take."""

    kind: Literal["forecast"]
    memory_gb: float = fact("predicted, input and result included, the program itself not")
    parts_gb: dict[str, float] = fact("what takes it, where it is the most")
    remarks: list[str] = fact("sentences on what looks wrong")


def fullest(*stages: Parts) -> Parts:
    """The stage that holds most bytes.

    Examples
    --------
    >>> fullest({"image": 8.0}, {"image": 8.0, "copy": 8.0})
    {'image': 8.0, 'copy': 8.0}
    """
    return max(stages, key=total)


def total(parts: Parts) -> float:
    """The size of all parts together [bytes]."""
    return float(sum(parts.values()))


def forecast(parts: Parts) -> Forecast:
    """The parts of a stage as a record."""
    return Forecast(
        kind="forecast",
        memory_gb=total(parts) / GIGABYTE,
        parts_gb={name: nbytes / GIGABYTE for name, nbytes in parts.items()},
        remarks=[],
    )


def expect(parts: Parts, what: str, remedy: str, *, held: float = 0.0, limit: float | None = None) -> None:
    """Log how much memory a step will take, and refuse the step if that is more than there is.

    Parameters
    ----------
    parts : dict of float [bytes]
    what : str
        What needs the memory, in the plural, such as ``"the steps that fold an image of 10 x 10 pixels"``.
    remedy : str
        What to do, at the end of the message.
    held : float [bytes]
        The part of it that is in memory already.
    limit : float [bytes], optional
        Memory that this process may hold in all; by default what is free counts.

    Raises
    ------
    InputError
        If the parts do not fit.
    """
    tell(parts, what)
    check_room(total(parts) - held, what, remedy, limit)


def tell(parts: Parts, what: str) -> None:
    """Log how much memory a step will take."""
    named = ", ".join(f"{name} {nbytes / GIGABYTE:.3g}" for name, nbytes in parts.items())
    log.info("%s: %.3g GB of memory are forecast (%s)", what, total(parts) / GIGABYTE, named)
