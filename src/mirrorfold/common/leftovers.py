"""Names of temporary files that tell which process made them, so that the files of killed processes can be removed."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import secrets
import shutil
import time
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

OLD = 7 * 24 * 3600.0
"""Age [s] from which a temporary file of another machine counts as left behind: its process cannot be asked for."""

NAME = re.compile(r"\.?mirrorfold-([0-9a-f]{8})-([0-9]+)-\w{8}(\.\w+)?")
"""Name of a temporary file: machine, process, a random word, and the suffix."""


COMPLETE = ".complete"
"""Suffix of a temporary directory whose files wait to replace others."""


def temporary_prefix() -> str:
    """How the names of this process's temporary files begin; a word of eight letters follows."""
    return f"mirrorfold-{_machine()}-{os.getpid()}-"


def temporary_name(suffix: str = "") -> str:
    """A name for a hidden temporary file or folder of this process, which nothing else has."""
    return f".{temporary_prefix()}{secrets.token_hex(4)}{suffix}"


def leftovers(folder: Path) -> list[Path]:
    """Temporary files in a folder of this user's ended processes; those of other machines count by their age, `OLD`."""
    found = []
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            name = NAME.fullmatch(entry.name)
            if name is None or entry.is_symlink() or not _is_own(entry.stat()):
                continue
            old = time.time() - entry.stat().st_mtime > OLD
            if not _lives(int(name[2])) if name[1] == _machine() else old:
                found.append(Path(entry.path))
    return found


def _is_own(state: os.stat_result) -> bool:
    """Whether a file belongs to this user: in a folder that all may write to, a name proves nothing."""
    return os.name != "posix" or state.st_uid == os.getuid()


def remove_leftovers(folder: Path) -> None:
    """Remove the `leftovers` in a folder, as far as this user may, but not complete results that wait there."""
    for path in leftovers(folder):
        if path.suffix != COMPLETE:
            remove(path)


def remove(path: Path) -> None:
    """Remove a file, or a folder with its content, as far as this user may.

    A folder is renamed first: if the process is killed midway, the half-empty folder must not pass for a whole one.
    """
    with suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            path = path.rename(path.with_name(temporary_name()))
            shutil.rmtree(path)
        else:
            path.unlink()


@lru_cache(maxsize=1)
def _machine() -> str:
    """A word for the space in which process numbers are unique: this machine, and the container on it."""
    container = ""
    with suppress(OSError):
        container = os.readlink("/proc/self/ns/pid")
    return hashlib.sha256(f"{platform.node()} {container}".encode()).hexdigest()[:8]


def _lives(process: int) -> bool:
    """Whether a process of that number runs; True on systems where asking for a process would end it."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # it runs, but belongs to another user
        return True
    return True
