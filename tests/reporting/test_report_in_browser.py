"""The report in a real browser: what it shows and tells, how it answers mouse and keys, and that nothing gets in."""

from __future__ import annotations

import re

import numpy as np
import pytest
import xarray as xr
from browser import number, opened, pixels, readout, settle, to_screen
from numpy.testing import assert_allclose

import mirrorfold as mf
from mirrorfold.reporting.document import to_document
from mirrorfold.reporting.page import to_html

HOSTILE = "</script><img src=x onerror=alert(1)>"


@pytest.mark.slow
def test_points_mean_the_same_in_header_tree_score_and_info(reconstruction, scene_file, tmp_path, chromium):
    """Points of objects and on walls, apart; the numbers of all places add up."""
    objects = reconstruction["objects"].to_dataset(inherit=False)
    surface = np.array(["object", "mirror", "object", "object", "mirror"])
    reconstruction["objects"] = xr.DataTree(objects.assign(surface=("point", surface)))
    info, score = mf.info(reconstruction), mf.score(reconstruction, scene_file)
    assert (info.points, info.points_on_mirrors) == (score.points, 2) == (5, 2)
    assert score.hidden.points == 5  # all claim to stand where nothing is in sight
    path = mf.report(reconstruction, tmp_path / "r.html", scene=scene_file)
    with opened(chromium, path.as_uri()) as page:
        facts = page.locator(".facts span").all_inner_texts()
        assert facts == ["1 mirror", "5 points", "3 of objects", "2 of walls", "3 seen around a corner"]
        nodes = page.locator(".tree .node .more").all_text_contents()
        assert nodes == ["points: 1 of objects, 1 of walls", "points: 2 of objects, 1 of walls"]
        assert page.locator("table:has-text('accuracy') tbody tr").first.all_inner_texts() == ["points\t5\t5"]


@pytest.mark.slow
def test_the_words_of_the_tree_fit_their_boxes(reconstruction, tmp_path, chromium):
    document = to_document(reconstruction) | {"seen": {"": [123456, 234567], "0": [1462, 2439]}}
    path = tmp_path / "many.html"
    path.write_text(to_html(document, title="many"))
    with opened(chromium, path.as_uri()) as page:
        nodes = page.locator(".tree .node").all()
        assert len(nodes) == 1 + reconstruction["mirrors"].sizes["mirror"]
        for node in nodes:
            pill, more, what = (
                node.locator(part).evaluate("(part) => { const { x, width } = part.getBBox(); return [x, x + width]; }")
                for part in (".pill", ".more", ".what")
            )
            assert pill[0] < min(more[0], what[0])
            assert max(more[1], what[1]) < pill[1] - 4


@pytest.mark.slow
def test_an_empty_reconstruction_makes_a_page(reconstruction, tmp_path, chromium):
    groups = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    groups["/mirrors"] = groups["/mirrors"].isel(mirror=slice(0))
    groups["/objects"] = groups["/objects"].isel(point=slice(0))
    groups["/"]["intensity"] = 0 * groups["/"]["intensity"]
    groups["/initial"]["initial"] = 0 * groups["/initial"]["initial"]
    path = mf.report(xr.DataTree.from_dict(groups), tmp_path / "empty.html")
    with opened(chromium, path.as_uri()) as page:
        # As the command line says.
        assert (
            page.locator(".notice").inner_text() == "No mirror was found; the image is unfolded. No object was found."
        )


@pytest.mark.slow
def test_the_browser_shows_it_without_errors_and_without_network(address, chromium):
    with opened(chromium, address) as page:
        assert "mirrorfold reconstruct sweep.nc -o out" in page.inner_text("body")
        assert page.locator(".tree .node").count() == 2
        assert page.locator(".panel[data-which=initial] .mirror").count() == 1
        assert page.locator("table").first.inner_text().count("mirror") >= 1
        for name in ("initial", "corrected"):
            assert len(np.unique(pixels(page, f".panel[data-which={name}] canvas")[..., 0])) > 50


@pytest.mark.slow
def test_hostile_names_run_nothing_in_the_browser(reconstruction, tmp_path, chromium):
    reconstruction.attrs |= {"title": HOSTILE, "command": HOSTILE, "remark": HOSTILE}
    path = mf.report(reconstruction, tmp_path / "report.html")
    with opened(chromium, path.as_uri()) as page:
        assert page.locator("h1").inner_text() == HOSTILE
        assert page.locator("img").count() == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["constructor", "__proto__"])
