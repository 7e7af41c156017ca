"""Time of whole commands, from the file to the report: `benchmarks/from_file_to_report.py`.

The first `demo` compiles all kernels, into a cache that is deleted afterwards; the later ones find them there.
`reconstruct` then reads the demo's sweep of 161 x 161 antennas and 401 frequencies. Every time is that of a process as
a user starts it, including imports. The errors are the largest angle between a mirror and its true wall for `demo`, and
the error of the image against the float64 sum for `reconstruct`.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

import mirrorfold as mf

REPEATS = 3


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    table = Table(title="whole commands")
    for heading in ("what", "time [s]", "cores' time [s]", "error"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    with tempfile.TemporaryDirectory() as folder:
        demo, out = Path(folder) / "demo", Path(folder) / "out"
        environment = os.environ | {"NUMBA_CACHE_DIR": str(Path(folder) / "kernels")}

        def run(*arguments: str | Path) -> tuple[float, float]:
            """Time of one command, and the time that it keeps cores busy [s]."""
            before, start = _busy(), time.perf_counter()
            subprocess.run(
                [sys.executable, "-m", "mirrorfold", *arguments], env=environment, check=True, capture_output=True
            )
            return time.perf_counter() - start, _busy() - before

        def row(what: str, took: list[tuple[float, float]], error: str = "") -> None:
            wall, busy = sorted(took)[len(took) // 2]
            table.add_row(what, f"{wall:.1f}", f"{busy:.1f}", error)

        row("demo, first time", [run("demo", "--out", demo)])
        score = json.loads((demo / "score.json").read_text(encoding="utf-8"))
        off = max(mirror["angle_error_deg"] for mirror in score["mirrors"] if mirror["angle_error_deg"] is not None)
        row("demo, again", [run("demo", "--out", demo) for _ in range(REPEATS)], f"mirrors {off:.3f} degrees")
        run("reconstruct", demo / "sweep.nc", "-o", out)
        took = [run("reconstruct", demo / "sweep.nc", "-o", out) for _ in range(REPEATS)]
        error = mf.load(out / "reconstruction.nc").attrs["image_error"]
        row("reconstruct", took, f"image {error:.1e}")
    Console(width=110).print(table)


def _busy() -> float:
    """Time that cores have worked for child processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
