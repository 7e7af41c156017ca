"""Writing of files and directories completely or not at all, so that a failure leaves no half-written result."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from contextvars import ContextVar
from pathlib import Path

from mirrorfold.common.arguments import path_of
from mirrorfold.common.cache import is_signed, signature
from mirrorfold.common.leftovers import COMPLETE, leftovers, remove, temporary_name
from mirrorfold.common.reading import files_read
from mirrorfold.common.signals import held_signals
from mirrorfold.common.written import note_written
from mirrorfold.errors import InputError

may_overwrite: ContextVar[bool] = ContextVar("may_overwrite", default=True)
"""Whether existing files may be overwritten; false with ``--no-clobber``."""


def check_output(path: str | Path, *, inputs: Iterable[str | Path] = (), suffixes: Sequence[str] = ()) -> Path:
    """Check that a file can be written at a path, and return the path.

    Parameters
    ----------
    path : path
        Path of the file to write. A link stands for the file to which it leads.
    inputs : paths
        Files that must not be overwritten.
    suffixes : list of str
        Suffixes that the name may have, such as ``.html``; by default any.

    Raises
    ------
    InputError
        If something other than a file is there (a folder, a device, a pipe), the directory is missing or read-only, the
        file is one of the inputs or one that the command has read (`files_read`), its suffix is another one, or it
        exists and must not be overwritten.
    """
    path = _check_name(path)
    if suffixes and path.suffix.lower() not in suffixes:
        raise InputError(f"{path}: has the suffix {path.suffix!r}, expected {' or '.join(suffixes)}; rename it")
    if path.is_dir():
        raise InputError(f"{path}: is a directory; give the path of the file to write")
    target = _followed(path)
    if target.is_symlink():
        raise InputError(f"{path}: is a link that leads to itself; give the path of a file")
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is a device, a pipe or a socket, and would be replaced; give the path of a file")
    _check_parent(path)
    if target != path:
        _check_parent(target)
    _check_inputs(path, [*inputs, *(files_read.get() or ())])
    if not may_overwrite.get() and os.path.lexists(path):
        raise InputError(f"{path}: is there already, and --no-clobber is given; give another name, or move it away")
    return path


def check_output_directory(path: str | Path, *, names: Iterable[str], inputs: Iterable[str | Path] = ()) -> Path:
    """Check that a directory with files of these names can be written at a path, and return the path.

    Parameters
    ----------
    path : path
        Path of the directory, which need not exist; its parent must.
    names : list of str
        Names of the files.
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
def written_atomically(path: str | Path) -> Iterator[Path]:
    """A temporary path to write to, which is renamed to `path` if the block succeeds, and removed if it fails.

    The content is on the disk, not only in its cache, before the file is renamed.

    Parameters
    ----------
    path : path

    Yields
    ------
    Path
        A path in the same directory and with the same suffix, at which nothing exists yet.

    Raises
    ------
    InputError
        If the file cannot be written.
    OSError
        If the disk is full or fails; an older file stays as it was.
    """
    path = _followed(check_output(path))
    clean_up(path.parent)
    temporary = path.with_name(temporary_name(path.suffix))
    try:
        temporary.touch(exist_ok=False)
        temporary.unlink()
    except OSError as error:
        raise _unwritable(path, error) from None
    try:
        yield temporary
        _sync(temporary)
        check_output(path)  # a device or a pipe may have appeared meanwhile
        with held_signals():
            os.replace(temporary, path)
            _sync(path.parent)
            note_written(path)
    except OSError as error:
        raise _named(error, temporary, path) from None
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def directory_written_atomically(path: str | Path, *, replaces: Iterable[str] = ()) -> Iterator[Path]:
    """A temporary directory to write files to, which move to `path` if the block succeeds, and replace older files.

    New files are never mixed with old ones, even if the process is killed. Once the new files are complete and on the
    disk, the temporary directory is renamed to mark this; then the old files are removed; then the new files move. If
    the process is killed in between, the next process of this user that writes to `path` completes the move.

    Parameters
    ----------
    path : path
        Path of the directory, which is made if it does not exist. If the block fails, nothing is made or changed.
    replaces : list of str
        Names of files that belong to older results; they are removed even if there are no new files of these names.

    Yields
    ------
    Path
        An empty directory on the same file system.

    Raises
    ------
    InputError
        If the directory cannot be written.
    OSError
        If the disk is full or fails; older files stay as they were.
    """
    path = _followed(check_output_directory(path, names=()).absolute())
    place = path if path.exists() else path.parent
    clean_up(place)
    temporary = place / temporary_name()
    try:
        temporary.mkdir()
    except OSError as error:
        raise _unwritable(path, error) from None
    try:
        yield temporary
        files = sorted(temporary.iterdir())
        _sync_all(files)
        if not path.exists():
            _sync(temporary)
            with held_signals():
                temporary.rename(path)
                _sync(path.parent)
                note_written(path)
            return
        old = {*replaces, *(file.name for file in files)}
        for name in old:
            check_output(path / name)
        complete = path / (temporary.name + COMPLETE)
        (temporary / OLD_FILES).write_text("\n".join(sorted(old)), encoding="utf-8")
        (temporary / SIGNATURE).write_text(signature(complete.name) or "", encoding="utf-8")
        _sync_all([temporary / OLD_FILES, temporary / SIGNATURE])
        _sync(temporary)
        with held_signals():
            temporary.rename(complete)
            _replace_files(complete, _followed)
            note_written(path)
    except OSError as error:
        raise _named(error, temporary, path) from None
    finally:
        remove(temporary)