def test_a_chain_with_a_name_of_the_language_is_a_chain_without_points(reconstruction, tmp_path, chromium, name):
    mirrors = reconstruction["mirrors"].to_dataset(inherit=False)
    reconstruction["mirrors"] = xr.DataTree(mirrors.assign(chain=("mirror", np.array([name]))))
    with opened(chromium, mf.report(reconstruction, tmp_path / "report.html").as_uri()) as page:
        nodes = page.locator(".tree .node .more").all_text_contents()
        assert nodes == ["points: 2 of objects, 0 of walls", "points: 0 of objects, 0 of walls"]


@pytest.mark.slow
def test_a_pixel_tells_position_amplitude_bounces_and_chain(address, reconstruction, chromium):
    """In the initial image of a ghost; in the corrected one of what it is a ghost of; and of what stands free."""
    objects = reconstruction["objects"].to_dataset(inherit=False)
    with opened(chromium, address) as page:
        page.locator("[data-mode=side]").click()
        settle(page)
        for which, suffix, image in (
            ("initial", "_initial", reconstruction["initial/initial"]),
            ("corrected", "", reconstruction["intensity"]),
        ):
            for i, bounces, chain in ((3, "1 bounce", "radar \u2192 mirror 0"), (0, "in line of sight", "radar")):
                x, y = float(objects[f"x{suffix}"][i]), float(objects[f"y{suffix}"][i])
                page.mouse.move(*to_screen(page, which, x, y))
                told = readout(page)
                assert told["image"] == which
                assert told["bounces"] == bounces
                assert told["chain"] == chain
                assert number(told["confidence"]) == pytest.approx(0.9)
                place = [number(part) for part in told["position"].split(",")]
                assert_allclose(place, [x, y], atol=0.02)
                near = image.sel(x=place[0], y=place[1], method="nearest")
                zero = np.quantile(reconstruction["initial/initial"], 0.9995)
                assert number(told["amplitude"]) == pytest.approx(20 * np.log10(float(near) / zero), abs=0.25)
        x, y = float(objects["x_initial"][3]), float(objects["y_initial"][3])
        page.mouse.move(*to_screen(page, "initial", x, y))
        folded = [number(part) for part in readout(page)["folds to"].split(",")]
        assert_allclose(folded, [objects["x"][3], objects["y"][3]], atol=0.02)


@pytest.mark.slow
def test_confidence_is_told_within_a_resolution_cell(reconstruction, tmp_path, chromium):
    band = {"image_frequency_start": 290e9, "image_frequency_stop": 310e9, "image_range_resolution": 0.01}
    reconstruction.attrs |= {**band, "image_tx_aperture": 0.1}  # cells of 1.3 cm at 0.9 m
    with opened(chromium, mf.report(reconstruction, tmp_path / "r.html").as_uri()) as page:
        page.locator("[data-mode=side]").click()
        settle(page)
        for which in ("initial", "corrected"):
            page.mouse.move(*to_screen(page, which, -0.107, 0.9))
            assert number(readout(page)["confidence"]) == pytest.approx(0.9)
            page.mouse.move(*to_screen(page, which, -0.07, 0.9))
            assert readout(page)["confidence"] == "no point here"


@pytest.mark.slow
def test_the_divider_slides_by_mouse_and_keys(address, chromium):
    with opened(chromium, address) as page:
        divider, stage = page.locator(".divider"), page.locator(".stage").bounding_box()
        box = divider.bounding_box()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 60)
        page.mouse.down()
        page.mouse.move(stage["x"] + 0.25 * stage["width"], box["y"] + 60, steps=4)
        page.mouse.up()
        settle(page)
        assert abs(int(divider.get_attribute("aria-valuenow")) - 25) <= 1
        clip = page.locator(".panel").nth(1).evaluate("(panel) => panel.style.clipPath")
        assert re.search(r"(2[456]|7[456])", clip)
        page.keyboard.press("End")
        settle(page)
        assert divider.get_attribute("aria-valuenow") == "100"
        page.keyboard.press("ArrowLeft")
        settle(page)
        assert divider.get_attribute("aria-valuenow") == "98"


