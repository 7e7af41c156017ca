"""Time from a key to the picture of the live page, and size and time of the report: `benchmarks/looking.py`.

An image of 600 x 800 pixels of the hidden corner is folded with mirrors that move by 3 mm each time. Every time is the
median of several runs, with the fastest beside it. The error is the largest difference from a fold from scratch with
the same mirrors, relative to the brightest pixel.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import threading
import time
import urllib.request
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import mirrorfold as mf
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.viewing.server import TOKEN_HEADER, Server
from mirrorfold.viewing.session import Session

REPEATS = 15


def timed(act: Callable[[int], Any], repeats: int = REPEATS) -> tuple[float, float]:
    """Median and fastest time of a call [ms], without the first call."""
    times = []
    for i in range(repeats + 1):
        start = time.perf_counter()
        act(i)
        times.append(1e3 * (time.perf_counter() - start))
    return float(np.median(times[1:])), min(times[1:])


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    scene = mf.load_scene(Path(str(files("mirrorfold").joinpath("scenes", "shipped", "hidden_corner.toml"))))
    sweep = mf.simulate(scene)
    image = mf.focus(sweep, x=np.linspace(-2.3, 1.7, 800), y=np.linspace(0.2, 3.0, 600), tolerance=1e-3)
    found = mf.fold(image, sweep=sweep)
    held = found.children["mirrors"].to_dataset(inherit=False)
    lines = np.stack([held[name].values for name in ("x0", "y0", "x1", "y1")], axis=-1).reshape(-1, 2, 2)

    def moved(i: int) -> np.ndarray:
        return lines + np.array([0.003 * i, 0.0])

    table = Table(title=f"one fold of {image.sizes['y']} x {image.sizes['x']} pixels, {len(lines)} mirrors")
    for heading in ("what", "median [ms]", "fastest [ms]", "error"):
        table.add_column(heading, justify="left" if heading == "what" else "right")

    def row(what: str, act: Callable[[int], Any], error: str = "", repeats: int = REPEATS) -> None:
        median, fastest = timed(act, repeats)
        table.add_row(what, f"{median:.0f}", f"{fastest:.0f}", error)

    row("from scratch, with the sweep", lambda i: mf.fold(image, sweep=sweep), repeats=3)
    row("from scratch, given mirrors, without the sweep", lambda i: mf.fold(image, mirrors=moved(i)), repeats=5)
    plan = FoldPlan(image, sweep=sweep)
    again, scratch = (f(mirrors=moved(3))["intensity"].values for f in (
        plan.fold, lambda mirrors: mf.fold(image, sweep=sweep, mirrors=mirrors)))  # fmt: skip
    error = f"{np.abs(again - scratch).max() / scratch.max():.1e}"
    row("plan, mirror moved", lambda i: plan.fold(mirrors=moved(i)), error)
    row("plan, wall margin changed", lambda i: plan.fold(mirrors=lines, wall_margin=0.03 + 0.001 * i))
    row("plan, threshold changed", lambda i: plan.fold(mirrors=lines, threshold_db=-17.0 - 0.1 * i))
    row("plan, threshold changed, mirrors found", lambda i: plan.fold(threshold_db=-17.0 - 0.1 * i))

    with tempfile.TemporaryDirectory() as folder:
        path = mf.save(image, Path(folder) / "image.nc")
        session = Session(path)
        with Server(session) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            session.open().join()

            def ask(i: int) -> None:
                body = json.dumps({"mirrors": moved(i).tolist()}).encode()
                headers = {"Content-Type": "application/json", TOKEN_HEADER: server.token, "Cookie": server.cookie}
                request = urllib.request.Request(f"{server.address}api/fold", data=body, headers=headers)
                json.loads(urllib.request.urlopen(request).read())

            row("live page, mirror moved: request to answer", ask)
            browsed = in_browser(server.link())
            if browsed:
                table.add_row("live page, mirror moved: hand to picture", *(f"{t:.0f}" for t in browsed), "")
            server.shutdown()
        report = Path(folder) / "report.html"
        row("report", lambda i: mf.report(found, report))
        size = report.stat().st_size
    console = Console(width=110)
    console.print(table)
    console.print(f"the report has {size / 1e3:.0f} kB")


def in_browser(address: str) -> tuple[float, float] | None:
    """Median and fastest time [ms] that the page takes from a key to the next picture; None without a browser."""
    import shutil

    path = shutil.which("chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        return None
    if path is None:
        return None
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1440, "height": 1000})
        page.goto(address)
        page.wait_for_selector("html[data-ready]")
        page.locator("[data-handle='0-0']").focus()
        times = []
        for i in range(REPEATS + 1):
            page.keyboard.press("ArrowRight")
            page.wait_for_selector(f"html[data-folds='{i + 1}']")
            page.wait_for_timeout(50)
            times.append(float(page.locator("#took").inner_text().split()[2]))
        browser.close()
    return float(np.median(times[1:])), min(times[1:])


if __name__ == "__main__":
    main()
