"""Outputs of verbs: they are checked before the work begins, and overwritten files are reported at the end."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from mirrorfold.cli.terminal import remark
from mirrorfold.errors import InputError

NO_CLOBBER = inspect.Parameter(
    "no_clobber",
    inspect.Parameter.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[bool, Parameter(help="Refuse to overwrite a file that is there.")],
)
"""The option ``--no-clobber``."""


def required(output: Path | None, example: str) -> Path:
    """The output of a verb that needs one.

    Parameters
    ----------
    output : path, optional
    example : str
        Example for the message: the name of a file with a suffix, or of a folder without.

    Raises
    ------
    InputError
        If no output is given.
    """
    if output is None:
        what = "file to write" if "." in example else "folder for the results"
        raise InputError(f"--output is missing; give the {what}, for example -o {example}")
    return output


def output_file(path: Path, *, inputs: Iterable[Path | None] = (), suffixes: Sequence[str] = ()) -> Path:
    """The path, if a file can be written there; if that overwrites a file, this is reported at the end.

    Raises
    ------
    InputError
        As `mirrorfold.io.files.check_output`.
    """
    from mirrorfold.io.files import check_output

    check_output(path, inputs=[one for one in inputs if one is not None], suffixes=suffixes)
    watch_for_overwriting([path])
    return path


def netcdf_file(path: Path, *, inputs: Iterable[Path | None] = ()) -> Path:
    """The path of a netCDF file, as `output_file`; its suffix must not belong to another kind of file.

    Raises
    ------
    InputError
        As `output_file`, or if the suffix belongs to another kind of file.
    """
    from mirrorfold.io.suffixes import NETCDF, check_suffix

    output_file(path, inputs=inputs)
    check_suffix(path, NETCDF)
    return path


def output_directory(path: Path, *, names: Iterable[str], inputs: Iterable[Path | None] = ()) -> Path:
    """The directory, if files of these names can be written there; overwritten ones are reported at the end.

    Raises
    ------
    InputError
        As `mirrorfold.io.files.check_output_directory`.
    """
    from mirrorfold.io.files import check_output_directory

    names = list(names)
    check_output_directory(path, names=names, inputs=[one for one in inputs if one is not None])
    watch_for_overwriting(path / name for name in names)
    return path


files_before: ContextVar[dict[Path, tuple[int, int]] | None] = ContextVar("files_before", default=None)
"""Files that the running verb may overwrite, with their identity when it began; None outside of verbs."""


def watch_for_overwriting(paths: Iterable[Path]) -> None:
    """Remember which of the paths are existing files, to report at the end which of them were overwritten."""
    before = files_before.get()
    if before is not None:
        before |= {path: _identity(path) for path in paths if path.exists()}


def _identity(path: Path) -> tuple[int, int]:
    """Device and number of a file, which differ from those of another file that has replaced it."""
    state = path.stat()
    return state.st_dev, state.st_ino


@contextmanager
def overwriting_said() -> Iterator[None]:
    """Report at the end of the block which announced files were overwritten, even if the block has failed."""
    token = files_before.set({})
    try:
        yield
    finally:
        before = files_before.get() or {}
        files_before.reset(token)
        gone = [path for path, identity in before.items() if not path.exists() or _identity(path) != identity]
        if gone:
            links = {path: f" (a link to {os.path.realpath(path)})" if path.is_symlink() else "" for path in gone}
            remark([f"has overwritten {', '.join(f'{path}{link}' for path, link in links.items())}"])


def with_inputs_spared(function: Callable[..., Any]) -> Callable[..., Any]:
    """The verb, made to refuse to overwrite a file that it has read, whether the user, a scene or a scan names it."""

    @functools.wraps(function)
    def verb(*args: Any, **kwargs: Any) -> Any:
        from mirrorfold.common.reading import files_read

        token = files_read.set(set())
        try:
            return function(*args, **kwargs)
        finally:
            files_read.reset(token)

    return verb


def with_no_clobber(function: Callable[..., Any]) -> Callable[..., Any]:
    """The verb with the option ``--no-clobber``."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def verb(*args: Any, no_clobber: bool = False, **kwargs: Any) -> Any:
        from mirrorfold.io.files import may_overwrite

        token = may_overwrite.set(not no_clobber)
        try:
            with overwriting_said():
                return function(*args, **kwargs)
        finally:
            may_overwrite.reset(token)

    verb.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[*signature.parameters.values(), NO_CLOBBER]
    )
    verb.__annotations__ = {**function.__annotations__, "no_clobber": NO_CLOBBER.annotation}
    return verb
