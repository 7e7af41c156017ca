"""Facts that the descriptions of all files share."""

from __future__ import annotations

from mirrorfold.common.records import LEFT_OUT, Record, fact


class Described(Record):
    """A file or object of one kind."""

    path: str | None = fact("file that was asked about", default=LEFT_OUT)
    kind: str
    title: str = fact("what the file calls itself")


class Sized(Described):
    """A file or object with dimensions."""

    dimensions: dict[str, int] = fact("length of each dimension")
