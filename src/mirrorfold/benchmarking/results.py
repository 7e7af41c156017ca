"""The file of results: one line of JSON for each scene and method, written as it is done."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from mirrorfold import __version__
from mirrorfold.benchmarking.scenes import Line
from mirrorfold.errors import InputError
from mirrorfold.io.files import check_output, written_whole

FILE = "scenes.jsonl"
"""Its name in the folder of a benchmark."""

Key = tuple[str, str, int, str]

_LINE: TypeAdapter[Line] = TypeAdapter(Line)


def key(line: Line) -> Key:
    """What a line is of: family, radar, seed and method."""
    return line.family, line.radar, line.seed, line.method


def read_lines(path: Path) -> dict[Key, Line]:
    """The lines of a file, the last of each scene and method; none where there is no file.

    A last line that is not whole is left out: the run that wrote it was killed.

    Raises
    ------
    InputError
        If another line is none of a benchmark, or the file cannot be read.
    """
    try:
        written = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); expected the lines of a benchmark") from None
    found = {}
    lines = written.split("\n")
    for number, text in enumerate(lines, 1):
        if not text.strip():
            continue
        try:
            line = _LINE.validate_json(text)
        except ValidationError:
            if number == len(lines):
                continue
            raise InputError(
                f"{path}: line {number} is no result of `mirrorfold benchmark`; give another folder, or remove the file"
            ) from None
        found[key(line)] = line
    return found


def open_results(path: Path) -> dict[Key, Line]:
    """The lines that a run may go on from, in a file that ends with a whole line.

    Raises
    ------
    InputError
        If the file is none of a benchmark, or of another version of this program, or cannot be written.
    """
    check_output(path)
    found = read_lines(path)
    others = {line.version for line in found.values()} - {__version__}
    if others:
        raise InputError(
            f"{path}: holds results of mirrorfold {', '.join(sorted(others))}, and this is {__version__}; "
            "give another folder"
        )
    if path.exists():
        with written_whole(path) as temporary:
            temporary.write_text("".join(_text(line) for line in found.values()), encoding="utf-8")
    return found


def append(path: Path, lines: Iterable[Line]) -> None:
    """Write lines at the end of the file, at once and to the disk; only what is killed meanwhile may divide one."""
    with path.open("ab") as file:
        file.write("".join(map(_text, lines)).encode())
        file.flush()
        os.fsync(file.fileno())


def _text(line: Line) -> str:
    return json.dumps(line) + "\n"
