"""The results of an experiment: claims with verdicts, numbers, tables, pictures and data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import xarray as xr

from mirrorfold.common.records import Number, Record, fact

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER = "Cui and Trichopoulos, IEEE Trans. THz Sci. Technol. 14(4), 433-445, 2024"
"""The publication whose figures are computed anew."""

Verdict = Literal["agrees", "differs", "new"]
"""Verdict on a claim: our number agrees with the published one, differs from it, or answers an open question."""


class Claim(Record):
    """A published claim, or a question that the publication leaves open, beside our result."""

    claim: str = fact("what was published, or what is asked")
    source: str = fact("where, such as `Fig. 4 (b)`; empty where nothing was published")
    measured: str = fact("what came out here, with its unit")
    verdict: Verdict = fact("`new` where nothing was published")
    why: str = fact("how it was judged, and why it differs")


class Table(Record):
    """A table on the page of an experiment."""

    title: str
    columns: list[str] = fact("headings, with units")
    rows: list[list[str]]


class Picture(Record):
    """A picture on the page of an experiment."""

    file: str = fact("name without suffix; there are a PNG and a PDF of it")
    caption: str


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What an experiment returns.

    Attributes
    ----------
    claims : tuple of Claim
        At least one.
    numbers : dict of float
        Every number that the claims rest on, with its unit at the end of the name, such as ``wall_angle_error_deg``.
    figures : dict of (Figure, str)
        Pictures and their captions, by the names of the pictures' files, in the order of the page.
    data : Dataset or DataTree
        The data that the pictures show: real numbers, with their units as attributes.
    tables : tuple of Table
    text : tuple of str
        Paragraphs of plain text on what can be learnt.
    assumptions : tuple of str
        What had to be assumed where the publication says too little.
    """

    claims: tuple[Claim, ...]
    numbers: Mapping[str, Number]
    figures: Mapping[str, tuple[Figure, str]]
    data: xr.Dataset | xr.DataTree
    tables: tuple[Table, ...] = ()
    text: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()


class Result(Record):
    """The result of a finished experiment, as stored in `result.json` in the experiment's folder."""

    name: str
    title: str
    source: str = fact("the published figure, or empty")
    purpose: str
    quick: bool = fact("at reduced size")
    command: str = fact("what makes it again")
    version: str = fact("of mirrorfold")
    seconds: float = fact("time that it took on this machine [s]")
    digest: str = fact("of the program that it was made with, by which a later run knows it")
    claims: list[Claim]
    numbers: dict[str, Number]
    tables: list[Table]
    pictures: list[Picture]
    text: list[str]
    assumptions: list[str]
