"""Error messages about mistakes in scenes: pydantic's errors in plain words, with the place of each mistake."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, Self

from pydantic import ValidationError

from mirrorfold.common.arguments import in_message, wrong_kind
from mirrorfold.errors import InputError

INTERNAL = re.compile(r"[A-Z].*|.*[\[(].*|str|float|int")
"""Parts that pydantic adds to the place of an error to tell the types of a union apart; no entry of a file has such a
name."""


@dataclass(frozen=True)
class Entries:
    """The entries that a scene file may have.

    Attributes
    ----------
    of_kind : dict
        Names of the entries of a surface, by the kind of the surface.
    known : list of str
        Names of all entries.
    """

    of_kind: Mapping[str, frozenset[str]]
    known: Sequence[str]

    @classmethod
    def of(cls, surfaces: Iterable[type[Any]], others: Iterable[type[Any]]) -> Self:
        """The entries that are the fields of the dataclasses of surfaces, and of the other dataclasses of a scene."""
        of_kind = {one.__dataclass_fields__["kind"].default: frozenset(one.__dataclass_fields__) for one in surfaces}
        known = set().union(*of_kind.values(), *(one.__dataclass_fields__ for one in others))
        return cls(of_kind, sorted(known))


def plain(error: ValidationError, source: str, entries: Entries) -> InputError:
    """One error whose message lists all mistakes that pydantic found, each with its place."""
    mistakes: dict[str, list[str]] = {}
    for item in error.errors(include_url=False):
        if item["type"] == "string_type" and isinstance(item["input"], dict) and item["loc"][-1:] == ("str",):
            continue  # the entry is a table instead of a name, and the mistakes in the table are listed anyway
        said, expected = _explain(item, entries)
        held = mistakes.setdefault(said, [])
        held += [expected] if expected and expected not in held else []
    listed = [
        f"{said}{', expected ' if expected else ''}{' or '.join(expected)}" for said, expected in mistakes.items()
    ]
    return InputError(f"{source}: {'; '.join(listed)}")


def say_plainly(scene: type, entries: Entries) -> None:
    """Wrap the constructor of a class of scenes, so that it raises the same messages as a wrong scene file."""
    original = scene.__init__  # type: ignore[misc]

    @functools.wraps(original)
    def checked(self: Any, *args: Any, **content: Any) -> None:
        if args:
            expected = "its entries by name, as Scene(**content); mf.parse_scene takes the content as a dict"
            raise wrong_kind("scene", args[0], expected, reader="mf.load_scene")
        try:
            original(self, **content)
        except ValidationError as error:
            raise plain(error, "scene", entries) from None

    scene.__init__ = checked  # type: ignore[misc]


def _explain(item: Any, entries: Entries) -> tuple[str, str]:
    """One mistake in plain words, with its place such as ``surface[1].start``; and what was expected there, or ""."""
    place, kind = "", ""
    for part in item["loc"]:
        if isinstance(part, int):
            place += f"[{part}]"
        elif part in entries.of_kind:
            kind = part
        elif not INTERNAL.fullmatch(part):
            place += f".{part}" if place else str(part)
    found = item["input"]
    if item["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return _unknown(place, str(item["loc"][-1]), kind, entries), ""
    if item["type"] in ("missing", "missing_argument", "missing_keyword_only_argument"):
        return f"{place or 'file'} is missing, add it", ""
    if item["type"] == "union_tag_invalid":
        return f"{place}.kind is {found.get('kind')!r}", f"one of {', '.join(entries.of_kind)}"
    if item["type"] == "union_tag_not_found":
        return f"{place}.kind is missing", f"one of {', '.join(entries.of_kind)}"
    if item["type"] == "value_error":
        return f"{place}: {item['ctx']['error']}" if place else str(item["ctx"]["error"]), ""
    if item["type"] in ("too_short", "too_long"):
        told = item["ctx"]
        bound = f"at least {told['min_length']}" if "min_length" in told else f"at most {told['max_length']}"
        return f"{place} has the length {told['actual_length']}, {in_message(found)}", bound
    if item["type"] == "tuple_type" and isinstance(found, dict):
        return f"{place} is a single table", f"a list of tables; write [[{place}]]"
    if place == "dimensions":
        return f"dimensions is {in_message(found)}", "2 or 3"
    message = "a table" if item["type"] == "dataclass_type" else item["msg"].removeprefix("Input should be ")
    return f"{place or 'file'} is {in_message(found)}", message


def _unknown(place: str, entry: str, kind: str, entries: Entries) -> str:
    """The message about an entry that is not known in its place, with what to do."""
    if entry in entries.known:
        owners = [owner for owner, held in entries.of_kind.items() if entry in held]
        if kind and owners:
            return f"{place}: kind {kind!r} has no {entry}; remove it, or take {' or '.join(owners)}"
        return f"{place} is not a known entry, though others have one; remove it"
    close = get_close_matches(entry, entries.known, n=1)
    return f"{place} is not a known entry, {f'did you mean {close[0]!r}?' if close else 'remove it'}"
