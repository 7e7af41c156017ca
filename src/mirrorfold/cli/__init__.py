"""The command ``mirrorfold``: its verbs, its help, its exit codes.

No large module is imported here, so that help and error messages appear at once; `program` imports the modules of the
verbs. Each verb reads its input, calls the function of the same name in `mirrorfold`, writes the result and prints it.
Exit codes: 0 done; 1 the work failed; 2 the arguments or the input are wrong; 130 interrupted by Ctrl-C, 143 by
SIGTERM, 129 by SIGHUP.
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
from mirrorfold.common.written import files_written
from mirrorfold.errors import EndedError, InputError, printable

NO_NAME = errno.ENAMETOOLONG, errno.ELOOP
"""Errors of paths that can never be right: too long, or a circle of links."""

DONE, FAILED, WRONG_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit codes."""

LEAST_ADDRESS_SPACE = 1.1e9
"""Address space that the libraries, and compiling on several threads, need before any work [bytes]; with less, some
crash and others wait forever."""

SIGNALLED = 128
"""The exit code of a process that a signal ends is this plus the number of the signal; that of Ctrl-C is 2."""


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
"""Thresholds of Python's garbage collector, for `gc.set_threshold`. They are higher than usual, because importing
modules makes many objects that stay, and searching these again and again takes a fifth of the time of importing."""


WITHOUT_DASK = {"calibrate", "demo", "focus", "reconstruct"}
"""Verbs that need no Dask: they make no lazy arrays, and call no readers of other packages, which might."""


@contextmanager
def hidden_dask() -> Iterator[None]:
    """Make xarray believe that Dask is not installed, while the context lasts.

    If Dask is installed, xarray imports it to find out whether an array is lazy, which takes half a second; no option
    prevents that (`xarray.namedarray.utils.is_dask_collection`). An entry None in `sys.modules` is Python's own way to
    say that a module cannot be imported. xarray remembers the answer until the process ends; so where it may have
    found Dask already, Dask stays.
    """
    if not {"dask", "xarray"}.isdisjoint(sys.modules):
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
        The arguments after the name of the program; by default those of the process, which is expected to end
        afterwards.

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
        # Ending the process frees its memory anyway, so Python need not search all modules for cycles first.
        gc.freeze()


def _run(arguments: list[str]) -> int:
    """Run one command line, and print the remarks that were held back; returns the exit code."""
    as_json = any(word == "--json" or word.startswith("--json=") for word in arguments)
    kept = held_notes.set([] if as_json else None)
    try:
        return _attempt(arguments)
    finally:
        _print_remarks(held_notes.get())
        held_notes.reset(kept)


def _attempt(arguments: list[str]) -> int:
    """Run one command line, and print an error in one line if it fails; returns the exit code.

    SIGTERM and SIGHUP end the work in the same way as Ctrl-C.
    """
    written = files_written.set([])
    try:
        with ended_as_by_ctrl_c() as signals:
            return _attempt_listing_signals(signals, arguments)
    finally:
        files_written.reset(written)


def _attempt_listing_signals(signals: list[int], arguments: list[str]) -> int:
    """Run one command line and print its error, as `_attempt`; `signals` lists the signals that have been received."""
    try:
        _carry_out(arguments)
        sys.stdout.flush()
    except InputError as error:
        return _print_failure(error, str(error), FAILED if isinstance(error, EndedError) else WRONG_INPUT)
    except KeyboardInterrupt as error:
        # After Ctrl-C in the middle of an import, Python ends a program that was started by `python -m` by that signal,
        # whatever exit code it chooses, unless a text has been executed since.
        exec("")
        code = SIGNALLED + signals[0] if signals else INTERRUPTED
        return _print_failure(error, str(error) or f"interrupted; {_said_written()}", code)
    except BrokenPipeError:  # the program that reads our output has ended, for example `| head`
        silence(sys.stdout)
        return FAILED
    except (MemoryError, OSError) as error:
        if isinstance(error, OSError) and error.errno in NO_NAME:
            return _print_failure(
                error, f"{error.filename}: cannot be a path ({error.strerror}); give another", WRONG_INPUT
            )
        return _print_failure(error, machine_trouble(error), FAILED)
    except Exception as error:  # a bug of this package is reported in one line, too
        if isinstance(error, ImportError) and address_space() < math.inf:  # a library did not fit into the memory
            return _print_failure(error, machine_trouble(MemoryError()), FAILED)
        found = f"{type(error).__name__}: {error}"
        return _print_failure(
            error, f"failed by a mistake of its own ({found}); MIRRORFOLD_DEBUG=1 shows where", FAILED
        )
    return DONE


