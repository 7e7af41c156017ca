"""The live page asks before it replaces a file, can be stopped, and is for one browser alone."""

from __future__ import annotations

import http.client
import json
import socket
import threading

import numpy as np
import pytest
from browser import opened
from serving import served, two_walls

import mirrorfold as mf
from mirrorfold.viewing import session as sessions
from mirrorfold.viewing.server import TOKEN_HEADER

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    path = tmp_path_factory.mktemp("view") / "image.nc"
    mf.save(two_walls(), path)
    with served(path) as server:
        yield server


def ask(server, method, path, body=b"", **headers):
    """Status, headers and text of a request; a header that is None is left out."""
    own = {TOKEN_HEADER: server.token, "Cookie": server.cookie, "Content-Length": str(len(body))}
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=120)
    connection.putrequest(method, path)
    for name, value in (own | headers).items():
        if value is not None:
            connection.putheader(name, value)
    connection.endheaders(body)
    response = connection.getresponse()
    answer = response.status, response.headers, response.read().decode()
    connection.close()
    return answer


def post(server, path, **request):
    status, _, text = ask(server, "POST", path, json.dumps(request).encode())
    return status, json.loads(text)


def test_a_file_that_is_there_is_replaced_only_on_request(server):
    folder = server.session.path.parent
    (folder / "mine.nc").write_text("precious")
    assert post(server, "/api/save", name="mine.nc")[0] == 409
    assert "mine.nc: is there already" in post(server, "/api/save", name="mine.nc", replace="yes")[1]["message"]
    assert (folder / "mine.nc").read_text() == "precious"
    assert post(server, "/api/save", name="mine.nc", replace=True)[0] == 200
    mf.load(folder / "mine.nc")
    # The mirrors are a file of their own.
    (folder / "other.mirrors.json").write_text("precious")
    status, answer = post(server, "/api/save", name="other.nc", mirrors=[[[0.5, 1.8], [0.9, 0.9]]])
    assert (status, answer["message"].split(":")[0]) == (409, "other.mirrors.json")
    assert not (folder / "other.nc").exists()


def test_of_two_pages_that_save_at_once_the_later_one_is_asked(server, monkeypatch):
    target, plan = server.session.path.parent / "both.nc", server.session._plan

    class Slow:
        """Folds while another page saves under the same name."""

        def fold(self, **arguments):
            target.write_text("of the other page")
            return plan.fold(**arguments)

    monkeypatch.setattr(server.session, "_plan", Slow())
    assert post(server, "/api/save", name="both.nc")[0] == 409
    assert target.read_text() == "of the other page"


def test_the_page_asks_before_it_replaces_a_file(server, chromium):
    target = server.session.path.parent / "again.nc"
    target.write_text("precious")
    with chromium.new_context() as context:  # not `opened`, for which the refusal would be an error of the page
        page = context.new_page()
        page.goto(server.link())
        page.wait_for_selector("html[data-ready]")
        page.locator("#save-name").fill("again.nc")
        with page.expect_response("**/api/save"):
            page.locator("#save").click()
        notice = page.wait_for_selector(".notice:not([hidden])")
        assert "save once more to replace it" in notice.inner_text()
        assert target.read_text() == "precious"
        page.locator("#save").click()
        page.wait_for_selector("#saved pre")
    mf.load(target)


def test_a_link_works_once_and_the_cookie_afterwards(server):
    link = server.link().partition(str(server.server_port))[2]
    assert ask(server, "GET", "/", Cookie=None)[0] == 403
    assert ask(server, "GET", "/api/state", Cookie=None)[0] == 403
    assert ask(server, "GET", "/?key=", Cookie=None)[0] == 403
    assert ask(server, "GET", link.replace("/?", "/api/state?"), Cookie=None)[0] == 403
    status, headers, text = ask(server, "GET", link, Cookie=None)
    assert status == 200
    assert server.token in text
    cookie, *words = headers["Set-Cookie"].split("; ")
    assert words == ["Path=/", "HttpOnly", "SameSite=Strict"]
    status, _, text = ask(server, "GET", link, Cookie=None)
    assert status == 403
    assert server.token not in text
    assert cookie.partition("=")[2] not in text
    for path in ("/", link, "/api/state"):
        assert ask(server, "GET", path, Cookie=f"other=1; {cookie}")[0] == 200
    assert ask(server, "GET", "/", Cookie=cookie[:-1])[0] == 403
    assert ask(server, "POST", "/api/fold", b"{}", Cookie=None)[0] == 403


