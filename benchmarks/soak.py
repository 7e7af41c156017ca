"""Hours of hard use: no file is lost or half-written, memory does not grow, and resumed work gives the same bits.

    python benchmarks/soak.py [--quick] [--only NAME ...] [--seed 0]

| trial | what is done |
|---|---|
| growth | many reconstructions in one process: how much its memory grows after the first tenth of them |
| crowd | ten command lines at once, with one empty cache of compiled kernels |
| kills | `kill -9` at random moments of each verb that writes, with older files in the place of its output |
| resumed | full-wave sweeps that are killed repeatedly, and resumed |
| full disk | files cannot grow beyond a random size |
| damage | random bits of stored parts are changed before a sweep is resumed |
| worker | one of two Dask workers is killed while it works |

Prints one line for each trial, and fails if any trial has failed. The quick version takes some five minutes.
"""

from __future__ import annotations

import argparse
import filecmp
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.table import Table

SCENE = """
name = "one wall"
[array]
kind = "linear"
elements = 17
pitch = 0.5e-3
[band]
start = 290e9
stop = 300e9
points = 81
[[surface]]
name = "wall"
kind = "segment"
start = [-0.25, 0.5]
end = [0.25, 0.54]
roughness = {rms_height = 0.05e-3, correlation_length = 0.2e-3}
"""

GROWTH = """
import resource, sys
import mirrorfold as mf
sweep, times = mf.load(sys.argv[1]), int(sys.argv[2])
def now():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()
for number in range(times):
    mf.reconstruct(sweep)
    if number == int(sys.argv[3]):
        first = now()
print(first, now())
"""
"""A program that reconstructs a sweep many times, and prints the resident memory [bytes] after some of them and at the
end."""

WARM_UP = 80
"""Reconstructions after which the memory is measured first: until then it grows by 3 %, afterwards by 0.2 % in 160."""

MOST_GROWTH = 0.02
"""Largest growth of a process after `WARM_UP` reconstructions, as a share of its memory."""

VERBS = {
    "simulate": ("simulate scene.toml -o {}/a.nc", "a.nc"),
    "focus": ("focus sweep.nc -o {}/a.nc", "a.nc"),
    "fold": ("fold image.nc -o {}/a.nc", "a.nc"),
    "reconstruct": ("reconstruct sweep.nc -o {}", "reconstruction.nc before_after.png report.html"),
    "calibrate": ("calibrate sweep.nc -o {}/a.nc --background background.nc", "a.nc"),
    "export points": ("export reconstruction.nc -o {}/a.ply", "a.ply"),
    "export Touchstone": ("export sweep.nc -o {}/scan", "scan"),
    "import": ("import scan --positions scan/positions.csv -o {}/a.nc", "a.nc"),
    "report": ("report reconstruction.nc -o {}/a.html", "a.html"),
    "show": ("show image.nc -o {}/a.png", "a.png"),
    "compare": ("compare reconstruction.nc reconstruction.nc -o {}/a.html", "a.html"),
    "plan": ("plan --band 290GHz:300GHz --points 401 --aperture 80mm --pitch 0.5mm --range 2m -o {}/a.png", "a.png"),
}
"""Each verb that writes: its command line, with `{}` for the folder of its output, and the files that it writes
there."""


@dataclass
class Trial:
    """The result of one kind of trial: number of tries, failures, and a number to print."""

    name: str
    tries: int = 0
    failures: list[str] = field(default_factory=list)
    figure: str = ""

    def check(self, whether: bool, otherwise: str) -> None:
        """Note the failure `otherwise`, unless the condition holds."""
        if not whether:
            self.failures.append(otherwise)


