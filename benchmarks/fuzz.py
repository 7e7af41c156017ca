"""Damage whatever mirrorfold reads: it must refuse bad input in one sentence, in little time and memory.

    python benchmarks/fuzz.py --minutes 10
    python benchmarks/fuzz.py --target scenes --first 1234 --cases 1        repeats one case

| target | what is fed |
|---|---|
| readers | data of other tools, tables of positions, descriptions of scans, mappings |
| scenes | scene files: read, described, and simulated if they are small |
| descriptions | mirrors, floor plans, calibrations of elements |
| results | sweeps, images and reconstructions in our own formats, in the verbs that take them |
| page | requests to the live page |

Each case depends on its target and its number alone. The ledger beside this script holds how many cases were fed: the
next run goes on from there, so that no case is fed twice. An escape is an exception other than InputError, a case that
takes too long or too much memory, or a process that dies. Its file is cut down to the fewest bytes that cause the same
escape, and kept in build/fuzz. When the mistake is mended, the file goes to tests/corpus, with the sentence that now
refuses it.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
import zlib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from fuzzing.page import Page
from fuzzing.results import Results
from fuzzing.targets import Case, Descriptions, EscapeError, Readers, Scenes, Target

TARGETS: dict[str, Callable[[Path], Target]] = {
    "readers": Readers,
    "scenes": Scenes,
    "descriptions": Descriptions,
    "results": Results,
    "page": Page,
}

LEDGER = Path(__file__).with_name("fuzz_ledger.json")
"""Number of cases that were fed so far, by target."""

SECONDS_A_CASE = 20.0
"""A case that takes more CPU time than this has hung [s]."""

SECONDS_TO_REFUSE = 1.0
"""Bad input must be refused within this CPU time [s]."""

SECONDS_FOR_HDF5 = 5.0
"""Time that the HDF5 library may take for the small files here [s]; a file that hangs it costs this time."""

PEAK_BYTES = 1 << 30
"""Most memory of the whole process [bytes]."""

CASE_BYTES = 256 << 20
"""Most memory by which one case may raise the peak of the process [bytes]."""

SECONDS_A_BLOCK = 60.0
"""Life of one process [s]: starting it takes seconds, but its end returns the memory that it has leaked."""

SHRINKING_TRIES = 300
"""Most tries to cut down a case that escapes."""


class Hung(BaseException):
    """A case takes too long; no reader may catch this."""


def attempt(target: Target, case: Case) -> str:
    """Feed a case under all limits; returns "read" or "refused".

    Raises
    ------
    Exception or Hung
        If the case escapes.
    """
    peak, start = _peak(), time.process_time()
    signal.setitimer(signal.ITIMER_PROF, SECONDS_A_CASE)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            outcome = target.feed(case)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    seconds = time.process_time() - start
    if outcome == "refused" and seconds > SECONDS_TO_REFUSE:
        raise EscapeError(f"refused after {seconds:.1f} s")
    if _peak() - peak > CASE_BYTES:
        raise EscapeError(f"took {(_peak() - peak) >> 20} MiB")
    return outcome


def _peak() -> int:
    """Largest memory of this process so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def escape_of(target: Target, case: Case) -> BaseException | None:
    """The exception by which a case escapes; None if it does not."""
    try:
        attempt(target, case)
    except (Exception, Hung) as error:
        return error
    return None


def kind_of(error: BaseException) -> str:
    """The name of a mistake: the type of its exception, and the last line of mirrorfold that the exception passed."""
    frames = [
        frame for frame in traceback.extract_tb(error.__traceback__) if "mirrorfold" in Path(frame.filename).parts
    ]
    place = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else re.sub(r"\d+", "N", str(error))
    return f"{type(error).__name__} at {place}"


