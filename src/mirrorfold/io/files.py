"""Files that are there whole or not at all."""

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
from mirrorfold.errors import InputError

clobber: ContextVar[bool] = ContextVar("clobber", default=True)
"""Whether files that are there may be overwritten; ``--no-clobber`` says no."""


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
        is one of the inputs or a file that the command has read (`files_read`), its name ends otherwise, or it is there
        and must not be overwritten.
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

    What was written is on the disk, not in its cache, before it gets its name.

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
    OSError
        If the disk is full or fails; what was there before stays.
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
        check_output(path)  # a device or a pipe may have come since
        os.replace(temporary, path)
        _sync(path.parent)
    except OSError as error:
        raise _named(error, temporary, path) from None
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def directory_written_whole(path: str | Path, *, replaces: Iterable[str] = ()) -> Iterator[Path]:
    """A temporary directory to write files to; they move to `path` when the block ends well, and replace what is there.

    New files are never found beside old ones, whenever the process ends: once the new ones are complete and on the
    disk, the temporary directory is renamed to say so; then the old ones are removed; then the new ones move. If the
    process is killed meanwhile, the next one of this user that writes to `path` goes on with that.

    Parameters
    ----------
    path : path
        Of the directory. It is made if need be; when the block fails, nothing is made and nothing changes.
    replaces : list of str
        Names of files that belong to older results, and go even if there are no new ones of these names.

    Yields
    ------
    Path
        An empty directory on the same file system.

    Raises
    ------
    InputError
        If nothing can be written there.
    OSError
        If the disk is full or fails; what was there before stays.
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
            temporary.rename(path)
            _sync(path.parent)
            return
        old = {*replaces, *(file.name for file in files)}
        for name in old:
            check_output(path / name)
        complete = path / (temporary.name + COMPLETE)
        (temporary / OLD_FILES).write_text("\n".join(sorted(old)), encoding="utf-8")
        (temporary / SIGNATURE).write_text(signature(complete.name) or "", encoding="utf-8")
        _sync_all([temporary / OLD_FILES, temporary / SIGNATURE])
        _sync(temporary)
        temporary.rename(complete)
    except OSError as error:
        raise _named(error, temporary, path) from None
    finally:
        remove(temporary)
    _replace_files(complete, _followed)


OLD_FILES = ".replaces"
"""In a directory whose files wait to replace others, the file that names these."""

SIGNATURE = ".signature"
"""In such a directory, the file that proves that a program of this user has made it."""


def clean_up(folder: Path) -> None:
    """Finish or remove what this user's killed processes have left in a folder.

    A folder may come from a stranger, with forged leftovers and links in it: what another user has made is left alone,
    and links are replaced, not followed.
    """
    for path in leftovers(folder):
        if path.suffix != COMPLETE:
            remove(path)
        elif _is_signed(path):
            with suppress(OSError, InputError):  # what is in its way there is no matter of the file to be written now
                _replace_files(path, lambda target: target)


def _is_signed(complete: Path) -> bool:
    """Whether a directory whose files wait to replace others was made by a program of this user."""
    with suppress(OSError, UnicodeDecodeError):
        return (complete / SIGNATURE).is_file() and is_signed(complete.name, (complete / SIGNATURE).read_text("utf-8"))
    return False


def _replace_files(complete: Path, place: Callable[[Path], Path]) -> None:
    """Remove the old files of the directory around this one, then move the files of this one there.

    The list of the old files goes with the last of them: whoever goes on later must not take new files for old ones.

    Parameters
    ----------
    complete : path
    place : callable
        What is to be removed or replaced for a path: where it leads to if it is a link, or the link itself.
    """
    listed = complete / OLD_FILES
    with held_signals(), suppress(FileNotFoundError):  # another process may be faster
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
"""Errors by which a system says that a disk, or the user's share of the disk, is full."""


def check_room(path: Path, size: int) -> None:
    """Refuse to begin a file that is larger than what is free.

    Parameters
    ----------
    path : path
        In a directory that is there.
    size : int [bytes]

    Raises
    ------
    OSError
        With what is needed and what is free.
    """
    total, _, free = shutil.disk_usage(path.parent)
    if total and size > free:  # some network disks know of no size at all
        raise OSError(errno.ENOSPC, f"needs {size / 1e9:.3g} GB of disk, and {free / 1e9:.3g} GB are free", str(path))


def _unwritable(path: Path, error: OSError) -> Exception:
    """What to raise where not even an empty file can be made: a full disk is no mistake of the input."""
    if error.errno in FULL:
        return OSError(error.errno, error.strerror, str(path))
    return InputError(f"{path}: cannot be written ({error.strerror}); choose another place")


def _named(error: OSError, temporary: Path, path: Path) -> OSError:
    """The error with the name that the user knows, in place of the temporary one."""
    name = str(error.filename or temporary)
    if error.errno is None or not name.startswith(str(temporary)):
        return error
    return OSError(error.errno, error.strerror, name.replace(str(temporary), str(path)))


def _sync_all(files: Sequence[Path]) -> None:
    """Wait until files are on the disk: a scan of thousands waits for all that the system writes, once."""
    if len(files) > MANY and hasattr(os, "sync"):
        os.sync()
        return
    for file in files:
        _sync(file)


MANY = 100
"""Files, each of which takes milliseconds to wait for."""


def _sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk.

    Raises
    ------
    OSError
        If the disk fails; of folders, some file systems know no such request.
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
    """The path, or a refusal where no file can ever have it, as when its name is too long."""
    path = path_of("path", path, "the path of what to write")
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass
    except (OSError, ValueError) as error:  # the latter of a name that holds a zero byte
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be written ({reason}); give another name") from None
    return path


def _followed(path: Path) -> Path:
    """Where a link leads to, whether something is there or not; any other path as it is."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def _move(source: Path, target: Path) -> None:
    """Put a file in the place of another; where that lies on another disk, by a copy beside it."""
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
    there = path.exists()
    for source in map(Path, inputs):
        if there and source.exists() and path.samefile(source):
            raise InputError(f"{path}: is the input itself and would be overwritten; give another name for the output")