def _said_written() -> str:
    """What the command has written, in words, without temporary files, which are gone."""
    written = [str(path) for path in files_written.get() or () if path.exists()]
    return f"{', '.join(written)} was written before" if written else "nothing was written"


def _carry_out(arguments: list[str]) -> None:
    """Print the help or the version, or run one verb."""
    if not arguments or arguments[0] in ("--help", "-h", "help"):
        print(_help())
        return
    if arguments[0] == "--version":
        print(__version__)
        return
    try:
        os.getcwd()
    except FileNotFoundError:
        raise InputError("the folder that you are in was deleted; change to another one with cd") from None
    if address_space() < LEAST_ADDRESS_SPACE:
        raise InputError(
            f"{address_space() / 1e6:.0f} MB of address space are allowed (ulimit -v), and "
            f"{LEAST_ADDRESS_SPACE / 1e6:g} MB are needed to begin with; allow more"
        )
    from mirrorfold.cli.program import run

    said: set[str] = set()

    def once(message: Warning | str, *_: Any, **__: Any) -> None:
        """Print a warning as a remark, unless it was printed before, as when each frame of a recording warns."""
        if str(message) not in said:
            said.add(str(message))
            note(str(message))

    with warnings.catch_warnings():
        warnings.showwarning = once
        if sys.warnoptions:  # PYTHONWARNINGS is meant for programs of the user; these warnings are remarks of verbs
            warnings.simplefilter("always", UserWarning)
        run(arguments)


def address_space() -> float:
    """Limit of the address space of the process, set by ``ulimit -v`` [bytes]; infinite without a limit."""
    try:
        import resource
    except ImportError:  # on Windows
        return math.inf
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return math.inf if limit == resource.RLIM_INFINITY else float(limit)


def machine_trouble(error: OSError | MemoryError) -> str:
    """The message for an error of the machine: too little memory, or a failure of a disk."""
    if isinstance(error, MemoryError):
        return "there is not enough memory; use fewer pixels or a smaller sweep"
    if error.strerror is None or error.filename is None:
        return f"reading or writing failed: {error}"
    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    remedy = "; make room, or choose another place" if full else ""
    return f"{error.filename}: cannot be read or written ({error.strerror}){remedy}"


held_notes: ContextVar[list[str] | None] = ContextVar("held_notes", default=None)
"""Remarks that are held back until the end, with ``--json``: after a failure, stderr must hold only one JSON object.
None without ``--json``."""


def note(sentence: str) -> None:
    """Print a remark on stderr, or hold it back with ``--json``; the verb goes on."""
    held = held_notes.get()
    _print_remarks([sentence]) if held is None else held.append(sentence)


def _print_remarks(sentences: list[str] | None) -> None:
    """Print the remarks that were held back."""
    for sentence in sentences or ():
        print_error(f"mirrorfold: note: {printable(sentence)}")


def _print_failure(error: BaseException, sentence: str, code: int) -> int:
    """Print an error in one line, or as one JSON object with ``--json``; returns the exit code.

    With the environment variable ``MIRRORFOLD_DEBUG=1`` the error is raised, so that its traceback is printed.
    """
    if os.environ.get("MIRRORFOLD_DEBUG") == "1":
        raise error
    sentence, held = printable(" ".join(sentence.split())), held_notes.get()
    if isinstance(error, OSError):  # if the disk of stdout is full, its remaining content would fail again at the end
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
