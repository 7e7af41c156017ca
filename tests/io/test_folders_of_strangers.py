"""A folder that comes from a stranger may hold what looks like the leftovers of our own programs, and links."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mirrorfold.common import cache, leftovers
from mirrorfold.common.cache import is_signed, signature
from mirrorfold.io.files import written_atomically

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs POSIX owners and links")


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch) -> Path:
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    return folder / "mirrorfold"


def waiting(folder: Path, *, machine: str | None = None) -> Path:
    """A folder of results that a dead process seems to have left, a week ago."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    machine = machine or leftovers.temporary_prefix().split("-")[1]
    complete = folder / f".mirrorfold-{machine}-{process.pid}-0123abcd.complete"
    complete.mkdir(parents=True)
    (complete / "readme.txt").write_text("new")
    (complete / ".replaces").write_text("old.txt\nreadme.txt")
    return complete


def aged(path: Path) -> None:
    old = time.time() - 2 * leftovers.OLD
    os.utime(path, (old, old))


def write_there(folder: Path) -> None:
    with written_atomically(folder / "a.txt") as temporary:
        temporary.write_text("x")


@pytest.mark.parametrize("machine", [None, "0badcafe"])
@pytest.mark.parametrize("said", [None, "", "0" * 64])
def test_results_that_another_has_left_are_not_completed(tmp_path, machine, said):
    """Neither its links nor its own files are written to, though the name of the machine was guessed."""
    secret, folder = tmp_path / "secret", tmp_path / "theirs"
    secret.write_text("mine")
    complete = waiting(folder, machine=machine)
    if said is not None:
        (complete / ".signature").write_text(said)
    (folder / "readme.txt").symlink_to(secret)
    (folder / "old.txt").symlink_to(secret)
    aged(complete)
    write_there(folder)
    assert secret.read_text() == "mine"
    assert (folder / "readme.txt").is_symlink()
    assert (complete / "readme.txt").read_text() == "new"
    leftovers.remove_leftovers(folder)
    assert complete.exists()


def test_completing_own_results_replaces_links_and_does_not_follow_them(tmp_path):
    secret, folder = tmp_path / "secret", tmp_path / "ours"
    secret.write_text("mine")
    complete = waiting(folder)
    (complete / ".signature").write_text(signature(complete.name))
    (folder / "readme.txt").symlink_to(secret)
    (folder / "old.txt").symlink_to(secret)
    write_there(folder)
    assert secret.read_text() == "mine"
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"a.txt": "x", "readme.txt": "new"}
    assert not (folder / "readme.txt").is_symlink()


def test_a_signature_is_of_one_text_and_of_one_key(own_cache):
    found = signature("a")
    assert is_signed("a", found)
    assert not is_signed("b", found)
    assert not is_signed("a", "\xff")
    assert (own_cache / "key").stat().st_mode & 0o777 == 0o600
    (own_cache / "key").unlink()
    assert not is_signed("a", found)


@pytest.mark.parametrize("content", [b"", b"too short"])
def test_a_damaged_key_is_made_anew(own_cache, content):
    signature("a")
    (own_cache / "key").write_bytes(content)
    assert is_signed("a", signature("a"))
    assert len((own_cache / "key").read_bytes()) == cache.KEY_BYTES


def test_a_key_that_others_may_know_signs_nothing(own_cache):
    signature("a")
    (own_cache / "key").chmod(0o644)
    assert signature("a") is None
    assert not is_signed("a", "")
