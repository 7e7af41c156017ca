"""A real browser for the tests, without a window; what it says and what it asks the network for is written down."""

from __future__ import annotations

import base64
import io
import re
import shutil
from contextlib import contextmanager

import numpy as np
import pytest
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


@pytest.fixture(scope="session")
def chromium():
    """A headless Chromium."""
    api = pytest.importorskip(
        "playwright.sync_api", reason="the extra mirrorfold[test] has playwright, which is absent"
    )
    path = next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip("no Chromium on the PATH; on Debian `apt-get install chromium` brings it")
    with api.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


@contextmanager
def opened(chromium, address, **options):
    """A page that has drawn itself; at the end it must have had no errors, and no requests beyond its own origin."""
    context = chromium.new_context(**{"viewport": {"width": 1280, "height": 900}} | options)
    page = context.new_page()
    complaints, requests = [], []
    loud = ("error", "warning")
    page.on("console", lambda message: complaints.append(message.text) if message.type in loud else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("dialog", lambda dialog: (complaints.append(f"dialog {dialog.message}"), dialog.dismiss()))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(address)
    page.wait_for_selector("html[data-ready]", timeout=30_000)
    settle(page)
    yield page
    context.close()
    assert complaints == []
    origin = address.split("?")[0].rstrip("/")
    assert [url for url in requests if not url.startswith((origin, "data:", "blob:"))] == []


def settle(page):
    """Wait until everything that has changed is drawn."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def readout(page):
    """What the page says of the place under the pointer, by name."""
    settle(page)
    names, texts = (page.locator(f"#readout {tag}").all_inner_texts() for tag in ("dt", "dd"))
    return dict(zip(names, texts, strict=True))


def number(text):
    """The first number in a text."""
    return float(re.search(r"-?\d+(\.\d+)?", text.replace("\u2212", "-"))[0])


def pixels(page, selector):
    """The pixels of a canvas, (height, width, 4)."""
    address = page.evaluate("(selector) => document.querySelector(selector).toDataURL()", selector)
    picture = base64.b64decode(address.partition(",")[2])
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGBA")).astype(int)


def to_screen(page, which, x, y):
    """Where a place [m] of an image is on the screen, by the ticks that the page itself draws.

    The page's own projection is not asked: ticks are read, and a straight line laid through them.
    """
    box = page.locator(f".panel[data-which={which}]").bounding_box()
    ticks = page.evaluate(
        """(which) => Array.from(document.querySelectorAll(`.panel[data-which=${which}] .tick`)).map((t) => {
        const line = t.previousElementSibling;
        return [t.textContent, +line.getAttribute('x1'), +line.getAttribute('x2'), +line.getAttribute('y1'),
                +line.getAttribute('y2')]; })""",
        which,
    )
    ticks = [(number(text), *place) for text, *place in ticks if not text.endswith("[m]")]
    across = [(value, x1) for value, x1, x2, _, _ in ticks if x1 == x2]
    up = [(value, y1) for value, _, _, y1, y2 in ticks if y1 == y2]

    def project(pairs, value):
        (a, pa), (b, pb) = pairs[0], pairs[-1]
        return pa + (pb - pa) * (value - a) / (b - a)

    return box["x"] + project(across, x), box["y"] + project(up, y)
