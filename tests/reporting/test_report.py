"""The report as a file: that it holds what the reconstruction says, and lets nothing in."""

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
from levels import unpacked_levels
from numpy.testing import assert_allclose

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.describing.rows import score_rows
from mirrorfold.folding import FoldSettings
from mirrorfold.io.own.checks import check_reconstruction
from mirrorfold.reporting.document import packed_levels, to_document
from mirrorfold.reporting.page import _asset, to_html

HOSTILE = "</script><img src=x onerror=alert(1)>"


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


def test_pixels_that_are_no_numbers_leave_the_others_as_they_are():
    amplitude = np.random.default_rng(1).rayleigh(size=(20, 31)).astype(np.float32)
    expected = unpacked_levels(packed_levels(amplitude, 0.5), 20, 31)
    for wrong in (np.nan, np.inf, -1.0):
        spoilt = amplitude.copy()
        spoilt[3, 5] = wrong
        level = unpacked_levels(packed_levels(spoilt, 0.5), 20, 31)
        others = np.isfinite(spoilt) & (spoilt > 0)
        assert_allclose(level[others], expected[others], atol=0.3)
        assert np.isnan(level[3, 5]) == (wrong != np.inf)


def test_places_far_from_the_origin_keep_their_digits(reconstruction, on_a_map):
    points = to_document(on_a_map)["points"]
    assert points["doubles"] == ["x", "x_initial", "y", "y_initial"]
    y = np.frombuffer(base64.b64decode(points["y"]), "<f8")
    assert_allclose(y, on_a_map["objects/y"], rtol=0.0, atol=1e-9)
    assert to_document(reconstruction)["points"]["doubles"] == []


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


@pytest.mark.slow
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
    assert document["title"] == document["command"] == HOSTILE
    assert document["remark"] == f"{HOSTILE}."
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

    light_block, dark_block, *_ = re.findall(r":root[^{]*\{([^}]*)\}", _asset("page.css"))
    for block in (light_block, dark_block):
        colours = dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", block))
        for text in ("ink", "soft", "accent"):
            for ground in ("paper", "card", "stage"):
                light, dark = sorted((luminance(colours[text]), luminance(colours[ground])), reverse=True)
                assert (light + 0.05) / (dark + 0.05) >= 4.5, (text, ground, block)


@pytest.mark.slow
def test_the_verb_writes_the_page_or_says_why_not(reconstruction, scene_file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mf.save(reconstruction, "r.nc")
    assert main(["report", "r.nc", "-o", "out.html", "--scene", str(scene_file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"] == ["out.html"]
    assert content_of((tmp_path / "out.html").read_text())["score"]["points"]
    assert main(["report", "r.nc", "-o", "r.nc"]) == 2
    assert main(["report", str(scene_file), "-o", "x.html"]) == 2
    assert not (tmp_path / "x.html").exists()


def test_the_template_is_filled_in_one_pass():
    page = to_html({"title": "{{style}}"}, title="{{program}}")
    assert "<title>{{program}} - mirrorfold</title>" in page


def test_rounded_numbers_of_a_score_keep_their_digits():
    part = {"points": 5, "accuracy_m": 0.0300001, "chamfer_m": 0.0289, "precision_2cm": 1.0, "completeness_2cm": 0.9996}
    rows = {name: value for name, value, _ in score_rows({**part, "mirrors": []})["points"]}
    assert [rows["accuracy [mm]"], rows["Chamfer distance [mm]"]] == ["30.0", "28.9"]
    assert [rows["precision at 2 cm"], rows["completeness at 2 cm"]] == ["1", "1.000"]  # 1 is exact
