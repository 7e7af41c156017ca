"""Files are there whole or not at all: on full disks, for processes that are killed, and beside what they leave."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.common import leftovers
from mirrorfold.common.cache import signature
from mirrorfold.common.leftovers import remove, temporary_name, temporary_prefix
from mirrorfold.errors import InputError
from mirrorfold.io.files import directory_written_atomically, written_atomically
from mirrorfold.io.own.frame_folder import MARK, FrameFolder

posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals and limits")


def names(folder: Path) -> list[str]:
    """Of all that is in a folder, hidden files too."""
    return sorted(path.name for path in folder.iterdir())


def run(script: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """What a script says in a process of its own, which may die of it."""
    command = [sys.executable, "-c", script, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


FULL_DISK = """
import os, resource, signal, sys
from pathlib import Path
import mirrorfold as mf
from mirrorfold.cli import main

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
os.chdir(sys.argv[1])
files = sorted(Path().iterdir())
for path in files:
    found, before = mf.load(path), path.read_bytes()
    for limit in range(0, len(before), len(before) // 12):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
        try:
            mf.save(found, path)
        except OSError as error:
            assert error.filename == str(path) and error.errno == 27, error
        else:
            raise SystemExit(f"{limit} bytes were enough")
        assert path.read_bytes() == before
        assert sorted(Path().iterdir()) == files
code = main(["import", "sweep.nc", "-o", "out.nc"])
assert sorted(Path().iterdir()) == files
raise SystemExit(code)
"""


@posix
@pytest.mark.slow
def test_a_disk_that_is_full_is_one_sentence_and_leaves_the_old_file(sweep, reconstruction, tmp_path):
    """A limit to the size of files fails where a full disk does, here after so many bytes of the file."""
    mf.save(reconstruction, tmp_path / "reconstruction.nc")
    mf.save(sweep, tmp_path / "sweep.nc")
    done = run(FULL_DISK, tmp_path)
    words = "out.nc: cannot be read or written (File too large); make room, or choose another place"
    assert done.stderr == f"mirrorfold: {words}\n"
    assert done.returncode == 1


@posix
@pytest.mark.slow
@pytest.mark.parametrize("size", [16, 28, 36])
def test_a_small_disk(sweep, tmp_path, size):
    """A disk in memory of so many kibibytes: too small for the samples, and just too small for the rest."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}k", "tmpfs", str(disk)], capture_output=True)
    if mounted.returncode:
        pytest.skip("only the administrator may mount a disk")
    try:
        done = run("import sys, mirrorfold as mf; mf.save(mf.load(sys.argv[1]), sys.argv[2])",
                   mf.save(sweep, tmp_path / "a.nc"), disk / "b.nc")  # fmt: skip
        assert done.returncode == 1
        assert done.stderr.splitlines()[-1].startswith("OSError: [Errno 28] ")
        assert names(disk) == []
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_a_file_that_cannot_fit_is_not_begun(sweep, tmp_path, monkeypatch, capsys):
    path = mf.save(sweep, tmp_path / "a.nc")
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=sweep["s"].nbytes - 1))
    monkeypatch.setattr("mirrorfold.io.own.netcdf.SteadyFile", None)
    with pytest.raises(OSError, match=r"needs 0\.0266 MB of disk, and 0\.0266 MB are free") as caught:
        mf.save(sweep, path)
    assert caught.value.errno == errno.ENOSPC
    assert main(["import", str(path), "-o", str(tmp_path / "b.nc")]) == 1
    assert "make room, or choose another place" in capsys.readouterr().err
    assert names(tmp_path) == ["a.nc"]


INTERRUPTED_WRITES = """
import signal, sys
import mirrorfold as mf
from mirrorfold.io.own.steady import SteadyFile

write, calls = SteadyFile.write, []
def interrupted(self, content):
    calls.append(1)
    if len(calls) == number:
        signal.raise_signal(signal.SIGINT)
    return write(self, content)
SteadyFile.write = interrupted
found = mf.load(sys.argv[1])
for number in (1, 10, 30):
    calls.clear()
    try:
        mf.save(found, sys.argv[2])
    except KeyboardInterrupt:
        continue
    raise SystemExit("was not interrupted")
"""


@posix
@pytest.mark.slow
def test_ctrl_c_within_the_library_that_writes_is_survived(sweep, tmp_path):
    done = run(INTERRUPTED_WRITES, mf.save(sweep, tmp_path / "a.nc"), tmp_path / "b.nc")
    assert (done.returncode, done.stderr) == (0, "")
    assert not [name for name in names(tmp_path) if name.startswith(".")]


