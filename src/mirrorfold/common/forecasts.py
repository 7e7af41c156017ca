"""What a step will take of the memory, from the sizes of its arrays: said before the work, refused if it is too much.

A step is described by its stages, and each stage by what it holds at once: named parts and their bytes. The stage that
holds most is the forecast. The program itself and its compiled kernels, 0.2 to 0.3 GB, are not in it.
"""

from __future__ import annotations

import logging
from typing import Literal

from mirrorfold.common.memory import check_room
from mirrorfold.common.records import Record, fact

GIGABYTE = 1e9

Parts = dict[str, float]
"""Names of arrays, and what they take [bytes]."""

log = logging.getLogger("mirrorfold")
"""Tells forecasts at the level INFO; the command line shows them with ``--verbose``."""


class Forecast(Record):
    """What a verb would take of the memory."""

    kind: Literal["forecast"]
    memory_gb: float = fact("predicted, input and result included, the program itself not")
    parts_gb: dict[str, float] = fact("what takes it, where it is the most")
    remarks: list[str] = fact("sentences on what looks wrong")


def fullest(*stages: Parts) -> Parts:
    """The stage that holds most.

    Examples
    --------
    >>> fullest({"image": 8.0}, {"image": 8.0, "copy": 8.0})
    {'image': 8.0, 'copy': 8.0}
    """
    return max(stages, key=total)


def total(parts: Parts) -> float:
    """All parts together [bytes]."""
    return float(sum(parts.values()))


def forecast(parts: Parts, remarks: list[str] | None = None) -> Forecast:
    """Parts as a record."""
    return Forecast(
        kind="forecast",
        memory_gb=total(parts) / GIGABYTE,
        parts_gb={name: nbytes / GIGABYTE for name, nbytes in parts.items()},
        remarks=remarks or [],
    )


def expect(parts: Parts, what: str, remedy: str, *, held: float = 0.0, limit: float | None = None) -> None:
    """Log what a step will take, and refuse it where that is more than there is.

    Parameters
    ----------
    parts : dict of float [bytes]
    what : str
        Who needs them, in the plural, such as ``"the steps that fold an image of 10 x 10 pixels"``.
    remedy : str
    held : float [bytes]
        What of them is in memory already.
    limit : float [bytes], optional
        Of all that this process may hold; by default what is free.

    Raises
    ------
    InputError
        If they do not fit.
    """
    tell(parts, what)
    check_room(total(parts) - held, what, remedy, limit)


def tell(parts: Parts, what: str) -> None:
    """Log what a step will take."""
    named = ", ".join(f"{name} {nbytes / GIGABYTE:.3g}" for name, nbytes in parts.items())
    log.info("%s: %.3g GB of memory are forecast (%s)", what, total(parts) / GIGABYTE, named)
