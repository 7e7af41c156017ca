"""Records that report the choice of an algorithm, to Python and to the command line."""

from __future__ import annotations

from typing import Literal

from mirrorfold.common.records import LEFT_OUT, Number, Record, fact


class OptionFacts(Record):
    """An algorithm that could focus a sweep."""

    algorithm: str
    chosen: bool
    why: str = fact("it is chosen or not, one sentence")
    building_s: Number = fact("for the plan, once")
    frame_s: Number = fact("for each image")
    total_s: Number = fact("for plan, images and the measurement of their error")
    memory_gb: Number = fact("of tables and buffers")


class Choice(Record):
    """Which algorithm will focus a sweep, and what else was possible."""

    kind: Literal["choice"]
    algorithm: str = fact('"polar", "factorized" or "exact"; of a raster scan "range profiles"')
    focusing_s: float = fact("predicted, on as many idle cores as there are")
    memory_gb: float = fact("predicted, samples and image included")
    dimensions: dict[str, int] = fact("pixels along each dimension")
    extent: dict[str, list[float]] = fact("first and last coordinate of each dimension, in metres or degrees")
    pixels: int
    tolerance: float = fact("largest relative L2 error; zero where the image is exact to rounding")
    options: list[OptionFacts] = fact("the fastest first; none where there is no choice")
    remarks: list[str] = fact("sentences on what looks wrong")
    folding_s: Number = fact("predicted, for steps 2 to 6", default=LEFT_OUT)
