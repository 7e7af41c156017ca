"""Reading files safely: whether a regular file is there, and the text, JSON or TOML in it."""

from __future__ import annotations

import json
import os
import re
import stat
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from mirrorfold.common.arguments import path_of
from mirrorfold.errors import InputError

LARGEST_TEXT = 64 << 20
"""Largest text file that is read [bytes]: what a person writes, or a script writes for a person, is smaller."""

MOST_PARTS = 100
"""Largest number of parts of a TOML name such as ``a.b.c``: time and memory to read it grow with the square of it."""

DEEPEST = MOST_PARTS
"""Largest number of levels of lists and tables: a walk through many more exceeds Python's stack. Each part of a TOML
name is a level."""

_PART = r"""(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
"""One part of a TOML name: bare, or in quotes of either kind."""

_LONG_NAME = re.compile(rf"(?<![A-Za-z0-9_-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{MOST_PARTS}}}")
"""A TOML name of more than `MOST_PARTS` parts."""

files_read: ContextVar[set[Path] | None] = ContextVar("files_read", default=None)
"""Files that the running command has read, including those that other files name; None if nobody collects them."""


def check_file(path: str | Path, remedy: str) -> Path:
    """The path, if a regular file is there: opening a pipe would wait for ever, and a device may never end.

    Parameters
    ----------
    path : path
    remedy : str
        What to do, at the end of the message.

    Raises
    ------
    InputError
        If there is no file, or something else than a file, if the name is too long, or links lead in a circle.
    """
    path = path_of("path", path)
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError) as error:  # a ValueError if the name holds a zero byte
        missing = isinstance(error, FileNotFoundError | NotADirectoryError)
        what = "does not exist" if missing else f"cannot be read ({getattr(error, 'strerror', None) or error})"
        raise InputError(f"{path}: {what}; {remedy}") from None
    if not stat.S_ISREG(mode):
        what = "a directory" if stat.S_ISDIR(mode) else "no file but a device, a pipe or a socket"
        raise InputError(f"{path}: is {what}; {remedy}")
    read = files_read.get()
    if read is not None:
        read.add(path.absolute())
    return path


def read_head(path: Path, size: int) -> bytes:
    """The first `size` bytes of a file, or all if there are fewer.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    try:
        with path.open("rb") as file:
            return file.read(size)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path and its permissions") from None


def read_text(path: str | Path, remedy: str) -> str:
    """The text in a file.

    Raises
    ------
    InputError
        As `check_file`, and if the file may not be read, is too large, or holds no text in UTF-8.
    """
    try:
        size = check_file(path, remedy).stat().st_size
        if size > LARGEST_TEXT:
            raise InputError(f"{path}: has {size} bytes, expected a text of at most {LARGEST_TEXT}; {remedy}")
        return Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {remedy}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is no text ({error.reason}); {remedy}") from None


def parsed(text: str, kind: str, source: str, remedy: str) -> Any:
    """The values in a JSON or TOML text.

    Parameters
    ----------
    text : str
    kind : {"JSON", "TOML"}
    source : str
        Name of the file in the message.
    remedy : str
        What to do, at the end of the message.

    Raises
    ------
    InputError
        If the text is not valid, has more than `DEEPEST` levels, or holds a number of thousands of digits, or a name of
        more than `MOST_PARTS` parts.
    """
    try:
        if kind == "JSON":
            return not_too_deep(json.loads(text))
        if _LONG_NAME.search(text) is None:
            return not_too_deep(tomllib.loads(text))
        reason = f"a name has more than {MOST_PARTS} parts, joined by dots"
    except RecursionError:
        reason = "it is nested too deeply"
    except ValueError as error:  # of both formats, and of numbers that are too long
        reason = str(error).splitlines()[0][:150]
    raise InputError(f"{source}: is not valid {kind} ({reason}); {remedy}")


def not_too_deep(value: Any) -> Any:
    """The value, whose lists and tables are nested in `DEEPEST` levels at most.

    Raises
    ------
    RecursionError
        If there are more levels.
    """
    level = [value]
    for _ in range(DEEPEST + 1):
        level = [one for one in level if isinstance(one, list | dict)]
        if not level:
            return value
        level = [item for one in level for item in (one.values() if isinstance(one, dict) else one)]
    raise RecursionError


_outside: ContextVar[list[str] | None] = ContextVar("_outside", default=None)
"""What `named_file` has found outside of the folder of the file that names it, in words for a message."""


@contextmanager
def quoting_nothing_outside() -> Iterator[None]:
    """Files are read that may name further files, by `named_file`.

    A file from a stranger may name any file on the machine, and an error message may quote its lines, headings or
    numbers, whichever step finds the error. So if a file outside of the folder was named in the block, every error in
    the block is replaced by one that quotes nothing.

    Raises
    ------
    InputError
        In place of an error in the block.
    """
    names: list[str] = []
    token = _outside.set(names)
    try:
        yield
    except Exception:  # a mistake of ours may quote as much as a refusal
        if not names:
            raise
        raise InputError(f"{names[-1]} and cannot be used; copy it there to read what is wrong with it") from None
    finally:
        _outside.reset(token)


def names_outside() -> bool:
    """Whether a file outside of the folder was named, of which nothing must be quoted, not in warnings either."""
    return bool(_outside.get())


def named_file(owner: Path, name: str, entry: str) -> Path:
    """The path of a file that another file names relative to its own folder; in a block `quoting_nothing_outside`.

    Parameters
    ----------
    owner : path
        Path of the file that names the other file.
    name : str
        The name as it stands there.
    entry : str
        The entry in which it stands there, for messages.

    Raises
    ------
    InputError
        If it is no name of a file.
    """
    path = owner.parent / name
    try:
        inside = Path(os.path.realpath(path)).is_relative_to(os.path.realpath(owner.parent))
    except (OSError, ValueError):  # a ValueError if the name holds a zero byte
        raise InputError(f"{owner}: {entry} is {name!r}, which is no name of a file; correct it") from None
    names = _outside.get()
    if not inside and names is not None:
        names.append(f"{owner}: {entry} is {name!r}, which is outside of the folder of {owner.name}")
    return path