@posix
@pytest.mark.slow
def test_results_of_a_benchmark_are_not_cut_off_silently(tmp_path):
    """A disk that takes half of a line says nothing of it but how many bytes it took."""
    script = """
import resource, signal, sys
from pathlib import Path
from mirrorfold.benchmarking.results import append
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))
try:
    append(Path(sys.argv[1]), [{"family": "corridor" * 20}])
except OSError:
    raise SystemExit(7)
"""
    assert run(script, tmp_path / "scenes.jsonl").returncode == 7


def test_a_pipe_among_the_results_of_a_benchmark_is_refused(tmp_path):
    from mirrorfold.benchmarking.results import open_results

    os.mkfifo(tmp_path / "scenes.jsonl")
    with pytest.raises(InputError, match="would be replaced"):
        open_results(tmp_path / "scenes.jsonl")


def test_what_has_come_since_is_not_replaced_either(tmp_path):
    path = tmp_path / "a.txt"
    with pytest.raises(InputError, match="would be replaced"), written_atomically(path) as temporary:
        temporary.write_text("x")
        os.mkfifo(path)
    assert names(tmp_path) == ["a.txt"]
    assert path.is_fifo()


def test_a_link_that_leads_to_itself_is_refused(tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(InputError, match="leads to itself"), written_atomically(tmp_path / "a") as temporary:
        temporary.write_text("x")
    assert (tmp_path / "a").is_symlink()


@posix
def test_a_pipe_under_a_name_of_the_system_is_refused(tmp_path):
    reading, writing = os.pipe()
    try:
        with (
            pytest.raises(InputError, match="is a device, a pipe or a socket"),
            written_atomically(f"/dev/fd/{writing}"),
        ):
            pass
    finally:
        os.close(reading)
        os.close(writing)


def test_a_file_is_on_the_disk_before_it_gets_its_name(tmp_path, monkeypatch):
    steps = []
    sync, replace = os.fsync, os.replace

    def watched_sync(handle):
        steps.append(("sync", os.readlink(f"/proc/self/fd/{handle}")))
        sync(handle)

    def watched_replace(source, target):
        steps.append(("replace", str(source)))
        replace(source, target)

    monkeypatch.setattr(os, "fsync", watched_sync)
    monkeypatch.setattr(os, "replace", watched_replace)
    with written_atomically(tmp_path / "a.txt") as temporary:
        temporary.write_text("x")
    assert steps == [("sync", str(temporary)), ("replace", str(temporary)), ("sync", str(tmp_path))]


def test_a_folder_is_replaced_as_one(tmp_path):
    (tmp_path / "notes").write_text("mine")
    for name in ("a", "only before"):
        (tmp_path / name).write_text("old")
    with directory_written_atomically(tmp_path, replaces=["a", "only before", "never"]) as temporary:
        for name in "ab":
            (temporary / name).write_text("new")
        assert (tmp_path / "only before").read_text() == "old"
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"notes": "mine", "a": "new", "b": "new"}


KILLED = """
import os, signal, sys
from pathlib import Path
from mirrorfold.io.files import directory_written_atomically

folder, last = Path(sys.argv[1]), int(sys.argv[2])
steps = 0

def watched(function):
    def wrapper(*args, **options):
        global steps
        if args and ".mirrorfold" in str(args[0]) or str(folder) in str(args[0]):
            steps += 1
            if steps > last:
                os.kill(os.getpid(), signal.SIGKILL)
        return function(*args, **options)
    return wrapper

with directory_written_atomically(folder, replaces=["data", "picture", "third"]) as temporary:
    for name in ("data", "picture", "table"):
        (temporary / name).write_text("new")
    for name in ("replace", "rename", "unlink", "rmdir"):
        setattr(os, name, watched(getattr(os, name)))
"""


@posix
@pytest.mark.slow
def test_a_kill_between_two_files_leaves_no_old_one_beside_a_new_one(tmp_path):
    """Killed before each step in turn: what shows is all old or all new, and the next run completes what was begun."""
    old = {"data": "old", "picture": "old", "third": "old"}
    new = {"data": "new", "picture": "new", "table": "new"}
    seen = []
    for last in range(100):
        folder = tmp_path / str(last)
        folder.mkdir()
        for name, text in old.items():
            (folder / name).write_text(text)
        done = run(KILLED, folder, last)
        shown = {path.name: path.read_text() for path in folder.iterdir() if not path.name.startswith(".")}
        assert len(set(shown.values())) <= 1, shown
        seen.append(len(shown))
        with written_atomically(folder / "another") as temporary:
            temporary.write_text("another")
        after = {path.name: path.read_text() for path in folder.iterdir()}
        assert after in ({**old, "another": "another"}, {**new, "another": "another"})
        if done.returncode == 0:
            break
        assert done.returncode == -signal.SIGKILL, done.stderr
    assert last >= 7  # the name of the folder, three old files, three new ones
    assert 0 in seen


