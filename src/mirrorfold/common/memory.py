"""How much memory is free: of the machine, of the container that this process runs in, and of its own limit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from mirrorfold.errors import InputError

PROC = Path("/proc")
CGROUPS = Path("/sys/fs/cgroup")

HARMLESS_BYTES = 1e6
"""What needs less is not worth asking the system for."""

CGROUP_FILES = {
    True: ("memory.max", "memory.current", "inactive_file"),
    False: ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
}
"""Limit, usage, and the part of it that is given back when needed, in ``memory.stat``; of version 2 of control groups,
and of version 1."""


def available_memory() -> float:
    """Memory [bytes] that this process can have without swapping; infinite where the system does not tell.

    The least of what is free in the machine, in each control group above the process (those of a container or a batch
    job, Linux only), and below the limit of its address space (``ulimit -v``).
    """
    return max(0.0, min([_of_machine(), _of_address_space(), *_of_groups()]))


def used_memory() -> float:
    """Memory [bytes] that this process holds; zero where the system does not tell."""
    held = 1024.0 * _number(PROC / "self/status", "VmRSS:")
    return held if held < float("inf") else 0.0


def room_below(limit: float | None) -> float:
    """Memory [bytes] that this process can still have: what is free, and below a limit [bytes] of all that it holds."""
    free = available_memory()
    return free if limit is None else min(free, limit - used_memory())


def check_room(nbytes: float, what: str, remedy: str, limit: float | None = None) -> None:
    """Refuse what does not fit into the memory, before it is begun.

    Parameters
    ----------
    nbytes : float [bytes]
        Beyond what is held already.
    what : str
        What needs them, in the plural, such as ``"an image of 10 pixels and its tables"``.
    remedy : str
    limit : float [bytes], optional
        Of all that this process may hold; by default what is free.

    Raises
    ------
    InputError
        With what is needed, what there is, and the remedy.
    """
    if nbytes < HARMLESS_BYTES:
        return
    free = room_below(limit)
    if nbytes > free:
        where = "" if limit is None else f" below the limit of {limit / 1e9:.3g} GB"
        raise InputError(
            f"{what} need about {nbytes / 1e9:.3g} GB of memory, and {max(free, 0.0) / 1e9:.3g} GB are free{where}; "
            f"{remedy}"
        )


def _of_machine() -> float:
    return 1024.0 * _number(PROC / "meminfo", "MemAvailable:")


def _of_address_space() -> float:
    """What the address space may still grow by; what is reserved and never used counts, for the system counts it."""
    try:
        import resource
    except ImportError:  # not a Unix system
        return float("inf")
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return float("inf")
    used = 1024.0 * _number(PROC / "self/status", "VmSize:")
    return limit - used if used < float("inf") else float(limit)


def _of_groups() -> Iterator[float]:
    """What is free in every control group that this process is in."""
    try:
        lines = (PROC / "self/cgroup").read_text().splitlines()
    except OSError:
        return
    for line in lines:
        number, controllers, own = line.split(":", 2)
        unified = number == "0" and not controllers
        if not unified and "memory" not in controllers.split(","):
            continue
        root = CGROUPS if unified else CGROUPS / "memory"
        # Within a container the path may be that of the host, and the root the group of the container.
        folder = root / own.strip("/")
        for group in (folder, *folder.parents):
            yield _of_group(group, *CGROUP_FILES[unified])
            if group == root:
                break


def _of_group(folder: Path, limit: str, usage: str, reclaimable: str) -> float:
    """What is free in one control group; infinite where it has no limit, or is none."""
    most, used = _number(folder / limit), _number(folder / usage)
    if most == float("inf") or used == float("inf"):
        return float("inf")
    cached = _number(folder / "memory.stat", reclaimable)
    return most - max(0.0, used - (cached if cached < float("inf") else 0.0))


def _number(path: Path, name: str = "") -> float:
    """The number after a name at the beginning of a line of a file; infinite where there is none, or the word max."""
    try:
        for line in path.read_text().splitlines():
            words = line.split()
            if (not name and words) or words[:1] == [name]:
                return float(words[bool(name)].replace("max", "inf"))
    except (OSError, ValueError, IndexError):
        pass
    return float("inf")
