"""The file of results: one line of JSON for each scene and method, written as soon as it is done."""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from mirrorfold import __version__
from mirrorfold.benchmarking.scenes import Line
from mirrorfold.errors import InputError
from mirrorfold.io.files import check_output, written_atomically

FILE = "scenes.jsonl"
"""Name of the file of results in the folder of a benchmark."""

DIGEST = "sha256"
"""Last item of a line, the digest of all other items."""

Key = tuple[str, str, int, str]
"""Family, radar, seed and method."""

_LINE: TypeAdapter[Line] = TypeAdapter(Line)


def key(line: Line) -> Key:
    """What identifies a line: family, radar, seed and method."""
    return line.family, line.radar, line.seed, line.method


def read_lines(path: Path) -> dict[Key, Line]:
    """The lines of a file, the last one for each scene and method; none if there is no file.

    An incomplete last line is left out: the run that wrote it was killed. Lines without a digest are accepted.

    Raises
    ------
    InputError
        If any other line is no result of a benchmark or was changed after it was written, or the file cannot be read.
    """
    found = {}
    texts = _texts(path)
    for number, text in enumerate(texts, 1):
        if not text.strip():
            continue
        line, sealed = _parsed(text)
        if line is None and number == len(texts):
            continue
        if line is None:
            raise InputError(
                f"{path}: line {number} is no result of `mirrorfold benchmark`; give another folder, or remove the file"
            )
        if sealed is False:
            raise InputError(
                f"{path}: line {number} has changed since it was written; remove it, or run the benchmark again, which "
                "replaces it"
            )
        found[key(line)] = line
    return found


def open_results(path: Path) -> dict[Key, Line]:
    """The lines of an earlier run that a run can build on; the file is cleaned, so that new lines can be appended.

    Lines that are damaged, changed or without a digest are removed, with a warning.

    Raises
    ------
    InputError
        If the file has lines but no intact one of a benchmark, if one is of another version of this program, or the
        file cannot be written.
    """
    check_output(path)
    parsed = [_parsed(text) for text in _texts(path) if text.strip()]
    found = {key(line): line for line, sealed in parsed if line is not None and sealed}
    if parsed and not found:
        raise InputError(f"{path}: holds no whole result of `mirrorfold benchmark`; give another folder, or remove it")
    others = {line.version for line in found.values()} - {__version__}
    if others:
        raise InputError(
            f"{path}: holds results of mirrorfold {', '.join(sorted(others))}, and this is {__version__}; "
            "give another folder"
        )
    bad = sum(not sealed for _, sealed in parsed)
    if bad:
        warnings.warn(f"{path}: {bad} of {len(parsed)} lines are damaged, and are made again", stacklevel=2)
    if path.exists():
        with written_atomically(path) as temporary:
            temporary.write_text("".join(_text(line) for line in found.values()), encoding="utf-8")
    return found


def _texts(path: Path) -> list[str]:
    """The lines of text of a file; none if there is no file."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").split("\n")
    except FileNotFoundError:
        return []
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error}); expected the lines of a benchmark") from None


def append(path: Path, lines: Iterable[Line]) -> None:
    """Append lines to the file and flush them to the disk; only a process killed meanwhile leaves half a line."""
    with path.open("ab") as file:
        file.write("".join(map(_text, lines)).encode())
        file.flush()
        os.fsync(file.fileno())


def _text(line: Line) -> str:
    """The text of a line, with the digest of its other items as the last item."""
    return json.dumps({**line, DIGEST: _digest(line)}) + "\n"


def _parsed(text: str) -> tuple[Line | None, bool | None]:
    """A line, or None if the text is none of a benchmark; and whether its digest fits, or None if it has no digest."""
    try:
        items = json.loads(text)
        digest = items.pop(DIGEST, None)
        line = _LINE.validate_json(json.dumps(items))
    except (ValueError, AttributeError, TypeError, RecursionError):  # pydantic's errors are ValueErrors
        return None, False
    return line, None if digest is None else digest == _digest(items)


def _digest(items: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(items).encode()).hexdigest()
