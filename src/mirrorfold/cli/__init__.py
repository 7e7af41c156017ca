"""The command ``mirrorfold``: its verbs, its help, its exit codes.

Nothing heavy is imported here, so that help and complaints come at once; `program` knows the modules of the verbs. Each
verb reads its input, calls the function of the same name in `mirrorfold`, writes the result, and reports it.
Exit codes: 0 done; 1 the work failed; 2 the arguments or the input are wrong; 130 interrupted by
Ctrl-C, 143 by SIGTERM, 129 by SIGHUP.
"""

from __future__ import annotations

import errno
import gc
import json
import math
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from typing import Any, NamedTuple

from mirrorfold import __version__
from mirrorfold.cli.streams import flushed, open_streams, print_error, silence
from mirrorfold.common.signals import ended_as_by_ctrl_c
from mirrorfold.errors import EndedError, InputError, printable

NO_NAME = errno.ENAMETOOLONG, errno.ELOOP
"""What a path may be that is wrong in itself: too long, or a link in a circle."""

DONE, FAILED, WRONG_INPUT, INTERRUPTED = 0, 1, 2, 130

LEAST_ADDRESS_SPACE = 700e6
"""What the libraries take before any work [bytes]; with less, some crash and others wait for ever."""

SIGNALLED = 128
"""The exit code of what a signal ends is higher by its number; that of Ctrl-C is 2."""


class Verb(NamedTuple):
    """What a verb is for, in one line, and an example that works."""

    purpose: str
    example: str


VERBS = {
    "demo": Verb(
        "Simulate a hidden corner, reconstruct it and score the result: pictures, files, numbers.",
        "mirrorfold demo --scene corridor --out demo",
    ),
    "simulate": Verb(
        "Simulate the sweep that a radar measures in a scene.",
        "mirrorfold simulate scene.toml -o sweep.nc",
    ),
    "import": Verb(
        "Turn measured data of any lab into a sweep, or an image of another tool into an image.",
        "mirrorfold import scan/ --positions positions.csv -o sweep.nc",
    ),
    "export": Verb(
        "Write results for ParaView, CAD and others, or a sweep as a folder of Touchstone files.",
        "mirrorfold export out/reconstruction.nc -o points.vtp",
    ),
    "calibrate": Verb(
        "Remove what the instrument did to a sweep: background, cables, delays of elements, classic mistakes.",
        "mirrorfold calibrate sweep.nc -o clean.nc --background empty.nc --sphere sphere.nc --sphere-at 0.03,0.9",
    ),
    "focus": Verb(
        "Focus a sweep to an image, step 1 of the algorithm.",
        "mirrorfold focus sweep.nc -o image.nc",
    ),
    "fold": Verb(
        "Find the mirrors in an image and fold it, steps 2 to 6 of the algorithm.",
        "mirrorfold fold image.nc -o reconstruction.nc",
    ),
    "reconstruct": Verb(
        "Go from a sweep to the corrected picture in one command.",
        "mirrorfold reconstruct sweep.nc -o out",
    ),
    "compare": Verb(
        "Lay two results side by side: levels, points gained and lost, mirrors moved.",
        "mirrorfold compare before/reconstruction.nc after/reconstruction.nc -o compare.html",
    ),
    "score": Verb(
        "Measure how far a reconstruction is from the truth.",
        "mirrorfold score out/reconstruction.nc scene.toml --json",
    ),
    "benchmark": Verb(
        "Judge methods on families of random scenes: ours, the published one, your own.",
        "mirrorfold benchmark --family corridor --method ours published --seeds 0:10 -o out",
    ),
    "reproduce": Verb(
        "Make the published experiments anew: each claim beside our number, with pictures and data.",
        "mirrorfold reproduce principle -o out --quick",
    ),
    "report": Verb(
        "Write a page that shows a reconstruction and answers questions about it, offline.",
        "mirrorfold report out/reconstruction.nc -o report.html --scene scene.toml",
    ),
    "view": Verb(
        "Look at a file in the browser, and fold it anew while you move its mirrors.",
        "mirrorfold view out/reconstruction.nc",
    ),
    "show": Verb(
        "Draw what a file holds, for a paper or a talk.",
        "mirrorfold show out/reconstruction.nc -o figure.pdf",
    ),
    "info": Verb(
        "Say what a file holds, what can be resolved with it, and what looks wrong.",
        "mirrorfold info sweep.nc",
    ),
    "plan": Verb(
        "Say what a measurement will show before it is made: resolution, mirrors, bounces, data, time.",
        "mirrorfold plan --band 270GHz:300GHz --points 2001 --aperture 80mm --pitch 0.5mm --range 4m",
    ),
    "completion": Verb(
        "Print a script that completes verbs and options in a shell.",
        "mirrorfold completion bash",
    ),
    "schema": Verb(
        "Print the JSON Schema of what a verb prints with --json.",
        "mirrorfold schema info",
    ),
}


