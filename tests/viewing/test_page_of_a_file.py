"""The live page of a file: what it says is lost of a second polarization, and how its columns fill the window."""

from __future__ import annotations

import numpy as np
import pytest
from browser import opened
from serving import opened as opened_session
from serving import served, two_walls

import mirrorfold as mf
from mirrorfold.viewing.held import what_is_lost


def told(decided):
    """A reconstruction of which three points have passed through a wall."""
    folded = mf.fold(two_walls())
    objects = folded["objects"].to_dataset(inherit=False)
    passed = np.arange(objects.sizes["point"]) < 3
    objects["passed"] = ("point", np.where(passed, 0.98, np.nan).astype(np.float32))
    objects["wall"] = ("point", np.where(passed, "0", ""))
    objects["decided"] = ("point", np.where(passed, decided, ""))
    objects["confidence"].values[:3] = 0.9
    folded["objects"] = objects
    return folded


@pytest.mark.slow
def test_the_page_says_what_a_new_fold_does_not_know(tmp_path, chromium):
    mf.save(told("polarization"), tmp_path / "r.nc")
    with served(tmp_path / "r.nc") as server, opened(chromium, server.link()) as page:
        note = page.get_by_role("note").inner_text()
        assert note.startswith("3 points were told by a second polarization")
        page.locator("[data-line='0']").uncheck()
        page.wait_for_selector("html[data-folds='1']")
        assert page.get_by_role("note").inner_text() == note


@pytest.mark.slow
def test_nothing_is_said_where_nothing_is_lost(reconstruction):
    assert what_is_lost(reconstruction) == ""
    assert what_is_lost(told("geometry")) == ""


@pytest.mark.slow
def test_no_column_of_the_page_ends_far_above_the_other(tmp_path, chromium):
    mf.save(mf.fold(two_walls()), tmp_path / "r.nc")
    window = {"viewport": {"width": 1300, "height": 900}}
    with served(tmp_path / "r.nc") as server, opened(chromium, server.link(), **window) as page:
        boxes = [page.locator(one).bounding_box() for one in (".left", "aside")]
    ends = [box["y"] + box["height"] for box in boxes]
    assert abs(ends[0] - ends[1]) < 250


@pytest.mark.slow
def test_after_an_edit_the_page_offers_and_says_only_what_is_so(tmp_path, chromium):
    told = mf.fold(two_walls())
    told.attrs |= {"command": "mirrorfold reconstruct sweep.nc -o out", "image_normalization": "none"}
    mf.save(told, tmp_path / "r.nc")
    with served(tmp_path / "r.nc") as server, opened(chromium, server.link()) as page:
        assert page.locator("#set-copies").is_disabled()  # there is no sweep to find copies by
        focusing = page.locator(".settings tr:has-text('focusing')").all_inner_texts()
        assert focusing
        assert page.locator(".command").inner_text().startswith(told.attrs["command"])
        page.locator("[data-line='0']").uncheck()
        page.wait_for_selector("html[data-folds='1']")
        assert page.locator(".settings tr:has-text('focusing')").all_inner_texts() == focusing
        assert page.locator(".command").is_hidden()  # the command of the file makes something else


def test_the_title_stays_after_an_edit(tmp_path):
    told = mf.fold(two_walls())
    told.attrs["title"] = "basement, Tuesday"
    mf.save(told, tmp_path / "r.nc")
    session = opened_session(tmp_path / "r.nc")
    assert session.state["document"]["title"] == "basement, Tuesday"
    assert session.fold({"mirrors": []})["title"] == "basement, Tuesday"
    session.save({"mirrors": [], "name": "edited.nc"})
    assert mf.load(tmp_path / "edited.nc").attrs["title"] == "basement, Tuesday"
