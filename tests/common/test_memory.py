"""Free memory, as the machine, a container and a limit of the process tell it."""

from __future__ import annotations

import subprocess
import sys

import pytest

from mirrorfold.common import memory

GIGABYTE = 1 << 30


@pytest.fixture
def system(tmp_path, monkeypatch):
    """A machine with 8 GiB free; returns a function that writes its files."""
    monkeypatch.setattr(memory, "PROC", tmp_path / "proc")
    monkeypatch.setattr(memory, "CGROUPS", tmp_path / "cgroup")
    monkeypatch.setattr(memory, "_of_address_space", lambda: float("inf"))

    def write(**files):
        for name, content in files.items():
            path = tmp_path / name.replace("__", "/")
            path.parent.mkdir(parents=True, exist_ok=True)
            (path.parent / path.name.replace("_DOT_", ".")).write_text(str(content))

    write(proc__meminfo=f"MemTotal: 16777216 kB\nMemAvailable:  {8 << 20} kB\n")
    return write


def test_a_machine_without_limits_has_what_it_says(system):
    assert memory.available_memory() == 8 * GIGABYTE
    system(proc__self__cgroup="0::/user\n", cgroup__user__memory_DOT_max="max\n",
           cgroup__user__memory_DOT_current=GIGABYTE)  # fmt: skip
    assert memory.available_memory() == 8 * GIGABYTE


def test_control_groups_of_version_2_count_with_all_above_them(system):
    system(
        proc__self__cgroup="0::/job/step\n",
        cgroup__job__memory_DOT_max=3 * GIGABYTE,
        cgroup__job__memory_DOT_current=2 * GIGABYTE,
        cgroup__job__memory_DOT_stat=f"anon 5\ninactive_file {GIGABYTE // 2}\nactive_file 7\n",
        cgroup__job__step__memory_DOT_max="max",
        cgroup__job__step__memory_DOT_current=GIGABYTE,
    )
    assert memory.available_memory() == 1.5 * GIGABYTE  # files that are cached are given back


def test_the_root_is_the_group_of_a_container_that_shows_the_path_of_its_host(system):
    system(proc__self__cgroup="0::/docker/0123\n", cgroup__memory_DOT_max=GIGABYTE, cgroup__memory_DOT_current=0)
    assert memory.available_memory() == GIGABYTE


def test_control_groups_of_version_1(system):
    system(
        proc__self__cgroup="9:name=systemd:/\n5:cpu,cpuacct:/a\n4:memory:/a\n0::/\n",
        cgroup__memory__memory_DOT_limit_in_bytes=9223372036854771712,
        cgroup__memory__memory_DOT_usage_in_bytes=6 * GIGABYTE,
        cgroup__memory__a__memory_DOT_limit_in_bytes=2 * GIGABYTE,
        cgroup__memory__a__memory_DOT_usage_in_bytes=GIGABYTE,
        cgroup__memory__a__memory_DOT_stat=f"total_inactive_file {GIGABYTE // 4}\n",
    )
    assert memory.available_memory() == 1.25 * GIGABYTE


def test_a_group_that_is_over_its_limit_has_nothing_left(system):
    system(proc__self__cgroup="0::/\n", cgroup__memory_DOT_max=GIGABYTE, cgroup__memory_DOT_current=2 * GIGABYTE)
    assert memory.available_memory() == 0.0


def test_files_that_say_nothing_limit_nothing(system):
    system(proc__self__cgroup="0::/\n", cgroup__memory_DOT_max="", cgroup__memory_DOT_current="?", proc__meminfo="")
    assert memory.available_memory() == float("inf")


@pytest.mark.slow
def test_a_limit_of_the_address_space_counts():
    pytest.importorskip("resource")
    script = (
        "import resource; resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))\n"
        "from mirrorfold.common.memory import available_memory\n"
        "free = available_memory(); block = bytearray(int(0.8 * free))\n"
        "print(free, available_memory())"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    free, left = map(float, found)
    assert 0.5 * GIGABYTE < free < GIGABYTE
    assert left == pytest.approx(0.2 * free, rel=0.05)


def limited(gigabytes, *lines):
    """What lines of Python print under a hard limit of the address space [GB]."""
    script = "\n".join([
        "import resource, mirrorfold as mf",
        f"resource.setrlimit(resource.RLIMIT_AS, (int({gigabytes}e9),) * 2)", *lines,
    ])  # fmt: skip
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


HUGE = {
    "elements": '{"elements": 1000000000, "pitch": 5e-4}, "band": {"start": 290e9, "stop": 300e9, "points": 3}',
    "frequencies": '{"elements": 3, "pitch": 5e-4}, "band": {"start": 290e9, "stop": 300e9, "points": 1000000000}',
}


@pytest.mark.slow
@pytest.mark.parametrize("what", HUGE)
def test_a_scene_of_a_billion_is_refused_before_anything_is_made(what):
    pytest.importorskip("resource")
    said = limited(
        3,
        "try:",
        f'    mf.parse_scene({{"name": "n", "array": {HUGE[what]}}})',
        "except mf.InputError as error:",
        "    print(error)",
    )
    assert f"1000000000 {what} need about" in said
    assert "GB are free; give fewer" in said
    assert "\n" not in said.strip()
