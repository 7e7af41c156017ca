"""The pages of a scene of millimetres: digits and steps fit its size."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from browser import number, opened, readout, settle, to_screen
from numpy.testing import assert_allclose
from serving import served

import mirrorfold as mf

SCALE = 0.01


def shrunk(reconstruction):
    """The same at a hundredth of its size."""
    nodes = {}
    for node in reconstruction.subtree:
        table = node.to_dataset(inherit=False)
        places = [name for name in table.variables if str(name).removeprefix("folded_")[:1] in "xyz"]
        nodes[node.path] = table.assign({name: SCALE * table[name] for name in places}).set_coords(list(table.coords))
    nodes["/mirrors"]["offset_error"] = ("mirror", [3.6e-6])
    return xr.DataTree.from_dict(nodes)


@pytest.mark.slow
def test_places_and_errors_have_digits(reconstruction, tmp_path, chromium):
    path = mf.report(shrunk(reconstruction), tmp_path / "small.html")
    with opened(chromium, path.as_uri()) as page:
        page.locator("[data-mode=side]").click()
        settle(page)
        page.mouse.move(*to_screen(page, "initial", -0.00107, 0.00903))
        place = [number(part) for part in readout(page)["position"].split(",")]
        assert_allclose(place, [-0.00107, 0.00903], atol=3e-5)
        table = page.get_by_role("table", name="Mirrors at their true places").inner_text()
        assert "0.004" in table
        assert "(0.0040, 0.0160)" in table
        assert ", 0.007 m" in page.locator(".tree").text_content()


@pytest.mark.slow
def test_a_key_moves_a_wall_by_a_pixel(reconstruction, tmp_path, chromium):
    mf.save(shrunk(reconstruction), tmp_path / "small.nc")
    with served(tmp_path / "small.nc") as server, opened(chromium, server.link()) as page:
        pixel = server.session.state["document"]["grid"]["dx"]
        page.locator("[data-handle='0-0']").focus()
        page.keyboard.press("ArrowUp")
        page.wait_for_selector("html[data-folds='1']")
        assert_allclose(server.session._lines[0] - SCALE * np.array([[0.4, 1.6], [0.6, 0.9]]), [[0, pixel], [0, 0]],
                        atol=1e-9)  # fmt: skip


@pytest.mark.slow
def test_the_cut_through_a_volume_has_steps_and_labels(folded_scan, tmp_path, chromium):
    nodes = {node.path: node.to_dataset(inherit=False) for node in folded_scan.subtree}
    path = mf.report(shrunk(folded_scan), tmp_path / "small.html")
    y = SCALE * nodes["/objects"]["y"].values
    with opened(chromium, path.as_uri()) as page:
        for at in (0.017, 0.02, 0.024):
            page.locator("#slice").fill(f"{at:.4f}")
            settle(page)
            expected = int((np.abs(y - at) <= 1e-3).sum())
            assert abs(number(page.locator("#slice-count").inner_text()) - expected) <= 1