COLLECTION_THRESHOLDS = 100_000, 50, 100
"""How many new objects set off a search for cycles: modules make many objects that stay, and searching among them again
and again is a fifth of the time that importing takes."""


WITHOUT_DASK = {"calibrate", "demo", "focus", "reconstruct"}
"""Verbs that make no lazy arrays, and call no readers of others, who may."""


@contextmanager
def hidden_dask() -> Iterator[None]:
    """Have xarray take Dask for missing, while its context lasts.

    Wherever Dask is installed, xarray imports it to ask of any array whether it is lazy, which takes half a second;
    there is no option against it (`xarray.namedarray.utils.is_dask_collection`). An entry None in `sys.modules` is
    Python's own way to say that a module cannot be imported. xarray remembers the answer until the process ends.
    """
    if "dask" in sys.modules:
        yield
        return
    sys.modules["dask"] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules["dask"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : list of str, optional
        What follows the name of the program; by default what the process was called with, and it ends afterwards.

    Returns
    -------
    int
        The exit code.
    """
    open_streams()
    if argv is not None:
        return _run(list(argv))
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    gc.set_threshold(*COLLECTION_THRESHOLDS)
    try:
        with hidden_dask() if WITHOUT_DASK.intersection(sys.argv[1:2]) else nullcontext():
            return _run(sys.argv[1:])
    finally:
        # The end of a process frees its memory; Python need not look through every module for cycles first.
        gc.freeze()


def _run(arguments: list[str]) -> int:
    """Run one command; returns the exit code."""
    as_json = any(word == "--json" or word.startswith("--json=") for word in arguments)
    kept = held_notes.set([] if as_json else None)
    try:
        return _attempt(arguments)
    finally:
        _release(held_notes.get())
        held_notes.reset(kept)


def _attempt(arguments: list[str]) -> int:
    """Run one verb, and say in one line how it failed; returns the exit code."""
    with ended_as_by_ctrl_c() as signals:
        return _attempt_until(signals, arguments)


def _attempt_until(signals: list[int], arguments: list[str]) -> int:
    """The same, while the signals that come are listed."""
    try:
        _carry_out(arguments)
        sys.stdout.flush()
    except InputError as error:
        return _complain(error, str(error), FAILED if isinstance(error, EndedError) else WRONG_INPUT)
    except KeyboardInterrupt as error:
        code = SIGNALLED + signals[0] if signals else INTERRUPTED
        return _complain(error, str(error) or "interrupted; nothing was written", code)
    except BrokenPipeError:  # the reader of our output has gone, for example `| head`
        silence(sys.stdout)
        return FAILED
    except (MemoryError, OSError) as error:
        if isinstance(error, OSError) and error.errno in NO_NAME:
            return _complain(error, f"{error.filename}: cannot be a path ({error.strerror}); give another", WRONG_INPUT)
        return _complain(error, machine_trouble(error), FAILED)
    except Exception as error:  # the promise of one plain line holds for our own mistakes too
        if isinstance(error, ImportError) and address_space() < math.inf:  # a library that found no room
            return _complain(error, machine_trouble(MemoryError()), FAILED)
        found = f"{type(error).__name__}: {error}"
        return _complain(error, f"failed by a mistake of its own ({found}); MIRRORFOLD_DEBUG=1 shows where", FAILED)
    return DONE


def _carry_out(arguments: list[str]) -> None:
    """Print the help or the version, or run one verb."""
    if not arguments or arguments[0] in ("--help", "-h", "help"):
        print(_help())
        return
    if arguments[0] == "--version":
        print(__version__)
        return
    if address_space() < LEAST_ADDRESS_SPACE:
        raise InputError(
            f"{address_space() / 1e6:.0f} MB of address space are allowed (ulimit -v), and "
            f"{LEAST_ADDRESS_SPACE / 1e6:g} MB are needed to begin with; allow more"
        )
    from mirrorfold.cli.program import run

    said: set[str] = set()

    def once(message: Warning | str, *_: Any, **__: Any) -> None:
        """A remark; of a recording that gives one for each frame, the first."""
        if str(message) not in said:
            said.add(str(message))
            note(str(message))

    with warnings.catch_warnings():
        warnings.showwarning = once
        run(arguments)


def address_space() -> float:
    """Limit of what the process may map into its memory, by ``ulimit -v`` [bytes]."""
    try:
        import resource
    except ImportError:  # on Windows
        return math.inf
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return math.inf if limit == resource.RLIM_INFINITY else float(limit)


def machine_trouble(error: OSError | MemoryError) -> str:
    """What the machine could not do, in one sentence."""
    if isinstance(error, MemoryError):
        return "there is not enough memory; use fewer pixels or a smaller sweep"
    if error.strerror is None or error.filename is None:
        return f"reading or writing failed: {error}"
    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    remedy = "; make room, or choose another place" if full else ""
    return f"{error.filename}: cannot be read or written ({error.strerror}){remedy}"


held_notes: ContextVar[list[str] | None] = ContextVar("held_notes", default=None)
"""With ``--json`` remarks wait for the end, because on failure stderr holds one JSON object and nothing else."""


def note(sentence: str) -> None:
    """Print a remark on stderr; the verb goes on."""
    held = held_notes.get()
    _release([sentence]) if held is None else held.append(sentence)


def _release(sentences: list[str] | None) -> None:
    """Print the remarks that were held back."""
    for sentence in sentences or ():
        print_error(f"mirrorfold: note: {printable(sentence)}")


def _complain(error: BaseException, sentence: str, code: int) -> int:
    """Print one line, or one JSON object for machines; a traceback only for those who ask for it."""
    if os.environ.get("MIRRORFOLD_DEBUG") == "1":
        raise error
    sentence, held = printable(" ".join(sentence.split())), held_notes.get()
    if isinstance(error, OSError):  # what stdout still holds, because its disk is full, would be a failure again
        with flushed(sys.stdout):
            pass
    if held is None:
        print_error(f"mirrorfold: {sentence}")
        return code
    print_error(json.dumps({"error": sentence, "exit_code": code, "remarks": held}))
    held_notes.set(None)
    return code


def _help() -> str:
    """The help of the whole command."""
    lines = ["mirrorfold sees around corners: from raw radar sweeps to the folded, corrected image.", ""]
    lines += ["usage: mirrorfold VERB ...", ""]
    lines += [f"  {name:<13}{verb.purpose}" for name, verb in VERBS.items()]
    lines += ["", "`mirrorfold VERB --help` explains a verb and gives an example, `mirrorfold --version` the version."]
    lines += [
        "Each verb takes --json to print one JSON object, on failure one with `error` on stderr. Numbers may have"
    ]
    lines += ["units, as in 80mm, 300GHz or 50us; without one they are in m, Hz, s and degrees."]
    lines += ["Start with: mirrorfold demo"]
    return "\n".join(lines)