class Ground:
    """A folder with small inputs of every kind, in which command lines are run."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
        (folder / "empty.toml").write_text(SCENE.replace("0.5, ", "0.9, "), encoding="utf-8")
        for line in (
            "simulate scene.toml -o sweep.nc",
            "simulate empty.toml -o background.nc --snr-db 0",
            "focus sweep.nc -o image.nc",
            "fold image.nc -o reconstruction.nc",
            "export sweep.nc -o scan",
        ):
            assert self.run(line) == 0, f"failed: {line}"

    def start(self, line: str, **more: object) -> subprocess.Popen[bytes]:
        """Start a command line, in a group of processes of its own."""
        environment = {**os.environ, "MPLBACKEND": "Agg", **more.pop("env", {})}  # type: ignore[dict-item]
        return subprocess.Popen(
            [sys.executable, "-m", "mirrorfold", *line.split()], cwd=self.folder, env=environment,
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True, **more,
        )  # type: ignore[call-overload, no-any-return]  # fmt: skip

    def run(self, line: str, **more: object) -> int:
        """Run a command line to its end; returns its exit code."""
        with self.start(line, **more) as process:
            process.communicate()
            return process.returncode

    def kill(self, line: str, after: float) -> bool:
        """Kill a command line and all processes that it started after a time [s]; False if it had ended before."""
        with self.start(line) as process:
            with suppress(subprocess.TimeoutExpired):
                process.wait(after)
            ended = process.poll() is not None
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
        return not ended


def same(first: Path, second: Path) -> bool:
    """Whether two files, or all files of two folders, have the same content."""
    if first.is_dir() and second.is_dir():
        names = {path.name for folder in (first, second) for path in folder.iterdir()}
        return all(same(first / name, second / name) for name in names)
    return first.is_file() and second.is_file() and filecmp.cmp(first, second, shallow=False)


def visible(folder: Path) -> list[Path]:
    """The files in a folder, without hidden ones."""
    return [path for path in sorted(folder.iterdir()) if not path.name.startswith(".")]


def growth(ground: Ground, quick: bool, chance: random.Random) -> Trial:
    """The memory of a process that reconstructs many times."""
    times = 200 if quick else 1000
    command = [sys.executable, "-c", GROWTH, "sweep.nc", str(times), str(WARM_UP)]
    printed = subprocess.run(command, cwd=ground.folder, capture_output=True, text=True, check=True).stdout
    first, last = map(int, printed.split())
    share = (last - first) / first
    trial = Trial("growth", times, figure=f"{100 * share:+.1f} % of {first / 1e6:.0f} MB")
    trial.check(share <= MOST_GROWTH, f"the memory has grown by {100 * share:.1f} %")
    return trial


def crowd(ground: Ground, quick: bool, chance: random.Random) -> Trial:
    """Several command lines at once, which compile into the same cache."""
    trial = Trial("crowd", 4 if quick else 10)
    cache = ground.folder / "cache"
    folders = [ground.folder / f"crowd-{number}" for number in range(trial.tries)]
    environment = {"NUMBA_CACHE_DIR": str(cache), "XDG_CACHE_HOME": str(cache)}
    processes = [ground.start(f"reconstruct sweep.nc -o {folder.name}", env=environment) for folder in folders]
    for process, folder in zip(processes, folders, strict=True):
        said = process.communicate()[1].decode()
        trial.check(process.returncode == 0, f"exit code {process.returncode}: {said}")
        picture = folder / "before_after.png"
        trial.check(same(picture, folders[0] / picture.name), f"{picture.name} differs from that of another one")
    return trial


def kills(ground: Ground, quick: bool, chance: random.Random) -> Trial:
    """Each verb is killed at random moments; afterwards each file must be the old one or the new one, complete."""
    trial = Trial("kills")
    early = 0
    for verb, (line, names) in VERBS.items():
        new, old, target = (ground.folder / name for name in ("new", "old", "out"))
        shutil.rmtree(new, ignore_errors=True)
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir()
        started = time.perf_counter()
        assert ground.run(line.format(target.name)) == 0, f"failed: {line}"
        length = time.perf_counter() - started
        target.rename(new)  # same output folder as for killed runs: pages of results tell their command
        for _ in range(2 if quick else 20):
            for folder in (old, target):
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                for name in names.split() if verb != "export Touchstone" else ():
                    (folder / name).write_bytes(b"an older file")
            early += ground.kill(line.format("out"), chance.uniform(0.0, 1.05 * length))
            trial.tries += 1
            found = visible(target)
            whole = [any(same(path, folder / path.name) or _readable(path) for folder in (old, new)) for path in found]
            trial.check(all(whole), f"{verb}: {[path.name for path in found]} not all whole")
            trial.check(
                verb == "export Touchstone" or {path.name for path in found} >= set(names.split()),
                f"{verb}: of {names} {[path.name for path in found]} are left",
            )
            assert ground.run(line.format("out")) == 0, f"failed after a kill: {line}"
            rest = [path.name for path in target.rglob(".*") if path.name.startswith(".mirrorfold")]
            trial.check(not rest, f"{verb}: {rest} are left behind")
    trial.figure = f"{early} of {trial.tries} killed at work"
    return trial


def _readable(path: Path) -> bool:
    """Whether a file of results can be read. (It cannot be compared: its attributes tell when it was made.)"""
    import mirrorfold as mf

    with suppress(mf.InputError):
        return path.suffix == ".nc" and mf.load(path) is not None
    return False


WAVES = "simulate scene.toml -o {}/a.nc --solver fullwave --workers 2"


def resumed(ground: Ground, quick: bool, chance: random.Random) -> Trial:
    """A full-wave sweep that is killed repeatedly and resumed must equal an undisturbed one."""
    trial = Trial("resumed")
    whole, length = _whole_sweep(ground)
    rounds = 0
    for number in range(1 if quick else 5):
        target = ground.folder / f"resumed-{number}"
        target.mkdir()
        ground.kill(WAVES.format(target.name), chance.uniform(0.2, 0.8) * length)
        while not (target / "a.nc").exists():
            resume = " --resume" if (target / "a.nc.frequencies").exists() else ""
            ground.kill(WAVES.format(target.name) + resume, chance.uniform(0.3, 1.3) * length)
            rounds += 1
        trial.tries += 1
        trial.check(_equal(whole, target / "a.nc"), "the resumed sweep differs")
    trial.figure = f"resumed {rounds} times"
    return trial


def full_disk(ground: Ground, quick: bool, chance: random.Random) -> Trial:
    """Files cannot grow beyond a random size: the verb must print one sentence, exit with 1, and keep old files."""
    trial = Trial("full disk")
    for _ in range(8 if quick else 50):
        verb = chance.choice(["simulate", "focus", "fold", "reconstruct", "calibrate", "import"])
        line, names = VERBS[verb]
        target = ground.folder / "out"
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir()
        name = names.split()[0]
        (target / name).write_bytes(b"an older file")
        limit = chance.randrange(1, 60_000)

        def bounded(limit: int = limit) -> None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))

        with ground.start(line.format("out"), preexec_fn=bounded) as process:
            said = process.communicate()[1].decode()
        trial.tries += 1
        if process.returncode == 0:  # all that was written was smaller than the limit
            continue
        trial.check(process.returncode == 1, f"{verb}: exit code {process.returncode}: {said}")
        sentences = [one for one in said.splitlines() if one and "note:" not in one]
        trial.check(len(sentences) == 1 and "Traceback" not in said, f"{verb}: said {said!r}")
        kept = (target / name).read_bytes() == b"an older file" and len(os.listdir(target)) == 1
        trial.check(kept, f"{verb}: {os.listdir(target)} are there, or the old file has changed")
    return trial


def damage(ground: Ground, quick: bool, chance: random.Random) -> Trial:
    """Random bits of stored parts are changed: the verb must report the damage, and give the same sweep."""
    trial = Trial("damage")
    whole, length = _whole_sweep(ground)
    hit = 0
    for number in range(2 if quick else 10):
        target = ground.folder / f"damage-{number}"
        target.mkdir()
        ground.kill(WAVES.format(target.name), 0.7 * length)
        parts = sorted((target / "a.nc.frequencies").glob("0*")) if not (target / "a.nc").exists() else []
        for path in chance.sample(parts, min(3, len(parts))):
            content = bytearray(path.read_bytes())
            content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
            path.write_bytes(content)
            hit += 1
        resume = " --resume" if (target / "a.nc.frequencies").exists() else ""
        if not (target / "a.nc").exists():
            with ground.start(WAVES.format(target.name) + resume) as process:
                said = process.communicate()[1].decode()
            trial.check(not parts or "cannot be trusted" in said, "damage was not told")
        trial.tries += 1
        trial.check(_equal(whole, target / "a.nc"), "the sweep differs after damage")
    trial.figure = f"{hit} parts damaged"
    return trial


def worker(ground: Ground, quick: bool, chance: random.Random) -> Trial:
    """One of two Dask workers is killed while it works: the other one must do the rest."""
    from distributed import LocalCluster

    trial = Trial("worker")
    whole, length = _whole_sweep(ground)
    for number in range(1 if quick else 5):
        target = ground.folder / f"worker-{number}"
        target.mkdir()
        with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
            line = WAVES.format(target.name).replace("--workers 2", f"--scheduler {cluster.scheduler_address}")
            with ground.start(line) as process:
                time.sleep(chance.uniform(0.5, 1.0) * length)
                victim = next(iter(cluster.workers.values())).process.process
                with suppress(AttributeError, ProcessLookupError):
                    os.kill(victim.pid, signal.SIGKILL)
                said = process.communicate(timeout=600)[1].decode()
        trial.tries += 1
        trial.check(process.returncode == 0, f"exit code {process.returncode}: {said}")
        trial.check((target / "a.nc").exists() and _equal(whole, target / "a.nc"), "the sweep differs")
    return trial


def _whole_sweep(ground: Ground) -> tuple[Path, float]:
    """The file of an undisturbed full-wave sweep, and the time that it takes [s]."""
    folder = ground.folder / "waves"
    started = time.perf_counter()
    if not folder.exists():
        folder.mkdir()
        assert ground.run(WAVES.format(folder.name)) == 0
        (folder / "seconds").write_text(str(time.perf_counter() - started))
    return folder / "a.nc", float((folder / "seconds").read_text())


def _equal(first: Path, second: Path) -> bool:
    """Whether the samples of two sweeps are exactly equal."""
    import mirrorfold as mf

    return bool((mf.load(first)["s"].values == mf.load(second)["s"].values).all())


TRIALS: dict[str, Callable[[Ground, bool, random.Random], Trial]] = {
    "growth": growth,
    "crowd": crowd,
    "kills": kills,
    "resumed": resumed,
    "full disk": full_disk,
    "damage": damage,
    "worker": worker,
}


def trials(names: list[str], quick: bool, seed: int) -> Iterator[tuple[Trial, float]]:
    """The trials one after the other, each with the time that it took [s]."""
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        ground = Ground(Path(folder))
        for name in names:
            started = time.perf_counter()
            yield TRIALS[name](ground, quick, random.Random(f"{seed} {name}")), time.perf_counter() - started


def main() -> int:
    """Run the trials that the command line names, and print their results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="some five minutes instead of two hours")
    parser.add_argument("--only", nargs="+", choices=list(TRIALS), default=list(TRIALS))
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    table = Table(title="Hard use", title_justify="left")
    for heading in ("trial", "tries", "failures", "figure", "time [s]"):
        table.add_column(heading)
    failed = False
    for trial, seconds in trials(options.only, options.quick, options.seed):
        table.add_row(trial.name, str(trial.tries), str(len(trial.failures)), trial.figure, f"{seconds:.0f}")
        for failure in trial.failures:
            print(f"{trial.name}: {failure}", file=sys.stderr)
        failed |= bool(trial.failures)
    Console(width=100).print(table)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
