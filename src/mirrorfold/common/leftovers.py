"""Names of temporary files that say who made them, so that what a killed process leaves is found and removed."""

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
"""Age [s] at which a temporary file counts as left by a process that cannot be asked, on another machine."""

NAME = re.compile(r"\.?mirrorfold-([0-9a-f]{8})-([0-9]+)-\w{8}(\.\w+)?")
"""Machine, process and a random word, then the suffix."""


COMPLETE = ".complete"
"""Suffix of a temporary directory whose files wait to replace others."""


def temporary_prefix() -> str:
    """How the names of this process's temporary files begin; a word of eight letters follows."""
    return f"mirrorfold-{_machine()}-{os.getpid()}-"


def temporary_name(suffix: str = "") -> str:
    """A name for a hidden temporary file or folder of this process, which nothing else has."""
    return f".{temporary_prefix()}{secrets.token_hex(4)}{suffix}"


def leftovers(folder: Path) -> list[Path]:
    """What processes of this user that live no more have left in a folder: by number, on other machines by age."""
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
    """Whether a file is this user's: in a folder that all may write to, names prove nothing."""
    return os.name != "posix" or state.st_uid == os.getuid()


def remove_leftovers(folder: Path) -> None:
    """Remove what killed processes have left in a folder, as far as this user may; not results that wait there."""
    for path in leftovers(folder):
        if path.suffix != COMPLETE:
            remove(path)


def remove(path: Path) -> None:
    """Remove a file or a folder with all that is in it, as far as this user may.

    A folder is renamed first: one that is half empty, because the process was killed, would pass for a whole one.
    """
    with suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            path = path.rename(path.with_name(temporary_name()))
            shutil.rmtree(path)
        else:
            path.unlink()


@lru_cache(maxsize=1)
def _machine() -> str:
    """A word for what numbers the processes: this machine, and this container on it."""
    container = ""
    with suppress(OSError):
        container = os.readlink("/proc/self/ns/pid")
    return hashlib.sha256(f"{platform.node()} {container}".encode()).hexdigest()[:8]


def _lives(process: int) -> bool:
    """Whether a process of that number runs; where that cannot be asked without ending it, yes."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # it runs for another user
        return True
    return True
