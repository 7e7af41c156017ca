"""The page under fingers, at the size of a phone: a tap points, a swipe scrolls, two fingers zoom and move."""

from __future__ import annotations

import numpy as np
import pytest
from browser import number, opened, pixels, readout, settle, to_screen
from numpy.testing import assert_allclose
from serving import served, two_walls

import mirrorfold as mf
from mirrorfold.reporting.document import to_document
from mirrorfold.reporting.page import to_html

PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True, "device_scale_factor": 2}


def to_picture(page):
    """Scroll to the picture."""
    page.locator(".stage").evaluate(
        "(stage) => window.scrollTo(0, stage.getBoundingClientRect().top + window.scrollY - 60)"
    )
    settle(page)


@pytest.fixture
def page(reconstruction, scene_file, tmp_path, chromium):
    path = mf.report(reconstruction, tmp_path / "report.html", scene=scene_file)
    with opened(chromium, path.as_uri(), **PHONE) as page:
        to_picture(page)
        yield page


def fingers(page, *paths, steps=8):
    """Fingers that go down, move along straight paths ((x0, y0), (x1, y1)) on the screen, and are lifted."""
    session = page.context.new_cdp_session(page)
    for k in range(steps + 1):
        points = [{"x": float(a[0] + (b[0] - a[0]) * k / steps), "y": float(a[1] + (b[1] - a[1]) * k / steps), "id": i}
                  for i, (a, b) in enumerate(paths)]  # fmt: skip
        session.send("Input.dispatchTouchEvent", {"type": "touchMove" if k else "touchStart", "touchPoints": points})
        page.wait_for_timeout(16)
    session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    page.wait_for_timeout(100)
    settle(page)


def scale(page):
    """Pixels of the screen for one metre, and where x = 0.5, y = 1 is."""
    a, b = (np.array(to_screen(page, "initial", 0.5, y)) for y in (1.0, 1.5))
    return float(np.abs(b - a).max()) / 0.5, a


@pytest.mark.slow
def test_the_page_fits_a_phone(page):
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 390


@pytest.mark.slow
def test_a_score_of_curved_mirrors_fits_a_phone(reconstruction, scene_file, tmp_path, chromium):
    document = to_document(reconstruction, mf.load(scene_file))
    document["score"]["mirrors"] = [["0", "pillar before the wall", "12.345", "12.34", "56.78"]]
    path = tmp_path / "curved.html"
    path.write_text(to_html(document, title="curved"))
    with opened(chromium, path.as_uri(), **PHONE) as page:
        assert page.evaluate("() => document.documentElement.scrollWidth") <= 390


@pytest.mark.slow
def test_a_tap_shows_what_pointing_shows(page, reconstruction):
    objects = reconstruction["objects"].to_dataset(inherit=False)
    page.locator("[data-mode=side]").tap()
    to_picture(page)
    for i, bounces, chain in ((3, "1 bounce", "radar \u2192 mirror 0"), (0, "in line of sight", "radar")):
        x, y = float(objects["x_initial"][i]), float(objects["y_initial"][i])
        page.touchscreen.tap(*to_screen(page, "initial", x, y))
        page.wait_for_timeout(100)
        told = readout(page)
        assert told["image"] == "initial"
        assert told["bounces"] == bounces
        assert told["chain"] == chain
        assert_allclose([number(part) for part in told["position"].split(",")], [x, y], atol=0.03)
        # It stays, and can be read where the picture is.
        page.wait_for_timeout(200)
        assert readout(page) == told
        box = page.locator("#readout").bounding_box()
        assert box["y"] + box["height"] <= 844


@pytest.mark.slow
def test_a_tap_lights_a_mirror_until_the_next_tap(page):
    page.locator("[data-mode=side]").tap()
    to_picture(page)
    ends = np.array([to_screen(page, "initial", *end) for end in ((0.4, 1.6), (0.6, 0.9))])
    page.touchscreen.tap(*(0.7 * ends[0] + 0.3 * ends[1]))
    page.wait_for_timeout(150)
    settle(page)
    assert page.locator(".panel[data-which=initial] .mirror.lit").count() == 1
    page.touchscreen.tap(*to_screen(page, "initial", -0.1, 0.9))
    page.wait_for_timeout(150)
    settle(page)
    assert page.locator(".mirror.lit").count() == 0


