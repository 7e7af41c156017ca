"""Editing in the live page: what is switched off returns to where it seemed to be, and every step can be undone."""

from __future__ import annotations

import time

import numpy as np
import pytest
from browser import opened, pixels, readout, settle, to_screen
from serving import OBJECTS, WALLS, served, two_walls

import mirrorfold as mf
from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.common.stopping import go_on
from mirrorfold.reconstruction import FoldPlan

CANVAS = ".panel[data-which=corrected] canvas"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A reconstruction, as it is saved."""
    path = tmp_path_factory.mktemp("editing") / "r.nc"
    mf.save(mf.fold(two_walls()), path)
    return path


@pytest.fixture
def page(file, chromium):
    with served(file) as server, opened(chromium, server.link()) as page:
        yield page


def folded(page, times):
    page.wait_for_selector(f"html[data-folds='{times}']")
    settle(page)


def state(page):
    """All that the page shows of a fold: both pictures, the tree, the mirrors, the switches, the settings."""
    settle(page)
    page.mouse.move(2, 2)
    settle(page)
    words = [page.locator(which).inner_text() for which in ("header", ".below", "#lines")]
    values = page.evaluate(
        "() => Array.from(document.querySelectorAll('[id^=set-], [data-line]')).map((n) => [n.value, n.checked])"
    )
    tree = page.locator(".tree").text_content()
    return [pixels(page, CANVAS), pixels(page, ".panel[data-which=initial] canvas")], [words, values, tree]


def same(one, other):
    return one[1] == other[1] and all(np.array_equal(a, b) for a, b in zip(one[0], other[0], strict=True))


def wall_of(page, number):
    """The wall that a line of the page lies on, by where its handle is."""
    box = page.locator(f"[data-handle='{number}-2']").bounding_box()
    here = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
    places = [to_screen(page, "initial", *wall.mean(axis=0)) for wall in WALLS]
    return int(np.argmin(np.linalg.norm(np.array(places) - here, axis=1)))


@pytest.mark.slow
def test_with_a_wall_switched_off_its_ghosts_are_where_they_seemed_to_be(page):
    wall = wall_of(page, 0)
    seemed = reflect(OBJECTS[wall].mean(axis=0), WALLS[wall][0], segment_normal(*WALLS[wall]))
    page.locator("[data-line='0']").uncheck()
    folded(page, 1)
    page.mouse.move(*to_screen(page, "corrected", *seemed))
    told = readout(page)
    assert told["bounces"] == "in line of sight"
    assert told["chain"] == "radar"
    assert told["confidence"] != "no point here"
    # The mirror that is not used looks so: in the list, in the picture, and in the tree, where it is no more.
    assert page.locator("#lines .unused").inner_text().strip() == "mirror 0"
    assert page.locator(".panel[data-which=initial] text.unused").text_content() == "0 not used"
    # The other one keeps its number.
    assert page.locator(".tree .node").nth(1).text_content().startswith("mirror 1")


@pytest.mark.slow
def test_a_line_that_no_line_of_sight_meets_looks_unused(page):
    """It points at the radar, so that nothing is seen through it."""
    page.locator("#draw").click()
    page.mouse.move(*to_screen(page, "initial", 0.0, 0.4))
    page.mouse.down()
    page.mouse.move(*to_screen(page, "initial", 0.0, 0.9), steps=3)
    page.mouse.up()
    folded(page, 1)
    assert page.locator("#lines label").all_inner_texts() == ["mirror 0", "mirror 1", "mirror 2, not used"]
    assert page.locator("#lines label").nth(2).get_attribute("class") == "unused"
    # Struck through, not paler: pale text is hard to read.
    style = "(node) => [getComputedStyle(node).opacity, getComputedStyle(node).textDecorationLine]"
    assert page.locator("#lines label").nth(2).evaluate(style) == ["1", "line-through"]
    assert page.locator("text.unused").evaluate(style)[0] == "1"
    assert page.locator(".panel[data-which=initial] text.unused").text_content() == "2 not used"
    assert page.locator(".tree .node").count() == 3


@pytest.mark.slow
def test_every_step_is_undone_and_done_again_by_keys_and_buttons(page):
    states = [state(page)]
    page.locator("[data-line='1']").uncheck()
    folded(page, 1)
    states.append(state(page))
    page.locator("#set-threshold_db").fill("-10")
    folded(page, 2)
    states.append(state(page))
    page.locator("[data-handle='0-0']").focus()
    page.keyboard.press("ArrowUp")
    folded(page, 3)
    states.append(state(page))
    assert not any(same(states[i], states[i + 1]) for i in range(3))
    assert page.locator("#redo").is_disabled()
    for back in (2, 1):
        page.keyboard.press("Control+z")
        assert same(state(page), states[back])
    page.locator("#undo").click()
    assert same(state(page), states[0])
    assert page.locator("#undo").is_disabled()
    page.keyboard.press("Control+z")
    assert same(state(page), states[0])
    page.keyboard.press("Control+Shift+Z")
    assert same(state(page), states[1])
    page.keyboard.press("Control+y")
    assert same(state(page), states[2])
    page.locator("#redo").click()
    assert same(state(page), states[3])
    # A new change after an undo takes the place of what was undone.
    page.keyboard.press("Control+z")
    page.locator("[data-line='1']").check()
    folded(page, 4)
    assert page.locator("#redo").is_disabled()
    # All that is no step of its own needed no new fold.
    assert page.locator("html").get_attribute("data-folds") == "4"


@pytest.mark.slow
def test_a_drag_is_one_step(page):
    first = state(page)
    box = page.locator("[data-handle='0-2']").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y, steps=8)
    page.mouse.up()
    page.wait_for_function("() => document.querySelector('#took').innerText.includes('these mirrors')")
    page.keyboard.press("Control+z")
    assert same(state(page), first)
    assert page.locator("#undo").is_disabled()


@pytest.mark.slow
def test_starting_over_is_the_state_of_the_file_and_can_be_undone(page):
    first = state(page)
    page.locator("[data-line='0']").uncheck()
    folded(page, 1)
    page.locator("#set-opaque").uncheck()
    folded(page, 2)
    changed = state(page)
    page.locator("#find").click()
    assert same(state(page), first)
    assert page.locator("#took").inner_text() == "as it is in the file"
    assert page.locator("#find").is_disabled()
    page.keyboard.press("Control+z")
    assert same(state(page), changed)


@pytest.mark.slow
def test_a_file_with_given_mirrors_keeps_them_when_a_setting_changes(tmp_path, chromium):
    path = tmp_path / "given.nc"
    mf.save(mf.fold(two_walls(), mirrors=WALLS[:1]), path)
    with served(path) as server, opened(chromium, server.link()) as page:
        assert page.locator(".tree .node").count() == 2
        page.locator("#set-threshold_db").fill("-17")
        folded(page, 1)
        assert page.locator(".tree .node").count() == 2
        assert np.allclose(server.session._lines, WALLS[:1])


@pytest.mark.slow
def test_keys_in_a_field_of_text_are_those_of_the_browser(page):
    page.locator("[data-line='0']").uncheck()
    folded(page, 1)
    changed = state(page)
    page.locator("#save-name").press("x")
    page.locator("#save-name").press("Control+z")
    assert same(state(page), changed)


@pytest.mark.slow
def test_the_slider_of_confidence_follows_the_setting(page):
    before = state(page)
    assert page.locator("#confidence").input_value() == "0.5"
    page.locator("#set-min_confidence").fill("0.9")
    folded(page, 1)
    assert page.locator("#confidence").input_value() == "0.9"
    assert page.locator("output[for=confidence]").inner_text() == "0.90"
    page.locator("#confidence").fill("0.95")
    page.locator("[data-line='1']").uncheck()
    folded(page, 2)
    assert page.locator("#confidence").input_value() == "0.95"  # chosen by hand, and no other setting
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    settle(page)
    assert page.locator("#confidence").input_value() == "0.5"
    assert same(state(page), before)


@pytest.mark.slow
def test_a_mirror_is_drawn_by_keys_and_drawing_ends_unused(page):
    draw, stage = page.locator("#draw"), page.locator(".stage")
    for end in (draw.click, lambda: page.keyboard.press("Escape")):
        draw.click()
        assert draw.get_attribute("aria-pressed") == "true"
        assert "drawing" in stage.get_attribute("class")
        end()
        assert draw.get_attribute("aria-pressed") == "false"
        assert "drawing" not in stage.get_attribute("class")
    draw.focus()
    page.keyboard.press("Enter")
    folded(page, 1)
    assert page.evaluate("() => document.activeElement.dataset.handle") == "2-2"
    assert page.locator("#lines label").count() == 3
    page.keyboard.press("ArrowUp")
    folded(page, 2)
    assert page.evaluate("() => document.activeElement.dataset.handle") == "2-2"
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    settle(page)
    assert page.locator("#lines label").count() == 2


@pytest.mark.slow
def test_the_focus_stays_where_keys_are_pressed(page):
    page.locator("[data-line='1']").focus()
    page.keyboard.press("Space")
    folded(page, 1)
    assert page.evaluate("() => document.activeElement.dataset.line") == "1"
    page.locator("#undo").focus()
    page.keyboard.press("Enter")
    settle(page)
    assert page.locator("#undo").is_disabled()
    assert page.evaluate("() => document.activeElement.id") == "redo"
    page.keyboard.press("Enter")
    settle(page)
    assert page.evaluate("() => document.activeElement.id") == "undo"


def pressed_on(page, handle, button="left"):
    """Press on a handle, move to the right and downward, and let go."""
    settle(page)
    box = page.locator(f"[data-handle='{handle}']").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down(button=button)
    page.mouse.move(x + 40, y + 60, steps=3)
    page.mouse.up(button=button)
    settle(page)


@pytest.mark.slow
def test_a_mirror_may_be_drawn_from_the_end_or_the_middle_of_another(page):
    for count, handle in ((3, "0-0"), (4, "1-2")):
        page.locator("#draw").click()
        pressed_on(page, handle)
        assert page.locator("#draw").get_attribute("aria-pressed") == "false"
        folded(page, count - 2)
        assert page.locator("#lines label").count() == count
    page.locator("#undo").click()
    page.locator("#undo").click()
    settle(page)
    assert page.locator("#took").inner_text() == "as it is in the file"  # the two mirrors of the file were not moved


@pytest.mark.slow
def test_the_right_button_moves_no_mirror(page):
    pressed_on(page, "0-2", button="right")
    assert page.locator("#undo").is_disabled()
    assert page.locator("#took").inner_text() == "as it is in the file"


@pytest.mark.slow
def test_after_a_fold_is_stopped_all_is_as_before_it(file, chromium, monkeypatch):
    usual = FoldPlan.fold

    def fold(plan, **given):
        """Without mirrors, a fold that would never end."""
        while given["mirrors"] is not None and len(given["mirrors"]) == 0:
            go_on()
            time.sleep(0.01)
        return usual(plan, **given)

    monkeypatch.setattr(FoldPlan, "fold", fold)
    # Not `opened`, for which the answer that the fold was stopped would be an error of the page.
    with served(file) as server, chromium.new_context() as context:
        page = context.new_page()
        page.goto(server.link())
        page.wait_for_selector("html[data-ready]")
        page.locator("[data-line='0']").uncheck()
        folded(page, 1)
        before = state(page)
        page.locator("[data-line='1']").uncheck()
        page.locator("#cancel").click()
        notice = page.wait_for_selector(".notice:not([hidden])")
        assert "was stopped; what is shown is the one before" in notice.inner_text()
        assert same(state(page), before)
        monkeypatch.undo()
        page.locator("#redo").click()
        folded(page, 2)
        assert page.locator("#lines .unused").count() == 2
