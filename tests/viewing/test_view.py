"""The live page: what it shows is what the API computes, only this machine may look, and nothing breaks it."""

from __future__ import annotations

import json
import shlex
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from browser import number, opened, pixels, settle, to_screen
from levels import unpacked_levels
from numpy.testing import assert_allclose
from serving import OBJECTS, WALLS, served, two_walls

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.describing.rows import mirror_rows
from mirrorfold.detection.mirrors.known_mirrors import read_mirrors
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.viewing.controls import CHANGEABLE
from mirrorfold.viewing.lines import line_of
from mirrorfold.viewing.server import TOKEN_HEADER
from mirrorfold.viewing.session import Session


@pytest.fixture(scope="module")
def view():
    return two_walls()


@pytest.fixture
def file(view, tmp_path):
    path = tmp_path / "image.nc"
    mf.save(view, path)
    return path


@pytest.fixture(scope="module")
def running(view, tmp_path_factory):
    """A page for requests that must change nothing; its file stands alone in a folder within a folder."""
    folder = tmp_path_factory.mktemp("running") / "folder"
    folder.mkdir()
    mf.save(view, folder / "image.nc")
    with served(folder / "image.nc") as server:
        yield server


def call(server, path, body=None, **headers):
    """Status and JSON of a request."""
    data = None if body is None else body if isinstance(body, bytes) else json.dumps(body).encode()
    sent = {"Content-Type": "application/json", TOKEN_HEADER: server.token, "Cookie": server.cookie, **headers}
    request = urllib.request.Request(server.address.rstrip("/") + path, data=data, headers=sent)
    try:
        with urllib.request.urlopen(request, timeout=120) as response:
            return response.status, json.loads(response.read())
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read())


def lines_of(document):
    return np.array([mirror["ends"] for mirror in document["mirrors"]])


def corrected(document):
    grid = document["grid"]
    return unpacked_levels(document["images"]["corrected"], grid["ny"], grid["nx"])


def expected(view, document, **settings):
    """The levels that the API computes on the page's pixels."""
    grid = document["grid"]
    x, y = (view[axis].sel({axis: slice(*ends)}).values for axis, ends in (
        ("x", document["extent"][:2]), ("y", document["extent"][2:])))  # fmt: skip
    assert (x.size, y.size) == (grid["nx"], grid["ny"])
    amplitude = FoldPlan(view).fold(grid=(x, y), **settings)["intensity"].values
    level = 20.0 * np.log10(np.where(amplitude > 0, amplitude, 1.0) / document["zero_db"])
    return np.where(amplitude > 0, np.maximum(level, -60.0), np.nan)


@pytest.mark.slow
def test_a_fold_is_what_the_api_computes(file, view):
    with served(file) as server:
        first = server.session.state["document"]
        assert len(first["mirrors"]) == 2
        used = first["values"]
        for mirrors, settings in (
            (lines_of(first)[:1], {}),
            (lines_of(first) + 0.02, {"wall_margin": 0.1}),
            (None, {"threshold_db": -10.0}),
            (lines_of(first), {"generations": 0}),
        ):
            status, found = call(server, "/api/fold", {
                "settings": {**used, **settings},
                "mirrors": None if mirrors is None else mirrors.tolist()})  # fmt: skip
            assert status == 200
            truth = expected(view, first, mirrors=mirrors, **settings)
            assert_allclose(corrected(found), truth, atol=0.5 * found["images"]["corrected"]["step"] + 1e-3)
            assert found["values"]["wall_margin"] == settings.get("wall_margin", used["wall_margin"])


@pytest.mark.slow
@pytest.mark.parametrize(("dimension", "labels"), [("polarization", ["TE", "TM"]), ("z", [0.0, 0.1])])
def test_an_image_of_two_polarizations_or_of_voxels_is_folded_as_by_the_api(view, tmp_path, dimension, labels):
    levels = view.copy(data=np.abs(view.values))  # without phases, walls are not asked whether they let waves through
    both = levels.drop_vars("z", errors="ignore").expand_dims({dimension: labels})
    mf.save(both, tmp_path / "both.nc")
    mirrors = WALLS[:1] + 0.01
    again = mf.fold(both, mirrors=mirrors)
    with served(tmp_path / "both.nc") as server:
        assert len(server.session.state["document"]["mirrors"]) == 2
        status, found = call(server, "/api/fold", {"mirrors": mirrors.tolist()})
    assert status == 200
    assert_allclose(lines_of(found), lines_of({"mirrors": mirror_rows(again)}))
    assert found["points"]["total"] == again["objects"].sizes["point"]


