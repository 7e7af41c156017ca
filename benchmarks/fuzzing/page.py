"""A target of fuzzing: the requests to the live page."""

from __future__ import annotations

import json
import re
import socket
import threading
from pathlib import Path
from typing import Any

import numpy as np

from fuzzing.damage import WORDS, damaged_bytes, damaged_text
from fuzzing.results import SCENE
from fuzzing.targets import Case, EscapeError, Generator, Target

SECONDS_TO_ANSWER = 20.0

STATUS = re.compile(rb"HTTP/1\.[01] (\d{3}) ")

MIRROR = [[[-0.2, 0.3], [0.2, 0.34]]]

ANSWERED, REFUSED = range(200, 300), range(400, 500)


def request(method: str, path: str, body: str = "", **headers: str) -> str:
    """The text of a request to the page; @TOKEN@, @COOKIE@, @PORT@ and @LENGTH@ are filled in when it is sent."""
    known = {
        "Host": "127.0.0.1:@PORT@",
        "Cookie": "@COOKIE@",
        "Content-Length": "@LENGTH@",
        "X-Mirrorfold-Token": "@TOKEN@",
    }
    lines = [f"{method} {path} HTTP/1.1", *(f"{name}: {value}" for name, value in (known | headers).items())]
    return "\r\n".join(lines) + "\r\n\r\n" + body


class Page(Target):
    """Requests to the live page of a small image."""

    def __init__(self, folder: Path) -> None:
        import mirrorfold as mf
        from mirrorfold.common.settings import Rule
        from mirrorfold.viewing.controls import CHANGEABLE
        from mirrorfold.viewing.server import Server
        from mirrorfold.viewing.session import Session

        super().__init__(folder)
        self.inner = folder / "inner"
        self.inner.mkdir(exist_ok=True)
        sweep = mf.simulate(mf.load_scene(SCENE))
        image = mf.focus(sweep, x=np.linspace(-0.3, 0.3, 31), y=np.linspace(0.15, 0.58, 31))
        mf.save(image, self.inner / "image.nc")
        self.mistakes: list[BaseException | None] = []

        class Watched(Server):
            mistakes = self.mistakes

            def handle_error(self, request: Any, client_address: Any) -> None:
                import sys

                error = sys.exc_info()[1]
                if not isinstance(error, ConnectionError | TimeoutError):
                    self.mistakes.append(error)

        session = Session(self.inner / "image.nc")
        session.open().join()
        assert session.state["status"] == "ready", session.state
        self.server, self.lines, self.usual = Watched(session), session._lines, dict(session._settings)
        threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
        rules: dict[str, Rule] = CHANGEABLE
        values: dict[str, Any] = {
            name: rule.choices[0] if rule.choices else True if rule.kind == "bool" else max(1, rule.lowest or 0)
            for name, rule in rules.items()
        }
        usual = {name: value for name, value in session.state["document"]["values"].items() if value is not None}
        fold = {"settings": usual, "mirrors": MIRROR, "page": "a", "score": True}
        self.requests = {
            "fold.http": request("POST", "/api/fold", json.dumps(fold)),
            "free.http": request("POST", "/api/fold", json.dumps({"settings": {}, "mirrors": None})),
            "odd.http": request("POST", "/api/fold", json.dumps({"settings": values})),
            "save.http": request(
                "POST", "/api/save", json.dumps({"name": "out.nc", "mirrors": MIRROR, "replace": True})
            ),
            "cancel.http": request("POST", "/api/cancel", json.dumps({"page": "a"})),
            "page.http": request("GET", "/"),
            "state.http": request("GET", "/api/state", Origin="http://localhost:@PORT@"),
            "icon.http": request("GET", "/favicon.ico"),
        }

    def valid(self) -> list[Case]:
        return [Case(name, text.encode(), 0) for name, text in self.requests.items() if name != "odd.http"]

    def case(self, number: int, rng: Generator) -> Case:
        name = list(self.requests)[number % len(self.requests)]
        text = self.requests[name]
        head, _, body = text.partition("\r\n\r\n")
        others = [other.partition("\r\n\r\n")[2] for other in self.requests.values()]
        if body and rng.random() < 0.6:  # a wrong body in a right request
            raw = f"{head}\r\n\r\n{damaged_text(body, others, rng)}".encode("utf-8", "surrogatepass")
        elif rng.random() < 0.5:
            length = str(rng.choice(WORDS[:20])) if rng.random() < 0.1 else "@LENGTH@"
            raw = damaged_text(text.replace("@LENGTH@", length), list(self.requests.values()), rng).encode(
                "utf-8", "surrogatepass"
            )
        else:
            raw = damaged_bytes(text.encode(), [other.encode() for other in self.requests.values()], rng)
        return Case(name, raw, 0)

    def feed(self, case: Case) -> str:
        # A page remembers what was folded last; a case must not depend on the one before.
        session = self.server.session
        session._lines, session._settings = self.lines, dict(self.usual)
        status, answer = self._ask(case.raw)
        strangers = {path.name for path in self.folder.iterdir()} - {"inner"}
        if strangers:
            raise EscapeError(f"there are other files: {sorted(strangers)}")
        for path in self.inner.iterdir():
            if path.name != "image.nc":
                path.unlink()
        if self.mistakes:
            error, self.mistakes[:] = self.mistakes[0], []
            raise error if isinstance(error, Exception) else EscapeError(repr(error))
        if status in ANSWERED:
            return "read"
        if status not in REFUSED and status not in (501, 505):  # an unknown method, an unknown version
            raise EscapeError(f"status {status}: {answer[-500:].decode('utf-8', 'replace')}")
        return "refused"

    def _ask(self, raw: bytes) -> tuple[int, bytes]:
        """Status and text of the answer to a request."""
        body = raw.partition(b"\r\n\r\n")[2]
        known = {
            "TOKEN": self.server.token,
            "COOKIE": self.server.cookie,
            "PORT": self.server.server_port,
            "LENGTH": len(body),
        }
        for name, value in known.items():
            raw = raw.replace(f"@{name}@".encode(), str(value).encode())
        answer = b""
        with socket.create_connection(("127.0.0.1", self.server.server_port), timeout=SECONDS_TO_ANSWER) as connection:
            try:
                connection.sendall(raw)
                connection.shutdown(socket.SHUT_WR)
                while part := connection.recv(1 << 16):
                    answer += part
            except TimeoutError:
                raise EscapeError("no answer") from None
            except OSError:  # the server refused before it had read the whole request, and closed
                pass
        found = STATUS.match(answer)
        # Without a line that names a method there is no request to answer; HTTP 0.9 has answers without a status.
        return (int(found[1]) if found else 400), answer
