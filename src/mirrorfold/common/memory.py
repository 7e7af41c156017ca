"""How much memory is free: in the machine, in the container of this process, and below the limit of the process."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from mirrorfold.errors import InputError

PROC = Path("/proc")
"""Folder of the kernel's files on processes and on memory."""

CGROUPS = Path("/sys/fs/cgroup")
"""Folder of the control groups."""

UNASKED_BYTES = 1e6
"""For less than this, the system is not asked how much memory is free."""

CGROUP_FILES = {
    True: ("memory.max", "memory.current", "inactive_file"),
    False: ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
}
"""For control groups of version 2 (True) and version 1 (False): the files with limit and usage, and the entry of
``memory.stat`` with the part of the usage that is given back when it is needed."""


def available_memory() -> float:
    """Memory [bytes] that this process can have without swapping; infinite if the system does not tell.

    The smallest of: what is free in the machine; what is free in each control group that the process is in, such as
    that of a container or a batch job (Linux only); and what is left of the limit of its address space (``ulimit -v``).
    """
    return max(0.0, min([_of_machine(), _of_address_space(), *_of_groups()]))


def used_memory() -> float:
    """Memory [bytes] that this process holds; zero if the system does not tell."""
    held = 1024.0 * _number(PROC / "self/status", "VmRSS:")
    return held if held < float("inf") else 0.0


def room_below(limit: float | None) -> float:
    """Memory [bytes] that this process can still have: what is free, but in all no more than a limit [bytes]."""
    free = available_memory()
    return free if limit is None else min(free, limit - used_memory())


def check_room(nbytes: float, what: str, remedy: str, limit: float | None = None) -> None:
    """Refuse work that does not fit into the memory, before it begins.

    Parameters
    ----------
    nbytes : float [bytes]
        Memory that the work needs in addition to what is held already.
    what : str
        What needs it, in the plural, such as ``"an image of 10 pixels and its tables"``.
    remedy : str
        What to do, at the end of the message.
    limit : float [bytes], optional
        Memory that this process may hold in all; by default what is free counts.

    Raises
    ------
    InputError
        With the memory that is needed, the memory that is free, and the remedy.
    """
    if nbytes < UNASKED_BYTES:
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
    """By how much the address space may still grow [bytes]; memory that is reserved but never used counts as used."""
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
    """Free memory [bytes] in every control group that this process is in."""
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
        # In a container, the path may be that on the host, while the root is already the group of the container.
        folder = root / own.strip("/")
        for group in (folder, *folder.parents):
            yield _of_group(group, *CGROUP_FILES[unified])
            if group == root:
                break


def _of_group(folder: Path, limit: str, usage: str, reclaimable: str) -> float:
    """Free memory [bytes] in one control group; infinite if it has no limit, or the folder is no control group."""
    most, used = _number(folder / limit), _number(folder / usage)
    if most == float("inf") or used == float("inf"):
        return float("inf")
    cached = _number(folder / "memory.stat", reclaimable)
    return most - max(0.0, used - (cached if cached < float("inf") else 0.0))


def _number(path: Path, name: str = "") -> float:
    """The number after `name` at the beginning of a line of a file; infinite if it is missing, or is the word max."""
    try:
        for line in path.read_text().splitlines():
            words = line.split()
            if (not name and words) or words[:1] == [name]:
                return float(words[bool(name)].replace("max", "inf"))
    except (OSError, ValueError, IndexError):
        pass
    return float("inf")
