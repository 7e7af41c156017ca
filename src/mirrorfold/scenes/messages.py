"""Mistakes in scenes, said in plain words with their places."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError

from mirrorfold.common.arguments import shown
from mirrorfold.errors import InputError


def plain(error: ValidationError, source: str, kinds: Sequence[str], fields: Sequence[str]) -> InputError:
    """All mistakes in one sentence; `kinds` and `fields` are the surfaces and the entries that there are."""
    mistakes = [_explain(item, kinds, fields) for item in error.errors(include_url=False)]
    return InputError(f"{source}: {'; '.join(mistakes)}")


def say_plainly(scene: type, kinds: Sequence[str], fields: Sequence[str]) -> None:
    """Have a class of scenes, called with wrong arguments, say so in the same words as for a file."""
    original = scene.__init__  # type: ignore[misc]

    @functools.wraps(original)
    def checked(self: Any, *args: Any, **content: Any) -> None:
        try:
            original(self, *args, **content)
        except ValidationError as error:
            raise plain(error, "scene", kinds, fields) from None

    scene.__init__ = checked  # type: ignore[misc]


def _explain(item: Any, kinds: Sequence[str], fields: Sequence[str]) -> str:
    """One mistake in plain words, with its place such as ``surface[1].start``."""
    place = ""
    for part in item["loc"]:
        if isinstance(part, int):
            place += f"[{part}]"
        elif part not in kinds:
            place += f".{part}" if place else str(part)
    place = place or "file"
    found = item["input"]
    if item["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        close = get_close_matches(str(item["loc"][-1]), fields, n=1)
        hint = f"did you mean {close[0]!r}?" if close else "remove it"
        return f"{place} is not a known entry, {hint}"
    if item["type"] in ("missing", "missing_argument", "missing_keyword_only_argument"):
        return f"{place} is missing, add it"
    if item["type"] == "union_tag_invalid":
        return f"{place}.kind is {found.get('kind')!r}, expected one of {', '.join(kinds)}"
    if item["type"] == "union_tag_not_found":
        return f"{place}.kind is missing, expected one of {', '.join(kinds)}"
    if item["type"] == "value_error":
        return f"{place}: {item['ctx']['error']}"
    message = item["msg"].removeprefix("Input should be ")
    return f"{place} is {shown(found)}, expected {message}"
