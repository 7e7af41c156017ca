"""How much memory is free."""

from __future__ import annotations

from pathlib import Path


def available_memory() -> float:
    """Memory [bytes] that can be had without swapping; infinite where the system does not tell."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * float(line.split()[1])
    except OSError:
        pass
    return float("inf")
