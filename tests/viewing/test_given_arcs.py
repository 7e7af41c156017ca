"""Curved mirrors in the pages: they stay curved whatever is edited, and what they show is folded by their tangents."""

from __future__ import annotations

import re

import numpy as np
import pytest
from browser import opened, readout, settle, to_screen
from serving import WALLS, served, two_walls

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.common.arcs import circle_through
from mirrorfold.detection.mirrors.known_mirrors import read_mirrors
from mirrorfold.viewing.lines import line_of

ARC = np.array([WALLS[0][0], np.add(WALLS[0].mean(axis=0), [-0.07, -0.03]), WALLS[0][1]])
LINE = np.array([WALLS[1][0], WALLS[1].mean(axis=0), WALLS[1][1]])


def radii(reconstruction):
    """Of the curved mirrors [m]."""
    curvature = reconstruction["mirrors/curvature"].values
    return 1.0 / np.abs(curvature[curvature != 0.0])


def radius_of(points):
    return circle_through(*points[:, None])[1][0]


@pytest.fixture
def folded():
    """A reconstruction with an arc and a line that were given."""
    return mf.fold(two_walls(), mirrors=[ARC, LINE])


@pytest.fixture
def file(folded, tmp_path):
    mf.save(folded, tmp_path / "arc.nc")
    return tmp_path / "arc.nc"


@pytest.mark.slow
def test_arcs_stay_arcs_when_a_line_is_switched_off_and_in_what_is_saved(file, chromium):
    with served(file) as server, opened(chromium, server.link()) as page:
        assert page.locator("[data-handle='0-2']").count() == 1
        page.locator("[data-line='1']").uncheck()
        page.wait_for_selector("html[data-folds='1']")
        np.testing.assert_allclose(radius_of(server.session._lines[0]), radius_of(ARC))
        page.locator("#save").click()
        page.wait_for_selector("#saved pre")
        command = page.locator("#saved pre").inner_text()
    saved = file.with_name("arc.edited.nc")
    np.testing.assert_allclose(radii(mf.load(saved)), radius_of(ARC))
    np.testing.assert_allclose(radius_of(read_mirrors(saved.with_suffix(".mirrors.json"))[0]), radius_of(ARC))
    assert main(command.split()[1:]) == 0
    np.testing.assert_allclose(radii(mf.load(saved)), radius_of(ARC))
    with served(saved) as server:  # and what is opened again holds the arc
        assert [len(line) for line in server.session.state["document"]["lines"]] == [3]


@pytest.mark.slow
def test_an_arc_moves_with_its_handles(file, chromium):
    with served(file) as server, opened(chromium, server.link()) as page:
        before = server.session._lines[0]
        page.locator("[data-handle='0-2']").focus()
        page.keyboard.press("ArrowUp")
        page.wait_for_selector("html[data-folds='1']")
        shifted = server.session._lines[0]
        np.testing.assert_allclose(shifted - before, [[0.0, 0.01]] * 3, atol=1e-12)
        page.locator("[data-handle='0-1']").focus()
        page.keyboard.press("ArrowRight")
        page.wait_for_selector("html[data-folds='2']")
        bent = server.session._lines[0]
    # It keeps its shape: the radius grows as the chord does.
    grown = np.linalg.norm(bent[2] - bent[0]) / np.linalg.norm(ARC[2] - ARC[0])
    np.testing.assert_allclose(radius_of(bent), grown * radius_of(ARC))
    np.testing.assert_allclose(bent[2] - ARC[2], [0.01, 0.01], atol=1e-12)


@pytest.mark.slow
def test_the_report_draws_arcs_and_folds_by_their_tangents(folded, tmp_path, chromium):
    objects = folded["objects"].to_dataset(inherit=False)
    shown = np.flatnonzero((objects["chain"].values == "0") & (objects["surface"].values == "object"))
    point = objects.isel(point=shown[np.argmax(objects["confidence"].values[shown])])
    seemed, place = ([float(point[axis + end]) for axis in "xy"] for end in ("_initial", ""))
    path = mf.report(folded, tmp_path / "report.html")
    with opened(chromium, path.as_uri()) as page:
        page.locator("[data-mode=side]").click()
        settle(page)
        for panel in ("initial", "corrected"):
            line = page.locator(f".panel[data-which={panel}] .mirror[data-number='0'] .line").get_attribute("points")
            drawn = np.array([point.split(",") for point in line.split()], dtype=float)
            chord, middle = drawn[[0, -1]], drawn[len(drawn) // 2]
            bulge = np.linalg.norm(middle - chord.mean(axis=0)) / np.linalg.norm(chord[1] - chord[0])
            assert bulge == pytest.approx(np.hypot(0.07, 0.03) / np.linalg.norm(WALLS[0][1] - WALLS[0][0]), rel=0.05)
        page.mouse.move(*to_screen(page, "initial", *seemed))
        told = readout(page)
        assert told["chain"].endswith("mirror 0")
        np.testing.assert_allclose(numbers(told["folds to"]), place, atol=0.02)
        page.mouse.move(*to_screen(page, "corrected", *place))
        np.testing.assert_allclose(numbers(readout(page)["seemed at"]), seemed, atol=0.02)
        table = page.get_by_role("table", name="Mirrors at their true places").inner_text()
    assert "radius [m]" in table
    assert f"{radii(folded)[0]:.3f}" in table.replace("\u2212", "-")


def numbers(text):
    return [float(one) for one in re.findall(r"-?\d+\.\d+", text.replace("\u2212", "-"))]


def test_a_mirror_lies_on_the_arc_and_not_on_its_chord():
    arc = [[0.0, 0.0], [0.5, 0.5], [1.0, 0.0]]
    chord = [[0.3, 0.0], [0.5, 0.0], [0.7, 0.0]]
    assert line_of([[0.15, 0.36], [0.85, 0.36]], np.array([chord, arc])) == 1
    assert line_of([[0.35, 0.01], [0.6, 0.01]], np.array([chord, arc])) == 0
