"""What the words around pictures say: that no mirror was found, what colours mean, and where the radar is."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.cli.figures import draw


def drawn(reconstruction, what):
    return draw(reconstruction, what, None, -40.0, "r.nc")[1]


@pytest.fixture
def without_mirrors(reconstruction):
    groups = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    groups["/mirrors"] = groups["/mirrors"].isel(mirror=slice(0))
    groups["/objects"] = groups["/objects"].isel(point=slice(2))
    return xr.DataTree.from_dict(groups)


def test_titles_say_that_no_mirror_was_found(reconstruction, without_mirrors):
    titles = [ax.get_title() for ax in mf.plot.before_after(without_mirrors).axes[:2]]
    assert titles == ["initial image:\nno mirror found", "corrected:\nnothing to fold back"]
    titles = [ax.get_title() for ax in mf.plot.before_after(reconstruction).axes[:2]]
    assert titles == ["initial image:\nmirrors and their shadows", "corrected:\nevery echo folded back"]
    assert drawn(without_mirrors, "mirrors").axes[0].get_title() == "no mirror found"
    assert drawn(reconstruction, "mirrors").axes[0].get_title() == ""


@pytest.mark.parametrize("what", ["initial", "mirrors", "corrected"])
def test_every_plan_view_has_one_radar(reconstruction, what):
    marks = [line.get_xydata() for line in drawn(reconstruction, what).axes[0].lines if line.get_marker() == "^"]
    assert np.array_equal(marks, [[[0.0, 0.0]]])


def test_colours_of_the_corrected_image_are_explained(reconstruction):
    (legend,) = drawn(reconstruction, "corrected").legends
    assert [text.get_text() for text in legend.get_texts()] == ["in line of sight", "1 bounce"]