def least(target: Target, case: Case, kind: str) -> Case:
    """The case without most of the bytes that it does not need in order to escape in the same way."""
    tries, length = 0, max(len(case.raw) // 2, 1)
    while length and tries < SHRINKING_TRIES:
        at = 0
        while at < len(case.raw) and tries < SHRINKING_TRIES:
            shorter = case._replace(raw=case.raw[:at] + case.raw[at + length :])
            error, tries = escape_of(target, shorter), tries + 1
            if error is not None and kind_of(error) == kind:
                case = shorter
            else:
                at += length
        length //= 2
    return case


def run_cases(
    name: str,
    folder: Path,
    *,
    first: int = 0,
    cases: int = 1 << 62,
    seconds: float = float("inf"),
    escapes: Path | None = None,
) -> Counter[str]:
    """Feed cases of a target, from number `first` on, until `cases` were fed or `seconds` have passed.

    Parameters
    ----------
    name : str
        Name of the target.
    folder : path
        Folder for the target's files.
    escapes : path, optional
        Folder in which escapes are kept, made as small as possible. By default the first escape is raised.

    Returns
    -------
    Counter
        Number of cases, by the suffix of the file and "read" or "refused", and number of those that "escaped".
    """
    from mirrorfold.io.readers import hdf5

    patience = hdf5.PATIENCE

    def hang(*_: object) -> None:
        raise Hung

    previous = signal.signal(signal.SIGPROF, hang)
    counts: Counter[str] = Counter()
    try:
        target = TARGETS[name](folder)
        for case in target.valid():  # compiles, imports, and shows that valid cases are read
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                error = None if target.feed(case) == "read" else f"{case.name}, way {case.way}: a valid case is refused"
                if error:
                    raise AssertionError(error)
        hdf5.PATIENCE = SECONDS_FOR_HDF5  # not earlier: a busy machine may need longer for valid cases
        known: set[str] = set()
        end = time.monotonic() + seconds
        for number in range(first, first + cases):
            if time.monotonic() > end:
                break
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                case = target.case(number, np.random.default_rng([zlib.crc32(name.encode()), number]))
            (folder.parent / "current").write_text(str(number))
            try:
                counts[f"{Path(case.name).suffix} {attempt(target, case)}"] += 1
                continue
            except (Exception, Hung) as error:
                if isinstance(error, EscapeError | Hung) and escape_of(target, case) is None:
                    counts["once too slow or too large"] += 1  # a compilation, or another program at work
                    continue
                if escapes is None:
                    raise AssertionError(f"{name} {number}, {case.name}, way {case.way}: {error!r}") from error
                counts["escaped"] += 1
                kind = kind_of(error)
                if kind not in known:
                    known.add(kind)
                    keep(
                        escapes, name, number, least(target, case, kind) if not isinstance(error, Hung) else case, error
                    )
    finally:
        signal.signal(signal.SIGPROF, previous)
        hdf5.PATIENCE = patience
    return counts


def keep(escapes: Path, name: str, number: int, case: Case, error: BaseException) -> None:
    """Keep the file of an escape, and beside it a text with the traceback."""
    escapes.mkdir(parents=True, exist_ok=True)
    (escapes / f"{name}-{number}-{case.name}").write_bytes(case.raw)
    story = "".join(traceback.format_exception(error))
    (escapes / f"{name}-{number}.txt").write_text(f"{name}, case {number}, way {case.way}\n{story}")
    print(
        f"{name} {number}, {case.name}, way {case.way}: {kind_of(error)}: {str(error)[:300]}",
        file=sys.stderr,
        flush=True,
    )


def child(options: argparse.Namespace) -> int:
    """Feed one block of cases in this process, and print the counts as JSON."""
    faulthandler.enable()
    base = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    folder = Path(tempfile.mkdtemp(dir=base, prefix="mirrorfold-fuzz-"))
    files = folder / "files"
    files.mkdir()
    os.chdir(folder)
    print(folder, file=sys.stderr, flush=True)
    counts = run_cases(
        options.target[0],
        files,
        first=options.first,
        cases=options.cases,
        seconds=options.seconds,
        escapes=options.escapes,
    )
    assert _peak() < PEAK_BYTES, f"the process took {_peak() >> 20} MiB"
    print(json.dumps({"counts": counts, "peak": _peak()}))
    shutil.rmtree(folder)
    return 0


def block(name: str, first: int, cases: int, seconds: float, escapes: Path) -> dict[str, Any]:
    """Feed cases in a process of their own, because a crash of a library ends the process."""
    words = [f"--target={name}", f"--first={first}", f"--cases={cases}", f"--seconds={seconds}", f"--escapes={escapes}"]
    done = subprocess.run(
        [sys.executable, __file__, "--child", *words],
        capture_output=True,
        text=True,
        check=False,
    )
    folder, _, printed = done.stderr.partition("\n")
    if printed.strip():
        print(printed.strip(), flush=True)
    if done.returncode:  # it has died; its folder holds the number of the case
        current = Path(folder) / "current"
        if not current.is_file():
            raise SystemExit(f"{name}: nothing could be fed; its files are in {folder}")
        number = int(current.read_text())
        kept = shutil.move(folder, escapes / f"{name}-{number}")
        print(f"{name}: the process died ({done.returncode}) at case {number}; its files are in {kept}", flush=True)
        return {"counts": {"escaped": 1, "fed": number - first}, "peak": 0}
    return json.loads(done.stdout)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--minutes", type=float, default=10.0, help="for all targets together")
    parser.add_argument("--target", nargs="*", default=list(TARGETS), choices=list(TARGETS))
    parser.add_argument("--first", type=int, help="number of the first case; by default where the ledger ends")
    parser.add_argument("--cases", type=int, default=1 << 62, help="the most cases of each target")
    parser.add_argument("--escapes", type=Path, default=Path("build/fuzz"))
    parser.add_argument("--seconds", type=float, default=SECONDS_A_BLOCK, help="of one process")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.escapes = options.escapes.absolute()
    if options.child:
        return child(options)
    total: dict[str, Counter[str]] = {name: Counter() for name in options.target}
    end, failed = time.monotonic() + 60.0 * options.minutes, 0
    waiting = list(options.target)
    while waiting and time.monotonic() < end:
        name = waiting.pop(0)
        ledger = json.loads(LEDGER.read_text())
        begun = sum(total[name].values())
        first = (ledger.get(name, 0) if options.first is None else options.first) + (
            begun if options.first is not None else 0
        )
        seconds = min(options.seconds, max(1.0, end - time.monotonic()))
        found = block(name, first, options.cases - begun, seconds, options.escapes)
        total[name].update(found["counts"])
        fed = sum(found["counts"].values())
        failed += found["counts"].get("escaped", 0)
        if options.first is None:
            ledger[name] = first + fed
            temporary = LEDGER.with_suffix(".tmp")
            temporary.write_text(json.dumps(ledger, indent=2) + "\n")
            temporary.replace(LEDGER)
        escaped, peak = found["counts"].get("escaped", 0), found["peak"] >> 20
        print(f"{name}: cases {first} to {first + fed}, {escaped} escaped, peak {peak} MiB", flush=True)
        if sum(total[name].values()) < options.cases:
            waiting.append(name)
    print("\n| target | files | cases | refused | read |\n|---|---|---|---|---|")
    for name, counts in total.items():
        for suffix in sorted({key.split()[0] for key in counts if key.startswith(".")}):
            refused, read = counts[f"{suffix} refused"], counts[f"{suffix} read"]
            print(f"| {name} | {suffix} | {refused + read} | {refused} | {read} |")
    print(f"\n{sum(sum(counts.values()) for counts in total.values())} cases, {failed} escaped")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
