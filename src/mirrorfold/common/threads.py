"""Threads that share the blocks of a job; they run at once, as compiled kernels release the interpreter lock."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from itertools import pairwise
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mirrorfold.common.types import Progress

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

T = TypeVar("T")

PATIENCE = 0.2
"""Interval [s] at which the calling thread looks whether a worker has failed."""

SHARES = 4
"""Number of shares of a job for each core: a core that has little to do takes shares from others."""

_pool: ThreadPoolExecutor | None = None
_pool_lock = threading.Lock()

_inside = 0
"""Number of threads that are in `one_thread`."""
_inside_lock = threading.Lock()
_limiter: Any = None


def cpu_count() -> int:
    """Number of cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _shared_pool() -> ThreadPoolExecutor:
    global _pool
    with _pool_lock:
        if _pool is None:
            _pool = ThreadPoolExecutor(cpu_count(), thread_name_prefix="mirrorfold-focus")
        return _pool


def for_each(work: Callable[[T], object], items: Iterable[T], done: Callable[[], None] | None = None) -> None:
    """Call ``work(item)`` for every item on all cores; the first exception stops the rest and is raised.

    `done` is called on the calling thread after each item. Several threads may call this function at once; `work` must
    not call it, because it would wait for itself.
    """
    waiting = deque(items)
    finished: SimpleQueue[None] = SimpleQueue()
    total = len(waiting)

    def work_through() -> None:
        try:
            while True:
                try:
                    item = waiting.popleft()
                except IndexError:
                    return
                work(item)
                finished.put(None)
        except BaseException:
            waiting.clear()
            raise

    workers = [_shared_pool().submit(work_through) for _ in range(min(cpu_count(), total))]
    try:
        if done is not None:
            reported = 0
            while reported < total and not all(worker.done() for worker in workers):
                try:
                    finished.get(timeout=PATIENCE)
                except Empty:
                    continue
                reported += 1
                done()
            for worker in workers:
                worker.result()
            for _ in range(total - reported):
                done()
        for worker in workers:
            worker.result()
    except BaseException:
        waiting.clear()
        raise


def counted(progress: Progress | None, total: int) -> Callable[..., None]:
    """A function to call after every step, or with the number of steps; it tells `progress` how many steps are done."""
    done = 0

    def step(steps: int = 1) -> None:
        nonlocal done
        done += steps
        if progress is not None:
            progress(done, total)

    return step


def in_shares(work: Callable[..., object], count: int, *arguments: object) -> None:
    """Call ``work(*arguments, start, stop)`` on all cores for consecutive shares of ``range(count)``.

    There are several shares for each core, so that a core that is done early takes another share.
    """
    edges = np.unique(np.linspace(0, count, SHARES * cpu_count() + 1).astype(int)).tolist()
    for_each(lambda share: work(*arguments, *share), pairwise(edges))


@contextmanager
def one_thread() -> Iterator[None]:
    """A context in which linear algebra uses one thread; several threads may be in it at once.

    The threads of the linear algebra library wait for each other by spinning, which on a busy machine costs twenty
    times the work. So the threads and processes of this package share the blocks instead, and results do not depend on
    the number of cores. The number of threads is one for the whole process. So the first to enter sets it, and the last
    to leave sets it back: if each did, one that leaves would free memory that another's products use, and the last
    would set back what the first had set.
    """
    global _inside, _limiter
    with _inside_lock:
        _inside += 1
        if _limiter is None:
            _limiter = _linear_algebra().limit(limits=1, user_api="blas")
    try:
        yield
    finally:
        with _inside_lock:
            _inside -= 1
            if _inside == 0:
                _limiter.restore_original_limits()
                _limiter = None


@lru_cache(1)
def _linear_algebra() -> ThreadpoolController:
    """The libraries of linear algebra of NumPy and SciPy, found once: the search takes longer than many a product."""
    import scipy.linalg  # noqa: F401 - it loads its library
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def products(left: NDArray[Any], right: NDArray[Any], out: NDArray[Any]) -> NDArray[Any]:
    """``out[f] = left[f] @ right[f]`` for every f, on all cores."""
    with one_thread():
        for_each(lambda f: np.matmul(left[f], right[f], out=out[f]), range(len(out)))
    return out


class Buffers:
    """A store of arrays of one shape, lent for a moment: allocating fresh memory costs as much as the work in it."""

    def __init__(self, shape: tuple[int, ...], dtype: DTypeLike = np.complex64) -> None:
        self._shape, self._dtype = shape, np.dtype(dtype)
        self._free: list[NDArray[Any]] = []

    @contextmanager
    def one(self) -> Iterator[NDArray[Any]]:
        """Lend an array that nobody else uses; its content is arbitrary."""
        try:
            array = self._free.pop()
        except IndexError:
            array = np.empty(self._shape, self._dtype)
        yield array
        self._free.append(array)


def part_of(progress: Progress | None, number: int, parts: int) -> Progress | None:
    """The progress callback for part `number` (from 0) of several equal parts of the work."""
    if progress is None or parts == 1:
        return progress
    return lambda done, total: progress(number * total + done, parts * total)