@pytest.mark.slow
def test_what_is_saved_is_what_the_api_and_its_command_compute(file, view, monkeypatch, capsys):
    with served(file) as server:
        mirrors = lines_of(server.session.state["document"])[:1] + 0.015
        request = {"settings": {"threshold_db": -16.5}, "mirrors": mirrors.tolist(), "name": "mine.nc"}
        status, saved = call(server, "/api/save", request)
    assert status == 200
    written = mf.load(file.parent / "mine.nc")
    again = mf.fold(view, mirrors=mirrors, threshold_db=-16.5)
    assert np.array_equal(written["intensity"], again["intensity"])
    assert np.array_equal(read_mirrors(file.parent / "mine.mirrors.json"), mirrors)
    assert written.attrs["command"] == saved["command"]
    words = shlex.split(saved["command"])
    assert words[:2] == ["mirrorfold", "fold"]
    words[words.index("-o") + 1] = str(file.parent / "repeated.nc")
    assert main(words[1:]) == 0
    repeated = mf.load(file.parent / "repeated.nc")
    assert np.array_equal(repeated["intensity"], written["intensity"])
    for name in ("x", "y", "confidence"):
        assert np.array_equal(*(r.children["objects"].to_dataset(inherit=False)[name] for r in (repeated, written)))


@pytest.mark.slow
def test_mirrors_are_not_saved_without_what_they_fold(file, monkeypatch):
    def full(result, path):
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr("mirrorfold.viewing.session.save", full)
    with served(file) as server:
        mirrors = lines_of(server.session.state["document"])[:1]
        status, answer = call(server, "/api/save", {"mirrors": mirrors.tolist(), "name": "mine.nc"})
    assert status == 500
    assert str(file.parent / "mine.nc") in answer["message"]
    assert [path.name for path in file.parent.iterdir()] == [file.name]


@pytest.mark.slow
@pytest.mark.parametrize("frame", [None, 1], ids=["one sweep", "one of two frames"])
def test_a_sweep_is_focused_and_its_command_makes_the_same_again(sweep, tmp_path, monkeypatch, frame):
    monkeypatch.chdir(tmp_path)
    other = sweep.assign(s=0.5 * sweep["s"][::-1])
    mf.save(sweep if frame is None else xr.concat([other, sweep], "frame", data_vars=["s"]), "sweep.nc")
    with served("sweep.nc", frame=frame) as server:
        assert server.session.state["status"] == "ready"
        status, saved = call(server, "/api/save", {"settings": {"threshold_db": -12.0}, "name": "out.nc"})
        assert status == 200
    first, second = (shlex.split(part) for part in saved["command"].split(" && "))
    assert main(first[1:]) == 0
    second[second.index("-o") + 1] = "again.nc"
    assert main(second[1:]) == 0
    assert np.array_equal(mf.load("again.nc")["intensity"], mf.load("out.nc")["intensity"])


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        *("../x.nc", "/x.nc", "a/b.nc", "..nc", "x.txt", "", None, "image.nc", "a\\..\\b.nc"),
        *("-o.nc", "C:x.nc", "two\nlines.nc", "\u202ecn.x.nc"),
    ],
)
def test_a_name_leads_to_no_other_place(running, name):
    def files() -> dict[Path, tuple[int, int]]:
        found = ((path, path.stat()) for path in running.session.path.parent.parent.rglob("*") if path.is_file())
        return {path: (stat.st_size, stat.st_mtime_ns) for path, stat in found}

    before = files()
    assert len(before) == 1
    status, answer = call(running, "/api/save", {"name": name})
    assert status == 400
    assert answer["message"]
    assert files() == before


