"""Compiled loops: Numba's `njit` with a cache on disk, wherever it may write, that mends itself."""

from __future__ import annotations

import os
import stat
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache


class _MendingCache(FunctionCache):
    """A cache whose files may be damaged, by a full disk or a copy that was cut short: they are then made anew."""

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """The compiled kernel from the cache, or None to have it compiled."""
        try:
            return super().load_overload(signature, target_context)
        except Exception:  # what unpickling damaged bytes raises can be anything
            self.flush()  # else the damaged index would be read again when the kernel is saved
            return None


def njit(*, makes_arrays: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function when it is first called, and keep the result on disk.

    It is kept beside the module, else in the user's cache folder, as Numba does; where both are read-only, in a folder
    of the user among the temporary files, which a warning names. `NUMBA_CACHE_DIR` chooses another place.

    Parameters
    ----------
    makes_arrays : bool
        Whether the function makes arrays of its own. Only then it counts references to arrays: threads that share
        arrays contend for the counters, which takes a kernel of many arrays several times as long as its work. A
        function that makes arrays without saying so does not compile.
    **options
        Those of `numba.njit`, without `cache`.

    Returns
    -------
    callable
        The decorator.
    """
    options["_nrt"] = makes_arrays  # Numba's own runtime, which counts the references

    def compiled(function: Callable[..., Any]) -> Any:
        kernel = numba.njit(**options)(function)
        if hasattr(kernel, "enable_caching"):  # not where NUMBA_DISABLE_JIT leaves the function as it is
            kernel._cache = _cache_of(function)
        return kernel

    return compiled


def _cache_of(function: Callable[..., Any]) -> FunctionCache:
    """The cache of a function, in a temporary place where there is no other."""
    try:
        return _MendingCache(function)
    except RuntimeError:  # no place where files can be written
        numba.config.CACHE_DIR = str(_temporary_folder())  # type: ignore[attr-defined]
        return _MendingCache(function)


def _temporary_folder() -> Path:
    """A folder that belongs to this user alone: whoever can write to it decides what is run."""
    owner = os.getuid() if hasattr(os, "getuid") else os.getlogin()
    folder = Path(tempfile.gettempdir()) / f"mirrorfold-kernels-{owner}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        private = stat.S_ISDIR(found.st_mode) and (os.name == "nt" or not found.st_mode & 0o077)
        own = private and (not hasattr(os, "getuid") or found.st_uid == os.getuid())
    except OSError:
        own = False
    if not own:
        folder = Path(tempfile.mkdtemp(prefix="mirrorfold-kernels-"))
    warnings.warn(
        f"compiled kernels cannot be kept beside the package or in the cache folder of the user, which are read-only: "
        f"they are kept in {folder}; NUMBA_CACHE_DIR chooses another place",
        stacklevel=2,
    )
    return folder