def dead() -> int:
    """The number of a process that has ended."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_leftovers_of_the_dead_are_removed_and_nothing_else(tmp_path, monkeypatch):
    machine, process = temporary_prefix().split("-")[1:3]
    gone = dead()
    left = [f".mirrorfold-{machine}-{gone}-0123abcd.nc", f"mirrorfold-{machine}-{gone}-abcd_123", "."]
    kept = [
        f".mirrorfold-{machine}-{process}-0123abcd.nc",  # of a process that lives
        f".mirrorfold-{machine}-1-0123abcd.nc",  # likewise, of another user perhaps
        f".mirrorfold-00000000-{gone}-0123abcd.nc",  # of another machine, where the number says nothing
        ".mirrorfold-notes",
        "mirrorfold-results",
        f"copy of .mirrorfold-{machine}-{gone}-0123abcd.nc",
    ]
    (tmp_path / left[0]).touch()
    (tmp_path / left[1]).mkdir()
    (tmp_path / left[1] / "system.pickle").touch()
    for name in kept:
        (tmp_path / name).touch()
    (tmp_path / "precious").mkdir()
    link = tmp_path / f".mirrorfold-{machine}-{gone}-11111111"
    link.symlink_to(tmp_path / "precious")
    with written_atomically(tmp_path / "a.txt") as temporary:
        temporary.write_text("x")
    assert names(tmp_path) == sorted([*kept, "precious", link.name, "a.txt"])
    old = time.time() - 2 * leftovers.OLD
    os.utime(tmp_path / kept[2], (old, old))
    with monkeypatch.context() as patch:  # in a folder for all, somebody else's
        patch.setattr(os, "getuid", lambda: -1)
        leftovers.remove_leftovers(tmp_path)
    assert (tmp_path / kept[2]).exists()
    leftovers.remove_leftovers(tmp_path)
    assert not (tmp_path / kept[2]).exists()


def test_names_of_a_folder_that_was_killed_lead_nowhere_else(tmp_path):
    """What says which files go may be damaged, or made to harm."""
    machine = temporary_prefix().split("-")[1]
    complete = tmp_path / "out" / f".mirrorfold-{machine}-{dead()}-0123abcd.complete"
    complete.mkdir(parents=True)
    (complete / ".replaces").write_text(f"../precious\n{tmp_path / 'precious'}")
    (complete / "data").write_text("new")
    (complete / ".signature").write_text(signature(complete.name))
    (tmp_path / "precious").touch()
    with written_atomically(tmp_path / "out" / "a.txt") as temporary:
        temporary.write_text("x")
    assert names(tmp_path) == ["out", "precious"]
    assert names(tmp_path / "out") == ["a.txt", "data"]


def test_a_folder_that_cannot_be_completed_is_in_nobodys_way(tmp_path):
    machine = temporary_prefix().split("-")[1]
    complete = tmp_path / f".mirrorfold-{machine}-{dead()}-0123abcd.complete"
    complete.mkdir()
    (complete / "data").write_text("new")
    (complete / ".signature").write_text(signature(complete.name))
    (tmp_path / "data").mkdir()
    for _ in range(2):
        with written_atomically(tmp_path / "a.txt") as temporary:
            temporary.write_text("x")
    (tmp_path / "data").rmdir()
    with written_atomically(tmp_path / "a.txt") as temporary:
        temporary.write_text("x")
    assert names(tmp_path) == ["a.txt", "data"]
    assert (tmp_path / "data").read_text() == "new"


def test_a_folder_that_is_half_removed_does_not_pass_for_a_whole_one(tmp_path, monkeypatch):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "00001.npy").touch()

    def killed(path):
        raise OSError("killed")

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "rmtree", killed)
        remove(tmp_path / "results")
    assert not (tmp_path / "results").exists()
    assert len(names(tmp_path)) == 1


@pytest.mark.slow
def test_frames_are_not_lost_when_their_mark_is_written_again(reconstruction, tmp_path):
    """A kill while the mark is written would have the frames pass for those of other settings."""
    (tmp_path / "a.nc").write_text("input")
    frames = FrameFolder(tmp_path / "frames", [tmp_path / "a.nc"], {})
    frames[0] = reconstruction
    before = (frames.folder / MARK).stat()
    frames[1] = reconstruction
    after = (frames.folder / MARK).stat()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert list(FrameFolder(frames.folder, [tmp_path / "a.nc"], {})) == [0, 1]


def test_the_longest_names_can_be_written(tmp_path):
    path = tmp_path / f"{'n' * 248}.txt"
    with written_atomically(path) as temporary:
        temporary.write_text("x")
    assert path.read_text() == "x"
    assert len(temporary_name(".txt")) < 100
