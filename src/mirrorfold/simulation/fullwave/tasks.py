"""Solving frequencies as independent tasks: in this process, in several processes, or on a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import tempfile
import threading
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.leftovers import remove_leftovers, temporary_prefix
from mirrorfold.common.signals import leave_to_parent, start_tracker
from mirrorfold.common.threads import one_thread
from mirrorfold.common.types import Array
from mirrorfold.errors import EndedError, InputError
from mirrorfold.simulation.fullwave.kernel import hankel
from mirrorfold.simulation.fullwave.solver import System, scattered

Complex = NDArray[np.complex64]


def source_strength(k: float) -> complex:
    """Factor [m^(-1/2)] that makes the far field of ``H0^(2)(k d)`` equal to ``exp(-j k d) / sqrt(d)``."""
    return complex(np.sqrt(0.5 * np.pi * k) * np.exp(-0.25j * np.pi))


def solve_frequency(system: System, frequency: float, direct: bool) -> Complex:
    """The sweep at one frequency, (tx, rx); the same bytes wherever it is computed with the same libraries.

    Parameters
    ----------
    system : System
    frequency : float [Hz]
    direct : bool
        Add the direct wave from the transmitter, except for pairs at the same place.
    """
    k = 2.0 * np.pi * frequency / speed_of_light
    with one_thread():
        field = scattered(system, k)
        if direct:
            straight = hankel(system.tx, system.rx, k)
            field = field + np.where(np.isfinite(straight), straight, 0.0)
        return (source_strength(k) * field).astype(np.complex64)


def solve_frequencies(
    system: System, frequency: Array, todo: Sequence[int], *, direct: bool, workers: int, scheduler: str | None
) -> Iterator[tuple[int, Complex]]:
    """Solve the frequencies with the numbers `todo`; yields the number and the result of each when it is finished."""
    if scheduler is not None:
        yield from _on_cluster(system, frequency, todo, direct, scheduler)
    elif workers == 1:
        for index in todo:
            yield index, solve_frequency(system, float(frequency[index]), direct)
    else:
        yield from _in_processes(system, frequency, todo, direct, workers)


def _in_processes(
    system: System, frequency: Array, todo: Sequence[int], direct: bool, workers: int
) -> Iterator[tuple[int, Complex]]:
    """Solve the frequencies in worker processes, each of which has a copy of the system."""
    # Workers read the system from a file: as an argument, a large one would block the parent forever if a worker ended
    # before it had read it.
    remove_leftovers(Path(tempfile.gettempdir()))
    with tempfile.TemporaryDirectory(prefix=temporary_prefix()) as folder:
        path = Path(folder) / "system.pickle"
        path.write_bytes(pickle.dumps(system))
        start_tracker()
        pool = ProcessPoolExecutor(
            min(workers, max(1, len(todo))),
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_start_worker,
            initargs=(path,),
        )
        try:
            futures = {pool.submit(_in_worker, float(frequency[index]), direct): index for index in todo}
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenProcessPool:
            raise EndedError(
                "workers: a worker process has ended before its time, for want of memory or because the script that "
                'started it lacks `if __name__ == "__main__":`; use fewer workers or add that line, and resume'
            ) from None
        finally:
            pool.shutdown(cancel_futures=True)


_system: System | None = None
"""The system of this worker process."""


def _start_worker(path: Path) -> None:
    """Initialise a worker process: load the system, and end the process whenever the parent ends."""
    global _system
    _system = pickle.loads(path.read_bytes())
    leave_to_parent()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Wait until the parent process ends, then end this one, which would otherwise wait for tasks forever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _in_worker(frequency: float, direct: bool) -> Complex:
    """Solve one frequency in a worker process."""
    if _system is None:
        raise RuntimeError("this process was not started as a worker")
    return solve_frequency(_system, frequency, direct)


def _on_cluster(
    system: System, frequency: Array, todo: Sequence[int], direct: bool, scheduler: str
) -> Iterator[tuple[int, Complex]]:
    """Solve the frequencies by the workers of a Dask cluster."""
    try:
        from distributed import Client
        from distributed import as_completed as completed
        from distributed.comm.core import CommClosedError
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise InputError(
            "scheduler: dask is not installed; run `pip install 'mirrorfold[dask]'`, or leave out the scheduler to use "
            "the cores of this machine"
        ) from None
    try:
        client = Client(scheduler, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        reason = str(error) or type(error).__name__
        raise InputError(
            f"scheduler: no Dask scheduler answers at {scheduler!r} ({reason}); start one with `dask scheduler` and "
            "give its address, such as tcp://127.0.0.1:8786"
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT_SECONDS)
        except TimeoutError:
            raise InputError(
                f"scheduler: the Dask scheduler at {scheduler!r} has no workers; start some with `dask worker "
                f"{scheduler}`"
            ) from None
        # The system is sent as the result of a task, which Dask runs again if the worker that holds it is lost. Data
        # sent by `scatter` would be lost with the worker, and would block forever if it ended while receiving them.
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Sending large graph")
            everywhere = client.submit(pickle.loads, pickle.dumps(system), pure=False)
        futures = {
            client.submit(solve_frequency, everywhere, float(frequency[index]), direct, pure=False): index
            for index in todo
        }
        try:
            for future in completed(futures, loop=client.loop):
                yield futures[future], future.result()
        except (KilledWorker, CancelledError, CommClosedError) as error:
            raise EndedError(
                f"scheduler: the Dask cluster at {scheduler!r} was lost, or its workers ended again and again, perhaps "
                f"for want of memory ({type(error).__name__}); mend it, and resume"
            ) from None


CONNECT_SECONDS = 10
"""Longest time to wait for a Dask scheduler, and for its first worker [s]."""
