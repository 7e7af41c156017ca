"""Compiled loops: Numba's `njit` with a cache on disk, which finds a writable folder and replaces damaged files."""

from __future__ import annotations

import itertools
import os
import secrets
import stat
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import FunctionCache

NUMBERED = "from a random number on"
"""How functions are numbered in what is kept; files that do not say so are compiled again.

Numba numbers the functions that it compiles, from one in each process, and these numbers tell apart the compiled code
of functions of one name, as those within `numpy.sort` and `numpy.argsort`. Kernels that two processes have compiled may
hold two such functions under one number. A third process that loads both from the disk then runs the code of the one in
the place of the other: it sorts wrongly, or crashes.
"""


def _number_functions() -> None:
    """Let Numba number the functions that this process compiles from a random number on, see `NUMBERED`."""
    FunctionIdentity._unique_ids = itertools.count(secrets.randbits(62))


_number_functions()
if hasattr(os, "register_at_fork"):  # processes that are forked would all go on with the number of their parent
    os.register_at_fork(after_in_child=_number_functions)


class _KernelCache(FunctionCache):
    """A cache that makes its files anew if they are damaged, as by a full disk or an incomplete copy, or out of date.

    Numba compares the source file of the function alone. Compiled code also holds the kernels that the function calls
    and the constants that it reads, which other files may have changed: these are compared as well.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        named = {name: function.__globals__.get(name) for name in sorted(function.__code__.co_names)}
        caches = [getattr(value, "_cache", None) for value in named.values()]
        called = [cache.stamp for cache in caches if isinstance(cache, _KernelCache)]
        constants = {name: value for name, value in named.items() if isinstance(value, (int, float, complex, tuple))}
        self.stamp: Any = (NUMBERED, self._impl.locator.get_source_stamp(), called, repr(constants))
        self._cache_file._source_stamp = self.stamp

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """The compiled kernel from the cache, or None to have it compiled."""
        try:
            return super().load_overload(signature, target_context) if self.is_safe() else None
        except Exception:  # unpickling damaged bytes may raise any exception
            with suppress(OSError):
                self.flush()  # else the damaged index would be read again when the kernel is saved
            return None

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep a compiled kernel. If that fails, as on a full disk, it is compiled again by the next process."""
        try:
            if self.is_safe():
                super().save_overload(signature, data)
        except OSError as error:
            warnings.warn(
                f"compiled kernels cannot be kept in {self.cache_path} ({error.strerror}), so every run compiles them; "
                "make room, or choose another place by NUMBA_CACHE_DIR",
                stacklevel=2,
            )

    def is_safe(self) -> bool:
        """Whether the index is a file or missing: opening a pipe in its place would wait for ever."""
        index = Path(self._cache_file._index_path)
        return index.is_file() or not index.exists()

    def is_filled(self) -> bool:
        """Whether any kernel is kept, for any types of arguments."""
        return self.is_safe() and bool(self._cache_file._load_index())


def njit(*, makes_arrays: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function when it is first called, and keep the result on disk.

    The compiled function is kept beside the module, else in the user's cache folder, as Numba does. If both are
    read-only, it is kept in a folder of the user among the temporary files, which a warning names. `NUMBA_CACHE_DIR`
    chooses another place.

    Parameters
    ----------
    makes_arrays : bool
        Whether the function makes arrays of its own. Only then the compiled code counts references to arrays. Threads
        that share arrays contend for these counters, which can take several times as long as the work of a kernel with
        many arrays. A function that makes arrays without this flag does not compile.
    **options
        Options of `numba.njit`, without `cache`.

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


def is_compiled(kernel: Any) -> bool:
    """Whether a kernel need not be compiled, for any types of arguments: the disk holds it, or it is plain Python."""
    cache = getattr(kernel, "_cache", None)
    return cache is None or cache.is_filled()


def _cache_of(function: Callable[..., Any]) -> FunctionCache:
    """The cache of a function; in a temporary folder if no other folder is writable."""
    try:
        return _KernelCache(function)
    except RuntimeError:  # Numba found no folder that it may write to
        numba.config.CACHE_DIR = str(_temporary_folder())  # type: ignore[attr-defined]
        return _KernelCache(function)


def _temporary_folder() -> Path:
    """A folder that only this user can write to: whoever can write to it decides which code is run."""
    owner = os.getuid() if hasattr(os, "getuid") else os.getlogin()
    folder = Path(tempfile.gettempdir()) / f"mirrorfold-kernels-{owner}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        private = stat.S_ISDIR(status.st_mode) and (os.name == "nt" or not status.st_mode & 0o077)
        own = private and (not hasattr(os, "getuid") or status.st_uid == os.getuid())
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
