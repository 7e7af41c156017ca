"""What was seen through a half-transparent wall has a mark of its own everywhere, and the wall its properties."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
import xarray as xr
from browser import opened, readout, settle, to_screen
from matplotlib.colors import to_hex

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.common.decibels import PASSED_COLOUR, PASSED_LABEL

THROUGH = np.array([0.9, 1.6])


@pytest.fixture
def glass(reconstruction):
    """Of the two points in line of sight, the second stands behind the wall, which is glass."""
    objects = reconstruction["objects"].to_dataset(inherit=False)
    for axis, value in zip("xy", THROUGH, strict=True):
        for suffix in ("", "_initial"):
            objects[f"{axis}{suffix}"].values[1] = value
    objects["passed"] = ("point", np.array([np.nan, 0.98, 0.01, 0.01, 0.01], dtype=np.float32))
    objects["wall"] = ("point", np.array(["", "0", "", "", ""]))
    wall = {"permittivity": 5.35, "permittivity_error": 0.22, "thickness": 5.14e-3, "thickness_error": 0.45e-3}
    mirrors = reconstruction["mirrors"].to_dataset(inherit=False)
    reconstruction["objects"] = objects
    reconstruction["mirrors"] = mirrors.assign({name: ("mirror", [value]) for name, value in wall.items()})
    return reconstruction


def test_exported_points_say_whether_they_passed_and_which_wall(glass, tmp_path):
    rows = list(csv.DictReader(mf.export(glass, tmp_path / "points.csv").read_text().splitlines()))
    assert [row["wall"] for row in rows] == ["-1", "0", "-1", "-1", "-1"]
    assert [row["passed"] for row in rows] == ["nan", "0.98", "0.01", "0.01", "0.01"]


def test_points_without_such_walls_have_no_column_for_them(reconstruction, tmp_path):
    heading = mf.export(reconstruction, tmp_path / "points.csv").read_text().splitlines()[0]
    assert heading.endswith("chain")
    assert "points_through_walls" not in mf.info(reconstruction)


@pytest.mark.slow
def test_info_tells_of_the_wall_with_its_errors(glass, tmp_path, capsys):
    mf.save(glass, tmp_path / "r.nc")
    assert main(["info", str(tmp_path / "r.nc"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["points_through_walls"] == 1
    wall = found["mirrors"][0]
    assert (wall["permittivity"], wall["permittivity_error"]) == (5.35, 0.22)
    assert (wall["thickness_m"], wall["thickness_error_m"]) == (5.14e-3, 0.45e-3)
    assert main(["info", str(tmp_path / "r.nc")]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "5.35 \u00b1 0.22" in shown
    assert "5.14 \u00b1 0.45" in shown


def test_figures_mark_them_and_say_so(glass):
    figure = mf.plot.before_after(glass)
    marks = [line for line in figure.axes[1].lines if line.get_marker() == "D" and len(line.get_xdata())]
    assert [to_hex(line.get_color()) for line in marks] == [PASSED_COLOUR.lower()]
    np.testing.assert_allclose(np.column_stack(marks[0].get_data()), [THROUGH])
    assert PASSED_LABEL in [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.slow
def test_the_page_says_that_they_stay(glass, tmp_path, chromium):
    with opened(chromium, mf.report(glass, tmp_path / "report.html").as_uri()) as page:
        page.locator("[data-mode=side]").click()
        settle(page)
        for which in ("initial", "corrected"):
            page.mouse.move(*to_screen(page, which, *THROUGH))
            told = readout(page)
            assert told["seen"] == "through mirror 0, stays"
            assert "folds to" not in told
        page.mouse.move(*to_screen(page, "corrected", 0.12, 1.52))
        assert readout(page)["bounces"] == "1 bounce"
        assert PASSED_LABEL in page.locator(".legend").first.inner_text()
        table = page.get_by_role("table", name="Mirrors at their true places").inner_text().replace("\u00a0", " ")
    assert "5.35 \u00b1 0.22" in table
    assert "5.14 \u00b1 0.45" in table


@pytest.mark.slow
def test_of_two_points_the_nearer_one_says_whether_it_passed(glass, tmp_path, chromium):
    objects = glass["objects"].to_dataset(inherit=False)
    for axis, value in zip("xy", (0.222, 1.54), strict=True):
        for suffix in ("", "_initial"):
            objects[f"{axis}{suffix}"].values[1] = value
    glass["objects"] = objects
    glass["initial"] = xr.ones_like(glass["initial"].to_dataset(inherit=False))
    with opened(chromium, mf.report(glass, tmp_path / "report.html").as_uri()) as page:
        page.locator("[data-mode=side]").click()
        settle(page)
        page.mouse.move(*to_screen(page, "corrected", 0.178, 1.54))  # nearer to a reflection
        assert "seen" not in readout(page)
        page.mouse.move(*to_screen(page, "corrected", 0.22, 1.54))
        assert readout(page)["seen"] == "through mirror 0, stays"
