"""Reads small TOML and JSON files that people write, and reports all mistakes at once with their places."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError

from mirrorfold.common.arguments import in_message
from mirrorfold.common.reading import LARGEST_TEXT, parsed
from mirrorfold.errors import InputError
from mirrorfold.io.readers.contents import read_bytes

Model = TypeVar("Model", bound=BaseModel)


def read_written(path: Path) -> dict[str, Any]:
    """The object in a TOML or JSON file.

    Raises
    ------
    InputError
        If the file cannot be read, or is not valid; the message tells the line.
    """
    raw = read_bytes(path, growth=20.0)
    if len(raw) > LARGEST_TEXT:
        raise InputError(f"{path}: has {len(raw)} bytes, expected a description of at most {LARGEST_TEXT}; shorten it")
    kind = "JSON" if path.suffix.lower() == ".json" else "TOML"
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not valid {kind} ({error}); correct it") from None
    found = parsed(text, kind, str(path), "correct it")
    if not isinstance(found, dict):
        return {"file": found}
    return found


def validated(model: type[Model], content: dict[str, Any], source: str) -> Model:
    """Check the content, in which arrays of NumPy may stand for lists, and return it as a model.

    Raises
    ------
    InputError
        If the content is not valid; the message tells every mistake and its place.
    """
    try:
        return model.model_validate(_plain(content))
    except ValidationError as error:
        mistakes = dict.fromkeys(_explain(item, _fields(model)) for item in error.errors(include_url=False))
        raise InputError(f"{source}: {'; '.join(mistakes)}") from None


def _plain(value: Any) -> Any:
    """Content in which rows of NumPy, and places (n, 2) or (n, 3), are lists, as in a file."""
    if isinstance(value, np.ndarray | np.generic) and (value.ndim < 2 or value.shape[1:] in ((2,), (3,))):
        return value.tolist()
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value


def _fields(model: type[BaseModel]) -> list[str]:
    """Names of the entries of a model and of the models within it."""
    names: list[str] = []
    for name, field in model.model_fields.items():
        names.append(name)
        for inner in _models(field.annotation):
            names += _fields(inner)
    return names


def _models(annotation: Any) -> Iterable[type[BaseModel]]:
    """Models in a type such as ``list[Model] | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from _models(part)


def _explain(item: Any, fields: list[str]) -> str:
    """A mistake that pydantic found, in plain words, with its place such as ``tx.position``."""
    place = ""
    for part in item["loc"]:
        if isinstance(part, int):
            place += f"[{part}]"
        elif part.isidentifier() and part not in ("str", "float", "int") and not part[:1].isupper():
            place += f".{part}" if place else part
    place = place or "file"
    if item["type"] == "extra_forbidden":
        close = get_close_matches(str(item["loc"][-1]), set(fields) - {item["loc"][-1]}, n=1)
        return f"{place} is not a known entry, " + (f"did you mean {close[0]!r}?" if close else "remove it")
    if item["type"] == "missing":
        return f"{place} is missing, add it"
    if item["type"] == "value_error":
        return f"{place}: {item['ctx']['error']}"
    return f"{place} is {in_message(item['input'])}, expected {item['msg'].removeprefix('Input should be ')}"