def test_the_page_stays_open_when_it_is_loaded_again(server, chromium):
    with opened(chromium, server.link()) as page:
        assert page.url == server.address
        page.reload()
        page.wait_for_selector(".tree .node")
        assert page.evaluate("document.cookie") == ""


@pytest.mark.parametrize(
    ("length", "status"),
    [
        (None, 411),
        ("-1", 400),
        ("x", 400),
        ("", 400),
        ("+2", 400),
        ("1_0", 400),
        ("0", 413),
        ("1000001", 413),
        ("9" * 400, 413),
        ("9" * 5000, 413),
    ],
)
def test_lengths_that_are_none_are_refused(server, length, status):
    body = b"" if length is None or not length.isdigit() or len(length) > 7 else b" " * int(length)
    assert ask(server, "POST", "/api/fold", body, **{"Content-Length": length})[0] == status


@pytest.mark.parametrize("action", ["save", "cancel", "fold"])
def test_requests_shorter_than_they_say_do_nothing(server, action):
    """The sender has ended before its request was complete, whose meaning the rest may change."""
    body = b'{"name": "short.nc"}'
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=120) as connection:
        lines = [f"POST /api/{action} HTTP/1.1", f"Host: 127.0.0.1:{server.server_port}", f"Cookie: {server.cookie}",
                 f"{TOKEN_HEADER}: {server.token}", "Content-Length: 5000"]  # fmt: skip
        connection.sendall("\r\n".join([*lines, "", ""]).encode() + body)
        connection.shutdown(socket.SHUT_WR)
        answer = connection.makefile("rb").read()
    assert answer.startswith(b"HTTP/1.1 400 ")
    assert b"shorter than the length that it says" in answer
    assert not (server.session.path.parent / "short.nc").exists()


@pytest.mark.parametrize("origin", ["//]", "http://[", "null", "https://127.0.0.1:1", ""])
def test_origins_that_are_none_are_refused(server, origin):
    assert ask(server, "GET", "/api/state", Origin=origin)[0] == 403


@pytest.mark.parametrize("address", ["//[", "//[::1/api/fold"])
def test_addresses_that_are_none_are_not_found(server, address):
    assert ask(server, "GET", address)[0] == 404
    assert ask(server, "POST", address, b"{}")[0] == 404


@pytest.mark.parametrize("levels", [700, 950])
def test_requests_in_many_levels_are_refused(server, levels):
    for body in ('{"mirrors": %s1%s}', '{"settings": {"threshold_db": %s1%s}}'):
        status, _, text = ask(server, "POST", "/api/fold", (body % ("[" * levels, "]" * levels)).encode())
        assert status == 400
        assert "nested too deeply" in text


@pytest.mark.parametrize("digits", [400, 5000])
def test_numbers_of_hundreds_of_digits_are_refused(server, digits):
    number = "9" * digits
    for body in ('{"settings": {"threshold_db": %s}}', '{"mirrors": [[[%s, 1], [0, 2]]]}'):
        status, _, text = ask(server, "POST", "/api/fold", (body % number).encode())
        assert status == 400
        assert "mistake" not in text


def test_a_fold_of_hundreds_of_mirrors_is_stopped_and_holds_up_nobody(server, monkeypatch):
    begun, ended = threading.Event(), threading.Event()
    random = np.random.default_rng(0)
    starts = random.uniform([-1.5, 0.5], [1.5, 2.5], (600, 2))
    mirrors = np.stack([starts, starts + random.uniform(-0.4, 0.4, (600, 2))], axis=1).tolist()
    usual = sessions.FoldPlan.fold

    def fold(plan, **given):
        if given["mirrors"] is not None:
            begun.set()
        return usual(plan, **given)

    monkeypatch.setattr(sessions.FoldPlan, "fold", fold)
    answers = []

    def work():
        answers.append(post(server, "/api/fold", page="one", mirrors=mirrors))
        ended.set()

    worker = threading.Thread(target=work)
    worker.start()
    assert begun.wait(30)
    assert post(server, "/api/fold", page="two")[0] == 200
    assert not ended.is_set()
    assert post(server, "/api/cancel", page="two")[1] == {"stopped": False}
    assert not ended.is_set()
    assert post(server, "/api/cancel", page="one")[1] == {"stopped": True}
    worker.join(60)
    [(status, answer)] = answers
    assert status == 409
    assert "was stopped" in answer["message"]
    assert post(server, "/api/fold", page="one")[0] == 200