@pytest.mark.slow
def test_only_this_machine_may_look(running):
    port = running.server_port
    assert running.server_address[0] == "127.0.0.1"
    for host in (f"127.0.0.1:{port}", f"localhost:{port}", f"[::1]:{port}"):
        assert call(running, "/api/state", Host=host)[0] == 200
    for host in ("evil.example", f"evil.example:{port}", "127.0.0.1", f"127.0.0.1.evil.example:{port}", "127.0.0.1:1"):
        assert call(running, "/api/state", Host=host)[0] == 403
        assert call(running, "/api/fold", {}, Host=host)[0] == 403
    assert call(running, "/api/state", Origin="http://evil.example")[0] == 403
    assert call(running, "/api/fold", {}, **{TOKEN_HEADER: "wrong"})[0] == 403
    assert call(running, "/api/save", {"name": "x.nc"}, **{TOKEN_HEADER: ""})[0] == 403
    assert not (running.session.path.parent / "x.nc").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "path", ["/../../etc/passwd", "/etc/passwd", "/image.nc", "/%2e%2e/image.nc", "/api/", "//image.nc"]
)
def test_no_address_leads_to_a_file(running, path):
    assert call(running, path)[0] == 404
    assert call(running, path, {})[0] == 404


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "status", "words"),
    [
        (b"[", 400, "not a JSON object"),
        (b"[]", 400, "not a JSON object"),
        (b"[" * 100_000, 400, "not a JSON object"),
        (b" " * 1_000_001, 413, "expected a request"),
        ({"settings": {"threshold_db": "x"}}, 400, "threshold_db is 'x'"),
        ({"settings": {"secret": 1}}, 400, "no setting 'secret'"),
        ({"settings": {"minimum_length": -1}}, 400, "minimum_length is -1"),
        ({"settings": []}, 400, "no object"),
        ({"mirrors": [[[0, 1], [0, 1]]]}, 400, "has no length"),
        ({"mirrors": "x"}, 400, "two ends"),
        ({"mirrors": [[[0, 1], [0, 1e400]]]}, 400, "not finite"),
    ],
)
def test_a_wrong_request_is_answered_and_forgotten(running, body, status, words):
    found, answer = call(running, "/api/fold", body)
    assert found == status
    assert words in answer["message"]
    assert call(running, "/api/fold", {})[0] == 200


def test_pieces_belong_to_the_line_they_lie_on():
    lines = np.array([[[0.0, 1.0], [1.0, 1.0]], [[0.0, 1.2], [1.0, 1.4]]])
    assert line_of([[0.2, 1.0], [0.4, 1.0]], lines) == 0
    assert line_of([[0.5, 1.3], [1.0, 1.4]], lines) == 1


@pytest.mark.slow
def test_the_page_follows_a_switch_and_saves(file, view, chromium):
    with served(file) as server, opened(chromium, server.link()) as page:
        canvas = ".panel[data-which=corrected] canvas"
        before = pixels(page, canvas)
        page.locator("[data-line='1']").uncheck()
        page.wait_for_selector("html[data-folds='1']")
        settle(page)
        assert (pixels(page, canvas) != before).any()
        shown = server.session.state["document"]
        mirrors = lines_of(shown)[:1]
        assert page.locator(".tree .node").count() == 2
        truth = expected(view, shown, mirrors=mirrors)
        # What the page holds, pixel for pixel, is what the API computes.
        for x, y in OBJECTS.mean(axis=1):
            page.mouse.move(*to_screen(page, "corrected", x, y))
            settle(page)
            names, texts = (page.locator(f"#readout {tag}").all_inner_texts() for tag in ("dt", "dd"))
            told = dict(zip(names, texts, strict=True))
            place = [number(part) for part in told["position"].split(",")]
            grid = shown["grid"]
            i, j = (round((place[k] - grid[f"{a}0"]) / grid[f"d{a}"]) for k, a in enumerate("xy"))
            around = truth[j - 1 : j + 2, i - 1 : i + 2]
            if np.isnan(around).all():
                assert told["amplitude"] == "nothing"
            else:
                level = number(told["amplitude"]) if told["amplitude"] != "nothing" else np.nan
                assert np.isnan(level) or np.nanmin(np.abs(around - level)) < 0.3
        page.locator("#save-name").fill("from page.nc")
        page.locator("#save").click()
        page.wait_for_selector("#saved pre")
        command = page.locator("#saved pre").inner_text()
    written = mf.load(file.parent / "from page.nc")
    assert written.attrs["command"] == command
    assert np.array_equal(written["intensity"], mf.fold(view, mirrors=mirrors)["intensity"])