@pytest.mark.slow
def test_a_swipe_on_the_picture_scrolls_the_page(page):
    before, (metre, place) = page.evaluate("() => window.scrollY"), scale(page)
    box = page.locator(".panel[data-which=initial]").bounding_box()
    x, y = box["x"] + 0.2 * box["width"], box["y"] + 0.8 * box["height"]
    fingers(page, ((x, y), (x, y - 150)))
    page.wait_for_timeout(300)
    moved = page.evaluate("() => window.scrollY") - before
    assert moved > 80
    # The picture has gone with the page, and shows what it showed.
    assert scale(page)[0] == pytest.approx(metre)
    assert_allclose(scale(page)[1] - place, [0.0, -moved], atol=1.0)


@pytest.mark.slow
def test_two_fingers_zoom_about_the_place_between_them_and_move(page):
    scrolled, (metre, place) = page.evaluate("() => window.scrollY"), scale(page)
    box = page.locator(".panel[data-which=initial]").bounding_box()
    middle = np.array([box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"]])
    wide = np.array([0.0, 40.0])
    fingers(page, (middle - wide, middle - 1.5 * wide), (middle + wide, middle + 1.5 * wide))
    assert page.evaluate("() => window.scrollY") == scrolled
    now, there = scale(page)
    assert now == pytest.approx(1.5 * metre, rel=0.03)
    assert_allclose(there, middle + 1.5 * (place - middle), atol=6.0)
    assert page.evaluate("() => visualViewport.scale") == 1.0
    fingers(page, (middle - wide, middle - wide + [30, 20]), (middle + wide, middle + wide + [30, 20]))
    assert scale(page)[0] == pytest.approx(now, rel=0.02)
    assert_allclose(scale(page)[1] - there, [30.0, 20.0], atol=5.0)


@pytest.mark.slow
def test_the_divider_slides_under_a_finger(page):
    box = page.locator(".divider").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 3
    before = int(page.locator(".divider").get_attribute("aria-valuenow"))
    fingers(page, ((x, y), (x - 70, y)))
    assert int(page.locator(".divider").get_attribute("aria-valuenow")) < before - 10


@pytest.mark.slow
def test_the_cloud_of_a_volume_turns_zooms_and_lets_the_page_scroll(folded_scan, tmp_path, chromium):
    path = mf.report(folded_scan, tmp_path / "volume.html")
    with opened(chromium, path.as_uri(), **PHONE) as page:
        cloud = page.locator("#cloud")
        cloud.evaluate("(cloud) => window.scrollTo(0, cloud.getBoundingClientRect().top + window.scrollY - 100)")
        settle(page)
        shown = pixels(page, "#cloud")
        box = cloud.bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        fingers(page, ((x - 40, y), (x + 60, y)))
        turned = pixels(page, "#cloud")
        assert (turned != shown).any()
        fingers(page, ((x, y - 30), (x, y - 60)), ((x, y + 30), (x, y + 60)))
        assert (pixels(page, "#cloud") != turned).any()
        before = page.evaluate("() => window.scrollY")
        fingers(page, ((x, y), (x, y - 120)))
        page.wait_for_timeout(300)
        assert page.evaluate("() => window.scrollY") > before + 60


@pytest.mark.slow
def test_the_cloud_turns_with_one_finger_alone_whatever_was_swiped_before(folded_scan, tmp_path, chromium):
    path = mf.report(folded_scan, tmp_path / "volume.html")
    with opened(chromium, path.as_uri(), **PHONE) as page:

        def middle():
            page.locator("#cloud").evaluate(
                "(cloud) => window.scrollTo(0, cloud.getBoundingClientRect().top + window.scrollY - 100)"
            )
            settle(page)
            box = page.locator("#cloud").bounding_box()
            return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

        x, y = middle()
        before = pixels(page, "#cloud")
        near, far = ((x - 40, y), (x + 40, y)), ((x - 80, y), (x + 80, y))
        fingers(page, *zip(near, far, strict=True))
        assert (pixels(page, "#cloud") != before).any()
        fingers(page, *zip(far, near, strict=True))
        assert np.array_equal(pixels(page, "#cloud"), before)
        fingers(page, ((x, y), (x + 40, y)))
        turned = pixels(page, "#cloud")
        assert (turned != before).any()
        fingers(page, ((x + 40, y), (x, y)))
        for _ in range(2):
            fingers(page, ((x, y), (x, y - 100)))
            x, y = middle()
        fingers(page, ((x, y), (x + 40, y)))
        assert np.array_equal(pixels(page, "#cloud"), turned)


LABELS = """() => {
    const found = [], old = CanvasRenderingContext2D.prototype.fillText;
    CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
        const half = this.measureText(text).width / 2;
        if (text.startsWith('x ')) found.push([x - half, x + half]);
        old.call(this, text, x, y);
    };
    window.dispatchEvent(new Event(PRINTING ? 'beforeprint' : 'resize'));
    return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(found))));
}"""


@pytest.mark.slow
@pytest.mark.parametrize("printing", [False, True], ids=["on a phone", "on paper"])
def test_labels_of_the_cross_section_stand_apart(folded_scan, tmp_path, chromium, printing):
    path = mf.report(folded_scan, tmp_path / "volume.html")
    with opened(chromium, path.as_uri(), **({} if printing else PHONE)) as page:
        labels = np.array(page.evaluate(LABELS.replace("PRINTING", str(printing).lower())))
        assert len(labels) >= 2
        assert (np.diff(np.unique(labels, axis=0).ravel()) > 0).all()
        # Without the sliders, words say which slice it is.
        at = number(page.locator("#slice").input_value())
        assert f"at y from {at - 0.1:.2f} to {at + 0.1:.2f} m" in page.locator("#slice-count").inner_text()


@pytest.mark.slow
def test_a_mirror_is_dragged_and_drawn_by_a_finger(tmp_path, chromium):
    path = tmp_path / "image.nc"
    mf.save(two_walls(), path)
    with served(path) as server, opened(chromium, server.link(), **PHONE) as page:
        start = np.array([mirror["ends"] for mirror in server.session.state["document"]["mirrors"]])
        to_picture(page)
        handle = page.locator("[data-handle='0-2']").bounding_box()
        x, y = handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2
        # So the browser leaves the finger to the handle: were the page scrolled, the mirror would stay behind.
        assert (
            page.locator("[data-handle='0-2']").evaluate("(handle) => getComputedStyle(handle).touchAction") == "none"
        )
        fingers(page, ((x, y), (x, y + 20)))
        page.wait_for_function("() => document.querySelector('#took').innerText.includes('these mirrors')")
        page.wait_for_timeout(300)
        moved = server.session._lines[0] - start[0]
        assert_allclose(moved[0], moved[1], atol=1e-9)
        assert moved[0, 1] < -0.05
        # A second finger zooms, and moves no mirror.
        folds, metre = page.locator("html").get_attribute("data-folds"), scale(page)[0]
        handle = page.locator("[data-handle='1-2']").bounding_box()
        x, y = handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2
        fingers(page, ((x, y), (x, y)), ((x, y + 60), (x, y + 100)))
        assert scale(page)[0] > 1.3 * metre
        page.wait_for_timeout(300)
        assert page.locator("html").get_attribute("data-folds") == folds
        page.locator("[aria-label='show everything']").tap()
        page.locator("#draw").tap()
        to_picture(page)
        fingers(page, (to_screen(page, "initial", -0.3, 0.8), to_screen(page, "initial", 0.3, 0.5)))
        page.wait_for_timeout(500)
        assert len(server.session._lines) == 3
        # Who taps the other picture is told where mirrors are drawn, and can scroll again.
        page.locator("#draw").tap()
        stage = page.locator(".stage")
        assert "drawing" in stage.get_attribute("class")
        page.locator(".panel[data-which=corrected]").evaluate("(panel) => panel.scrollIntoView()")
        settle(page)
        page.touchscreen.tap(*to_screen(page, "corrected", 0.0, 2.2))
        page.wait_for_timeout(100)
        assert "Draw in the initial image" in page.locator(".notice").first.inner_text()
        assert "drawing" not in stage.get_attribute("class")
