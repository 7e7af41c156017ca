"""Take the pictures of docs/looking.md, beside this file; needs Chromium and mirrorfold[test]."""

from __future__ import annotations

import shutil
import tempfile
import threading
from importlib.resources import files
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Page, sync_playwright

import mirrorfold as mf
from mirrorfold.viewing.server import Server
from mirrorfold.viewing.session import Session

HERE = Path(__file__).resolve().parent
SIZE = {"width": 1360, "height": 930}


def main() -> None:
    """Simulate two shipped scenes, reconstruct them, and look at them in a browser."""
    with tempfile.TemporaryDirectory() as temporary, sync_playwright() as started:
        folder = Path(temporary)
        browser = started.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        for name, snr_db in (("hidden_corner", None), ("corridor", 20.0)):
            scene = mf.load_scene(Path(str(files("mirrorfold").joinpath("scenes", "shipped", f"{name}.toml"))))
            sweep = mf.simulate(scene, snr_db=snr_db)
            reconstruction = mf.reconstruct(sweep)
            page = mf.report(reconstruction, folder / f"{name}.html", scene=scene)
            if name == "hidden_corner":
                mf.save(sweep, folder / "sweep.nc")
                take(browser, page.as_uri(), "looking-report.png", light_a_mirror)
                take(browser, page.as_uri(), "looking-path.png", follow_a_path, color_scheme="dark")
                live(browser, folder / "sweep.nc")
            else:
                take(browser, page.as_uri(), "looking-space.png", show_space, color_scheme="dark")
        browser.close()


def take(browser: Any, address: str, name: str, act: Any, **options: Any) -> None:
    """One screenshot, in few colours to keep it small."""
    page = browser.new_page(viewport=SIZE, **options)
    page.goto(address)
    page.wait_for_selector("html[data-ready]", timeout=60_000)
    act(page)
    page.wait_for_timeout(500)
    page.screenshot(path=HERE / name)
    page.close()
    Image.open(HERE / name).convert("RGB").quantize(200, dither=Image.Dither.NONE).save(HERE / name, optimize=True)


def live(browser: Any, path: Path) -> None:
    """The live page of a sweep, one mirror moved."""
    session = Session(path)
    with Server(session) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        session.open().join()
        take(browser, server.link(), "looking-live.png", move_a_mirror)
        server.shutdown()


def light_a_mirror(page: Page) -> None:
    """Its shadow and its points."""
    page.locator(".tree .node").nth(2).focus()


def follow_a_path(page: Page) -> None:
    """A pixel of a ghost, and the way there."""
    page.locator("[data-mode=side]").click()
    page.locator("#map").select_option("magma")
    page.wait_for_timeout(300)
    box = page.locator(".panel[data-which=initial]").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.206 * box["width"], box["y"] + 0.195 * box["height"])


def move_a_mirror(page: Page) -> None:
    """By its end, four steps to the right."""
    page.locator("[data-handle='1-1']").focus()
    for count in range(4):
        page.keyboard.press("ArrowRight")
        page.wait_for_selector(f"html[data-folds='{count + 1}']")


def show_space(page: Page) -> None:
    """The cloud and the cross-section."""
    page.locator("#cloud").scroll_into_view_if_needed()
    page.evaluate("document.querySelector('#cloud').closest('section').scrollIntoView()")


if __name__ == "__main__":
    main()