@pytest.mark.slow
def test_a_mirror_is_dragged_and_drawn_by_hand(file, chromium):
    with served(file) as server, opened(chromium, server.link()) as page:
        start = lines_of(server.session.state["document"])
        handle = page.locator("[data-handle='0-2']").bounding_box()
        x, y = handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 30, y, steps=5)
        page.mouse.up()
        page.wait_for_function("() => document.querySelector('#took').innerText.includes('these mirrors')")
        page.wait_for_timeout(300)
        moved = server.session._lines[0] - start[0]
        assert_allclose(moved[0], moved[1], atol=1e-9)
        assert moved[0, 0] > 0.02
        assert moved[0, 1] == pytest.approx(0.0, abs=1e-6)
        folds = int(page.locator("html").get_attribute("data-folds"))
        page.locator("[data-handle='1-0']").focus()
        page.keyboard.press("ArrowUp")
        page.wait_for_selector(f"html[data-folds='{folds + 1}']")
        assert_allclose(server.session._lines[1, 0] - start[1, 0], [0.0, 0.01], atol=1e-9)
        page.locator("#draw").click()
        a, b = to_screen(page, "initial", -0.3, 0.8), to_screen(page, "initial", 0.3, 0.8)
        page.mouse.move(*a)
        page.mouse.down()
        page.mouse.move(*b, steps=3)
        page.mouse.up()
        page.wait_for_selector(f"html[data-folds='{folds + 2}']")
        assert len(server.session._lines) == 3
        assert_allclose(np.abs(server.session._lines[2]), [[0.3, 0.8], [0.3, 0.8]], atol=0.02)


@pytest.mark.slow
def test_settings_of_the_page_reach_the_fold(file, chromium):
    with served(file) as server, opened(chromium, server.link()) as page:
        page.locator("#set-generations").select_option("0")
        page.wait_for_selector("html[data-folds='1']")
        assert page.locator(".tree .node").count() == 1
        page.locator("#set-generations").select_option("default")
        page.wait_for_selector("html[data-folds='2']")
        page.locator("#set-minimum_length").fill("1.2")
        page.wait_for_selector("html[data-folds='3']")
        assert page.locator(".tree .node").count() == 1
        assert server.session._settings["minimum_length"] == 1.2
        page.locator("#set-opaque").uncheck()
        page.wait_for_selector("html[data-folds='4']")
        assert server.session._settings["opaque"] is False
        for name, rule in CHANGEABLE.items():
            assert page.locator(f"label:has(#set-{name})").get_attribute("title") == rule.meaning
        page.locator("#find").click()
        settle(page)
        assert page.locator("#set-opaque").is_checked()
        assert page.locator(".tree .node").count() == 3


@pytest.mark.slow
def test_a_setting_without_a_scale_is_typed_in(view, tmp_path, chromium):
    path = tmp_path / "r.nc"
    mf.save(mf.fold(view, wall_margin=0.0), path)
    with served(path) as server, opened(chromium, server.link()) as page:
        page.locator("#set-wall_margin").fill("0.05")
        page.locator("#set-wall_margin").press("Enter")
        page.wait_for_selector("html[data-folds='1']")
        assert server.session._settings["wall_margin"] == 0.05


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"", b"not netCDF", b"\x89HDF\r\n\x1a\n" + b"\0" * 100])
def test_a_bad_file_is_told_of_in_the_page_and_can_be_replaced(view, tmp_path, chromium, content):
    path = tmp_path / "<b>bad<b>.nc"
    path.write_bytes(content)
    with served(path) as server, opened(chromium, server.link()) as page:
        assert path.name in page.locator(".notice").inner_text()
        assert page.locator("b").count() == 0
        mf.save(view, path)
        page.locator("#again").click()
        page.wait_for_selector(".tree .node")


@pytest.mark.slow
def test_a_reconstruction_opens_as_it_was_saved_with_its_truth(reconstruction, scene_file, tmp_path, chromium):
    path = tmp_path / "r.nc"
    reconstruction.attrs["title"] = "</script><img src=x onerror=alert(1)>"
    mf.save(reconstruction, path)
    with served(path, mf.load(scene_file)) as server, opened(chromium, server.link()) as page:
        assert page.locator("img").count() == 0
        page.wait_for_selector(".truth", state="attached")
        assert "3 seen around a corner" in page.locator("header").inner_text()


@pytest.mark.slow
def test_the_verb_announces_its_address_and_takes_no_wrong_port(file, capsys, monkeypatch):
    """And opens no file for a page that cannot be served."""
    assert main(["view", str(file), "--port", "99999", "--no-open"]) == 2
    assert "port is 99999" in capsys.readouterr().err
    assert main(["view", "absent.nc", "--no-open"]) == 2
    assert "absent.nc: does not exist" in capsys.readouterr().err
    with served(file) as server:
        monkeypatch.setattr(Session, "open", lambda session: pytest.fail("it was opened"))
        assert main(["view", str(file), "--port", str(server.server_port), "--no-open"]) == 2
    assert "cannot be had" in capsys.readouterr().err