@pytest.mark.slow
def test_the_floor_and_the_bounces_change_the_picture(address, chromium):
    with opened(chromium, address) as page:
        page.locator("[data-mode=side]").click()
        settle(page)
        canvas = ".panel[data-which=corrected] canvas"
        before = pixels(page, canvas)
        page.locator("#floor").fill("-10")
        settle(page)
        raised = pixels(page, canvas)
        # A higher floor takes ink from the paper.
        assert raised[..., 0].mean() > before[..., 0].mean() + 10
        page.locator("[data-bounces='1']").uncheck()
        settle(page)
        hidden = pixels(page, canvas)
        orange = np.array([0xE6, 0x9F, 0x00])
        count = [int((np.abs(data[..., :3] - orange).max(axis=-1) < 30).sum()) for data in (raised, hidden)]
        assert count[0] > 10
        assert count[1] == 0
        page.locator("#confidence").fill("0.95")
        settle(page)
        green = np.array([0x00, 0x9E, 0x73])
        final = pixels(page, canvas)
        assert int((np.abs(final[..., :3] - green).max(axis=-1) < 30).sum()) == 0


@pytest.mark.slow
def test_a_node_of_the_tree_lights_its_mirror_and_its_shadow(address, chromium):
    with opened(chromium, address) as page:
        before = pixels(page, ".panel[data-which=corrected] canvas")
        page.locator(".tree .node").nth(1).focus()
        settle(page)
        assert page.locator(".panel .mirror.lit").count() == 2
        assert (pixels(page, ".panel[data-which=corrected] canvas") != before).any()
        page.locator(".tree .node").nth(1).evaluate("(node) => node.blur()")
        settle(page)
        assert page.locator(".panel .mirror.lit").count() == 0
        page.locator(".panel[data-which=initial] .mirror").focus()
        settle(page)
        assert page.locator("tbody tr.lit").count() == 1


@pytest.mark.slow
def test_switches_and_legend_follow_the_theme_of_the_page(reconstruction, scene_file, tmp_path, chromium):
    path = mf.report(reconstruction, tmp_path / "r.html", scene=scene_file)
    with opened(chromium, path.as_uri(), color_scheme="dark") as page:
        for theme in ("dark", "light", "dark"):
            scheme, legend, line = page.evaluate(
                """() => [getComputedStyle(document.querySelector('#floor')).colorScheme,
                getComputedStyle(document.querySelector('.legend .truth')).backgroundColor,
                getComputedStyle(document.querySelector('.panel .truth:not(.rim)')).stroke]"""
            )
            assert scheme == theme
            assert legend == line
            page.locator("#theme").click()
            settle(page)


@pytest.mark.slow
def test_everything_can_be_reached_and_has_a_name(address, chromium):
    with opened(chromium, address) as page:
        nameless = page.evaluate(
            """() => Array.from(document.querySelectorAll('button, select, input, [tabindex="0"], canvas')).filter(
            (node) =>
            !node.innerText && !node.ariaLabel && !(node.labels && node.labels.length) && node.ariaHidden !== 'true'
            && !node.getAttribute('aria-label')).map((node) => node.outerHTML.slice(0, 80))"""
        )
        assert nameless == []
        seen = set()
        for _ in range(40):
            page.keyboard.press("Tab")
            seen.add(
                page.evaluate("() => document.activeElement.className.baseVal ?? document.activeElement.className")
            )
        assert {"divider", "panel", "node", "mirror"} <= {word for name in seen for word in name.split()}


@pytest.mark.slow
def test_the_page_prints(address, chromium):
    with opened(chromium, address) as page:
        printed = page.pdf()
        assert printed.startswith(b"%PDF")
        assert len(printed) > 20_000


@pytest.mark.slow
def test_a_volume_turns_and_is_cut(folded_scan, tmp_path, chromium):
    path = mf.report(folded_scan, tmp_path / "volume.html")
    with opened(chromium, path.as_uri()) as page:
        before = pixels(page, "#cloud")
        page.locator("#cloud").focus()
        page.keyboard.press("ArrowLeft")
        settle(page)
        assert (pixels(page, "#cloud") != before).any()
        y = folded_scan["objects"].to_dataset(inherit=False)["y"].values
        for at in (1.7, 2.0, 2.4):
            page.locator("#slice").fill(str(at))
            settle(page)
            expected = int((np.abs(y.astype(np.float32) - at) <= 0.1).sum())
            assert abs(number(page.locator("#slice-count").inner_text()) - expected) <= 1
