"""Files that are there whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from mirrorfold.errors import InputError

clobber: ContextVar[bool] = ContextVar("clobber", default=True)
"""Whether files that are there may be overwritten; ``--no-clobber`` says no."""


LONGEST_STEM = 40
"""Characters of a file's name that its temporary name repeats; all of them could make that name too long."""


def check_output(path: str | Path, *, inputs: Iterable[str | Path] = (), suffixes: Sequence[str] = ()) -> Path:
    """The path, if a file can be written there.

    Parameters
    ----------
    path : path
        Of the file to be written. A link stands for the file that it leads to.
    inputs : paths
        Files that must not be overwritten.
    suffixes : list of str
        How the name may end, such as ``.html``; any way by default.

    Raises
    ------
    InputError
        If something else than a file is there (a folder, a device, a pipe), its directory is missing or read-only, it
        is one of the inputs, its name ends otherwise, or it is there and must not be overwritten.
    """
    path = _check_name(path)
    if suffixes and path.suffix.lower() not in suffixes:
        raise InputError(f"{path}: has the suffix {path.suffix!r}, expected {' or '.join(suffixes)}; rename it")
    if path.is_dir():
        raise InputError(f"{path}: is a directory; give the path of the file to write")
    target = _followed(path)
    if target.exists() and not target.is_file():
        raise InputError(f"{path}: is a device, a pipe or a socket, and would be replaced; give the path of a file")
    _check_parent(path)
    if target != path:
        _check_parent(target)
    _check_inputs(path, inputs)
    if not clobber.get() and os.path.lexists(path):
        raise InputError(f"{path}: is there already, and --no-clobber is given; give another name, or move it away")
    return path


def check_output_directory(path: str | Path, *, names: Iterable[str], inputs: Iterable[str | Path] = ()) -> Path:
    """The path, if a directory with files of these names can be written there.

    Parameters
    ----------
    path : path
        Of the directory; need not exist, its parent must.
    names : list of str
        Of the files.
    inputs : paths
        Files that must not be overwritten.

    Raises
    ------
    InputError
        If the path is a file, cannot be made, or one of the files cannot be written (see `check_output`).
    """
    path = _check_name(path)
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file; give the path of a directory")
    _check_parent(_followed(path))
    if path.is_dir() and not os.access(path, os.W_OK):
        raise InputError(f"{path}: is read-only; choose another directory")
    for name in names if path.is_dir() else ():
        check_output(path / name, inputs=inputs)
    return path


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """A temporary path to write to, renamed to `path` when the block ends well and removed when it does not.

    Parameters
    ----------
    path : path

    Yields
    ------
    Path
        In the same directory and with the same suffix; nothing is there yet.

    Raises
    ------
    InputError
        If nothing can be written there.
    """
    path = _followed(check_output(path))
    temporary = path.with_name(f".{path.stem[:LONGEST_STEM]}.{secrets.token_hex(4)}{path.suffix}")
    try:
        temporary.touch(exist_ok=False)
        temporary.unlink()
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); choose another place") from None
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def directory_written_whole(path: str | Path) -> Iterator[Path]:
    """A temporary directory to write files to; they move to `path` when the block ends well.

    Parameters
    ----------
    path : path
        Of the directory. It is made if need be; when the block fails, nothing is made and nothing changes.

    Yields
    ------
    Path
        An empty directory on the same file system.

    Raises
    ------
    InputError
        If nothing can be written there.
    """
    path = _followed(check_output_directory(path, names=()).absolute())
    place = path if path.exists() else path.parent
    temporary = place / f".{path.name[:LONGEST_STEM]}.{secrets.token_hex(4)}"
    try:
        temporary.mkdir()
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); choose another place") from None
    try:
        yield temporary
        if not path.exists():
            temporary.rename(path)
            return
        files = sorted(temporary.iterdir())
        for file in files:
            check_output(path / file.name)
        for file in files:
            _move(file, path / file.name)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _check_name(path: str | Path) -> Path:
    """The path, or a refusal where no file can ever have it: its name is too long, or links lead in a circle."""
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass
    except (OSError, ValueError) as error:  # the latter of a name that holds a zero byte
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be written ({reason}); give another name") from None
    return Path(path)


def _followed(path: Path) -> Path:
    """Where a link leads to, whether something is there or not; any other path as it is."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def _move(source: Path, target: Path) -> None:
    """Put a file in the place of another; where that is a link to another disk, by a copy beside its end."""
    target = _followed(target)
    try:
        os.replace(source, target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        with written_whole(target) as temporary:
            shutil.copyfile(source, temporary)


def _check_parent(path: Path) -> None:
    """Refuse a path whose directory is missing or read-only."""
    parent = path.absolute().parent
    if not parent.is_dir():
        raise InputError(f"{path}: the directory {path.parent} does not exist; make it first")
    if not path.is_dir() and not os.access(parent, os.W_OK):
        raise InputError(f"{path}: the directory {path.parent} is read-only; choose another place")


def _check_inputs(path: Path, inputs: Iterable[str | Path]) -> None:
    """Refuse a path that is one of the inputs, under whatever name."""
    for source in map(Path, inputs):
        if path.exists() and source.exists() and path.samefile(source):
            raise InputError(f"{path}: is the input itself and would be overwritten; give another name for the output")
