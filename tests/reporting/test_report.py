"""The report: that it holds what the reconstruction says, lets nothing in, and answers in a real browser."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from browser import number, opened, pixels, readout, settle, to_screen
from levels import unpacked_levels
from numpy.testing import assert_allclose

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.folding import FoldSettings
from mirrorfold.io.netcdf import check_reconstruction
from mirrorfold.reporting.document import packed_levels, to_document
from mirrorfold.reporting.page import _asset, to_html

HOSTILE = "</script><img src=x onerror=alert(1)>"


@pytest.fixture
def address(reconstruction, scene_file, tmp_path):
    reconstruction.attrs["command"] = "mirrorfold reconstruct sweep.nc -o out"
    return mf.report(reconstruction, tmp_path / "report.html", scene=scene_file).as_uri()


class Elements(HTMLParser):
    """The names and attributes of all elements, and the texts of scripts."""

    def __init__(self, page):
        super().__init__()
        self.found, self.scripts, self.styles = [], [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def handle_data(self, data):
        if self.lasttag in ("script", "style"):
            getattr(self, f"{self.lasttag}s").append(data)


def content_of(page):
    return json.loads(re.search(r'id="content">(.*?)</script>', page, re.DOTALL)[1])


def test_levels_survive_packing_to_half_a_step():
    amplitude = np.random.default_rng(0).rayleigh(size=(40, 61)).astype(np.float32) ** 3
    amplitude[3, 5] = 0.0
    packed = packed_levels(amplitude, 0.5)
    level = unpacked_levels(packed, 40, 61)
    expected = np.maximum(20.0 * np.log10(np.where(amplitude > 0, amplitude, 1.0) / 0.5), packed["lowest"])
    assert np.isnan(level[3, 5])
    seen = amplitude > 0
    assert np.abs(level - expected)[seen].max() <= 0.5 * packed["step"] + 1e-4
    assert packed["step"] < 0.5


def test_the_document_says_what_the_reconstruction_says(reconstruction, scene_file):
    document = to_document(reconstruction, mf.load(scene_file))
    (mirror,) = document["mirrors"]
    assert mirror["chain"] == "0"
    assert_allclose(mirror["ends"], [[0.4, 1.6], [0.6, 0.9]])
    assert mirror["length"] == pytest.approx(np.hypot(0.2, 0.7))
    assert mirror["angle"] == pytest.approx(np.degrees(np.arctan2(-0.7, 0.2)) % 180)
    assert mirror["offset_error"] is None
    assert document["points"]["count"] == 5
    assert document["points"]["chains"] == ["", "0"]
    assert np.frombuffer(base64.b64decode(document["points"]["x"]), "<f4")[2] == pytest.approx(0.1)
    assert_allclose(document["truth"], [[[-0.2, 0.3], [0.2, 0.34]]])
    assert document["score"]["mirrors"][0][1] == "-"
    grid = document["grid"]
    shown = reconstruction["intensity"].sel(x=slice(*document["extent"][:2]), y=slice(*document["extent"][2:]))
    assert (grid["ny"], grid["nx"]) == shown.shape
    assert_allclose([grid["x0"], grid["y0"]], [shown["x"][0], shown["y"][0]])


def test_large_images_are_reduced_by_their_strongest_pixels(reconstruction):
    document = to_document(reconstruction, largest_image=2000)
    grid = document["grid"]
    assert grid["nx"] * grid["ny"] <= 2000
    level = unpacked_levels(document["images"]["corrected"], grid["ny"], grid["nx"])
    whole = to_document(reconstruction)
    fine = unpacked_levels(whole["images"]["corrected"], whole["grid"]["ny"], whole["grid"]["nx"])
    factor = round(grid["dx"] / whole["grid"]["dx"])
    block = fine[: factor * 4, : factor * 5].reshape(4, factor, 5, factor)
    zero = 20.0 * np.log10(document["zero_db"] / whole["zero_db"])
    assert_allclose(level[:4, :5] + zero, np.nanmax(block, axis=(1, 3)), atol=0.5)


def test_a_page_of_noise_stays_below_six_megabytes(reconstruction, tmp_path):
    random = np.random.default_rng(1)
    y, x = np.linspace(0.0, 3.0, 2400), np.linspace(-2.0, 2.5, 2500)
    groups = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    noise = random.random((2400, 2500), dtype=np.float32)
    attrs = groups["/"].attrs
    groups["/"] = xr.Dataset({"intensity": (("y", "x"), noise)}, coords={"y": y, "x": x}, attrs=attrs)
    groups["/initial"] = xr.Dataset({"initial": (("y", "x"), noise)}, coords={"y": y, "x": x})
    groups["/objects"] = groups["/objects"].isel(point=random.integers(0, 5, 90_000))
    path = mf.report(xr.DataTree.from_dict(groups), tmp_path / "noise.html")
    assert 1_000_000 < path.stat().st_size <= 6_000_000
    assert content_of(path.read_text())["points"]["total"] == 90_000


def test_nothing_from_a_file_becomes_markup(reconstruction, scene_file, tmp_path):
    scene_file.write_text(
        scene_file.read_text().replace('"wall"', json.dumps(HOSTILE)).replace("one wall", "{{program}}")
    )
    reconstruction.attrs |= {"title": HOSTILE, "command": HOSTILE, "image_note": HOSTILE, "remark": HOSTILE, HOSTILE: 1}
    page = mf.report(reconstruction, tmp_path / "report.html", scene=scene_file).read_text(encoding="utf-8")
    elements = Elements(page)
    names = [tag for tag, _ in elements.found]
    assert "img" not in names
    assert names.count("script") == 3
    assert HOSTILE not in page
    document = content_of(page)
    assert document["title"] == document["command"] == document["remark"] == HOSTILE
    assert [HOSTILE, "1"] in document["parameters"]


def test_settings_are_listed_with_unit_and_meaning_and_other_attributes_as_they_are(reconstruction):
    reconstruction.attrs |= {
        "image_tolerance": 0.0009999999, "image_taper": np.ones(41), "fold_threshold_db": -18.0,
        "fold_minimum_length": 0.24824040634138517, "fold_generations": None, "fold_opaque": True,
        "fold_of_old": 0.24824040634138517,
    }  # fmt: skip
    document = to_document(check_reconstruction(reconstruction))
    rows = {row["attr"]: row for row in document["settings"]}
    assert list(rows) == ["image_tolerance", "image_taper", *(
        f"fold_{name}" for name in FoldSettings.rules() if f"fold_{name}" in reconstruction.attrs)]  # fmt: skip
    shown = {name: (row["label"], row["value"], row["unit"]) for name, row in rows.items()}
    assert shown["image_tolerance"] == ("tolerance", "0.001", "")
    assert shown["image_taper"] == ("taper", "41 values", "")
    assert shown["fold_threshold_db"] == ("threshold", "-18", "dB")
    assert shown["fold_minimum_length"] == ("minimum length", "24.8", "cm")
    assert shown["fold_generations"] == ("generations", "default", "")
    assert shown["fold_opaque"] == ("objects are opaque", "yes", "")
    assert rows["fold_opaque"]["meaning"] == FoldSettings.rules()["opaque"].meaning
    assert ["fold_of_old", "0.2482"] in document["parameters"]
    assert not {name for name, _ in document["parameters"]} & set(rows)


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


def test_numbers_are_written_for_people(reconstruction, scene_file):
    reconstruction.attrs |= {
        "image_frequency_start": 299999999999.99994, "image_range_resolution": 0.014952241, "radar_x": 1.12e-18,
        "image_radar_position": np.array([1.12e-18, 0.0, 0.0]), "image_tx_aperture": 0.08,
        "mirrors_given": np.bool_(False), "image_ambiguous_range": 5.99584916, "image_error": 8.227144166e-05,
        "fold_wall_margin": 0.03984,
    }  # fmt: skip
    document = to_document(reconstruction, mf.load(scene_file))
    told = dict(document["parameters"])
    assert told["image_frequency_start"] == "300 GHz"
    assert told["image_range_resolution"] == "1.5 cm"
    assert told["radar_x"] == told["image_radar_position"].split(",")[0] == "0"
    assert told["image_tx_aperture"] == "8 cm"
    assert told["image_ambiguous_range"] == "6 m"
    assert told["image_error"] == "8.227e-5"
    assert told["mirrors_given"] == "no"
    (margin,) = (row for row in document["settings"] if row["attr"] == "fold_wall_margin")
    assert (margin["value"], margin["unit"]) == ("3.98", "cm")
    texts = [text for row in document["score"]["points"] for text in row[1:]]
    assert not [text for text in texts if text in ("0.000", "1.000", "0.0")]


def test_the_page_allows_its_own_program_and_nothing_else(address):
    page = Path(address.removeprefix("file://")).read_text(encoding="utf-8")
    elements = Elements(page)
    (policy,) = (attrs["content"] for tag, attrs in elements.found if attrs.get("http-equiv"))
    assert "default-src 'none'" in policy
    assert "connect-src 'none'" in policy
    for text, name in ((max(elements.scripts, key=len), "script-src"), (elements.styles[0], "style-src")):
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"{name} 'sha256-{digest}'" in policy
    for word in ("http://", "https://", "@import", "url(", "innerHTML", "eval("):
        assert word not in page.replace("http://www.w3.org/2000/svg", "")


def test_text_is_readable_on_its_ground_in_both_themes():
    """At least 4.5 to 1, as WCAG 2.1 (1.4.3) asks."""

    def luminance(colour):
        parts = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
        linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    blocks = re.findall(r":root[^{]*\{([^}]*)\}", _asset("page.css"))
    for block in blocks[:2]:
        colours = dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", block))
        for text in ("ink", "soft", "accent"):
            for ground in ("paper", "card", "stage"):
                light, dark = sorted((luminance(colours[text]), luminance(colours[ground])), reverse=True)
                assert (light + 0.05) / (dark + 0.05) >= 4.5, (text, ground, block)


def test_the_verb_writes_the_page_or_says_why_not(reconstruction, scene_file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mf.save(reconstruction, "r.nc")
    assert main(["report", "r.nc", "-o", "out.html", "--scene", str(scene_file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"] == ["out.html"]
    assert content_of((tmp_path / "out.html").read_text())["score"]["points"]
    assert main(["report", "r.nc", "-o", "r.nc"]) == 2
    assert main(["report", str(scene_file), "-o", "x.html"]) == 2
    assert not (tmp_path / "x.html").exists()


@pytest.mark.slow
def test_an_empty_reconstruction_makes_a_page(reconstruction, tmp_path, chromium):
    groups = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    groups["/mirrors"] = groups["/mirrors"].isel(mirror=slice(0))
    groups["/objects"] = groups["/objects"].isel(point=slice(0))
    groups["/"]["intensity"] = 0 * groups["/"]["intensity"]
    groups["/initial"]["initial"] = 0 * groups["/initial"]["initial"]
    path = mf.report(xr.DataTree.from_dict(groups), tmp_path / "empty.html")
    with opened(chromium, path.as_uri()) as page:
        assert "No mirror was found" in page.inner_text("body")


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


def test_the_template_is_filled_in_one_pass():
    page = to_html({"title": "{{style}}"}, title="{{program}}")
    assert "<title>{{program}} - mirrorfold</title>" in page
