"""Figures of volumes whose tables of points lack a column, or were renamed."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scans import point_sweep

import mirrorfold as mf
from mirrorfold.plotting import volumes


def with_points(result, change):
    changed = result.copy()
    changed["objects"] = xr.DataTree(change(result["objects"].to_dataset(inherit=False)))
    return changed


@pytest.fixture(scope="module")
def folded():
    return mf.fold(mf.focus(point_sweep((0.03, 1.2, 0.05))))


def test_points_of_early_files_are_all_drawn_as_objects(folded):
    count = folded["objects"].sizes["point"]
    objects = with_points(folded, lambda points: points.assign(surface=("point", np.full(count, "object"))))
    early = with_points(folded, lambda points: points.drop_vars("surface"))
    drawn = [[len(c.get_offsets()) for c in volumes.space(one).axes[0].collections] for one in (early, objects)]
    assert drawn[0] == drawn[1]
    assert sum(drawn[0]) >= count > 0
    assert not volumes.has_body(early)


@pytest.mark.parametrize("use", [volumes.space, mf.plot.before_after])
def test_a_table_that_is_none_of_points_is_refused_in_one_sentence(folded, use):
    with pytest.raises(mf.InputError, match="in the group /objects has dimensions"):
        use(with_points(folded, lambda points: points.rename(point="row")))


PLOTS = {
    **{name: getattr(mf.plot, name) for name in ("before_after", "corrected", "mirrors", "shadows", "tree")},
    "content_extent": lambda tree: mf.plot.content_extent(tree, folded=True),
    "fold": mf.fold,
    "FoldPlan": mf.FoldPlan,
}


@pytest.mark.parametrize("name", PLOTS)
@pytest.mark.parametrize("tree", [xr.DataTree(), xr.DataTree(xr.Dataset({"a": ("x", [1.0, 2.0])}))])
def test_trees_that_are_no_reconstructions_are_refused(name, tree):
    with pytest.raises(mf.InputError, match=r"expected 'reconstruction'|holds no group 'initial'; expected what"):
        PLOTS[name](tree)