OLD_FILES = ".replaces"
"""File in a directory of complete new files, which lists the old files that they replace."""

SIGNATURE = ".signature"
"""File in such a directory, which proves that a process of this user has made it."""


def clean_up(folder: Path) -> None:
    """Complete or remove what killed processes of this user have left in a folder.

    A folder may come from a stranger, with forged leftovers and links in it. So leftovers of other users are not
    touched, and links are replaced, not followed.
    """
    for path in leftovers(folder):
        if path.suffix != COMPLETE:
            remove(path)
        elif _is_signed(path):
            with suppress(OSError, InputError):  # the file to be written now can do without
                _replace_files(path, lambda target: target)


def _is_signed(complete: Path) -> bool:
    """Whether a directory of complete new files was made by a process of this user."""
    with suppress(OSError, UnicodeDecodeError):
        return (complete / SIGNATURE).is_file() and is_signed(complete.name, (complete / SIGNATURE).read_text("utf-8"))
    return False


def _replace_files(complete: Path, place: Callable[[Path], Path]) -> None:
    """Remove the old files from the parent of a directory of complete new files, then move the new files there.

    The list of the old files is removed right after them, so that a process that goes on later does not take new files
    for old ones.

    Parameters
    ----------
    complete : path
        The directory of complete new files.
    place : callable
        Returns what is to be removed or replaced at a path: the target of a link, or the link itself.
    """
    listed = complete / OLD_FILES
    with held_signals():
        with suppress(FileNotFoundError):  # another process may be faster
            if listed.exists():
                for name in listed.read_text(encoding="utf-8").splitlines():
                    place(complete.parent / Path(name).name).unlink(missing_ok=True)
                _sync(complete.parent)
                listed.unlink()
                _sync(complete)
            for file in sorted(complete.iterdir()):
                if file.name != SIGNATURE:
                    _move(file, place(complete.parent / file.name))
            _sync(complete.parent)
        remove(complete)


FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Error numbers which mean that a disk, or the user's share of it, is full."""


def check_room(path: Path, size: int) -> None:
    """Refuse to write a file that is larger than the free space of its disk.

    Parameters
    ----------
    path : path
        A path in an existing directory.
    size : int [bytes]

    Raises
    ------
    OSError
        The message tells the needed and the free space.
    """
    total, _, free = shutil.disk_usage(path.parent)
    if total and size > free:  # some network disks report a size of zero
        raise OSError(errno.ENOSPC, f"needs {size / 1e6:.3g} MB of disk, and {free / 1e6:.3g} MB are free", str(path))


def _unwritable(path: Path, error: OSError) -> Exception:
    """The error to raise where not even an empty file can be made: a full disk is no mistake of the input."""
    if error.errno in FULL:
        return OSError(error.errno, error.strerror, str(path))
    return InputError(f"{path}: cannot be written ({error.strerror}); choose another place")


def _named(error: OSError, temporary: Path, path: Path) -> OSError:
    """The error with the temporary path in it replaced by the path that the user knows."""
    name = str(error.filename or temporary)
    if error.errno is None or not name.startswith(str(temporary)):
        return error
    for known in (f"{temporary}{COMPLETE}", str(temporary)):
        name = name.replace(known, str(path))
    return OSError(error.errno, error.strerror, name)


def _sync_all(files: Sequence[Path]) -> None:
    """Wait until files are on the disk; for many files, such as those of a scan, for the whole system at once."""
    if len(files) > MANY and hasattr(os, "sync"):
        os.sync()
        return
    for file in files:
        _sync(file)


MANY = 100
"""Largest number of files that are waited for one by one; each takes milliseconds."""


def _sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk.

    Raises
    ------
    OSError
        If the disk fails. For folders errors are ignored, as some file systems cannot wait for these.
    """
    folder = path.is_dir()
    if folder and os.name != "posix":
        return
    handle = os.open(path, os.O_RDONLY if folder else os.O_RDWR)
    try:
        with suppress(OSError) if folder else nullcontext():
            os.fsync(handle)
    finally:
        os.close(handle)


def _check_name(path: str | Path) -> Path:
    """The path; one that no file can have is refused, such as one with too long a name."""
    path = path_of("path", path, "the path of what to write")
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass
    except (OSError, ValueError) as error:  # ValueError: the name holds a zero byte
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be written ({reason}); give another name") from None
    return path


def _followed(path: Path) -> Path:
    """The target of a link, whether it exists or not; any other path as it is."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def _move(source: Path, target: Path) -> None:
    """Move a file to a target, which it replaces; if the target is on another disk, by a copy beside it."""
    try:
        os.replace(source, target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        with written_atomically(target) as temporary:
            shutil.copyfile(source, temporary)


def _check_parent(path: Path) -> None:
    """Refuse a path whose directory is missing or read-only."""
    parent = path.absolute().parent
    if not parent.is_dir():
        raise InputError(f"{path}: the directory {path.parent} does not exist; make it first")
    if not path.is_dir() and not os.access(parent, os.W_OK):
        raise InputError(f"{path}: the directory {path.parent} is read-only; choose another place")


def _check_inputs(path: Path, inputs: Iterable[str | Path]) -> None:
    """Refuse a path that is one of the inputs, also under another name; one that is not there is an output, too."""
    there = path.exists()
    for source in map(Path, inputs):
        if not there and not source.exists() and os.path.realpath(path) == os.path.realpath(source):
            raise InputError(f"{path}: is named for two outputs; give each another name")
        if there and source.exists() and path.samefile(source):
            raise InputError(f"{path}: is the input itself and would be overwritten; give another name for the output")
