"""The server of the live page: on this machine only, with a few addresses, none of which leads to a file by its name.

A page from elsewhere cannot use the server: requests must name this machine as their host, which a rebound domain name
does not, and a request that folds or saves must hold the token that only the page itself was given.
"""

from __future__ import annotations

import json
import secrets
import sys
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

from mirrorfold.errors import InputError
from mirrorfold.reporting.page import to_html, to_json
from mirrorfold.viewing.session import Session

LOOPBACK = "127.0.0.1"

HOSTS = ("127.0.0.1", "localhost", "[::1]")
"""Names by which a browser on this machine calls the server."""

LARGEST_REQUEST = 1_000_000
"""Length of the longest request that is read [bytes]; a thousand mirrors take a tenth of that."""

TOKEN_HEADER = "X-Mirrorfold-Token"

HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


class Server(ThreadingHTTPServer):
    """Serves one session on the loopback address.

    Parameters
    ----------
    session : Session
    port : int
        0 for any that is free.

    Raises
    ------
    InputError
        If the port is taken or is no port number.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, session: Session, port: int = 0) -> None:
        self.session = session
        self.token = secrets.token_urlsafe(24)
        if not 0 <= port <= 65535:
            raise InputError(f"port is {port}, expected a number from 1 to 65535, or 0 for any that is free")
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except OSError as error:
            raise InputError(f"port {port}: cannot be had ({error.strerror}); choose another, or 0 for any") from None

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing where the browser has closed the connection; all other errors are mistakes of this program."""
        if not isinstance(sys.exc_info()[1], ConnectionError | TimeoutError):
            super().handle_error(request, client_address)

    @property
    def address(self) -> str:
        """The page's address."""
        return f"http://{LOOPBACK}:{self.server_port}/"


class _Handler(BaseHTTPRequestHandler):
    """One request."""

    server: Server
    protocol_version = "HTTP/1.1"
    timeout = 60

    def do_GET(self) -> None:
        """Answer with the page or the state of the session."""
        if not self._is_local():
            return
        path = urlsplit(self.path).path
        if path == "/":
            live = {"token": self.server.token, "header": TOKEN_HEADER}
            page = to_html({}, title=self.server.session.path.name, live=live)
            self._send(HTTPStatus.OK, page, "text/html; charset=utf-8")
        elif path == "/api/state":
            self._send_json(HTTPStatus.OK, self.server.session.state)
        elif path == "/favicon.ico":
            self._send(HTTPStatus.NO_CONTENT, "", "image/x-icon")
        else:
            self._refuse(HTTPStatus.NOT_FOUND, "there is nothing at this address")

    def do_POST(self) -> None:
        """Fold, save or open again."""
        if not self._is_local():
            return
        request = self._request()
        if request is None:
            return
        session = self.server.session
        actions = {"/api/fold": session.fold, "/api/save": session.save, "/api/open": _open(session)}
        action = actions.get(urlsplit(self.path).path)
        if action is None:
            self._refuse(HTTPStatus.NOT_FOUND, "there is nothing at this address")
            return
        try:
            answer = action(request)
        except InputError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))
        except OSError as error:
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, f"reading or writing failed: {error}")
        except Exception as error:  # the page shows the message, and goes on
            found = f"{type(error).__name__}: {error}"
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, f"failed by a mistake of ours ({found})")
        else:
            self._send_json(HTTPStatus.OK, answer)

    def _is_local(self) -> bool:
        """Whether the request names this machine and comes from this page; refused otherwise."""
        names = {f"{host}:{self.server.server_port}" for host in HOSTS}
        origin = self.headers.get("Origin")
        if self.headers.get("Host", "").lower() in names and (
            origin is None or urlsplit(origin).netloc.lower() in names
        ):
            return True
        self._refuse(HTTPStatus.FORBIDDEN, "only a browser on this machine may look")
        return False

    def _request(self) -> Any:
        """The JSON object that was sent; None, after a refusal, where it is too long, has no token, or is no JSON."""
        try:
            length = int(self.headers.get("Content-Length", "0"))
        except ValueError:
            length = -1
        if not 0 < length <= LARGEST_REQUEST:
            # The browser reads the answer only after all of its request has been taken from it.
            self.rfile.read(min(max(length, 0), 4 * LARGEST_REQUEST))
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"expected a request of 1 to {LARGEST_REQUEST} bytes")
            return None
        body = self.rfile.read(length)
        if not secrets.compare_digest(self.headers.get(TOKEN_HEADER, "").encode(), self.server.token.encode()):
            self._refuse(HTTPStatus.FORBIDDEN, "the page is not of this server any more; load it again")
            return None
        try:
            content = json.loads(body)
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            self._refuse(HTTPStatus.BAD_REQUEST, "the request is not a JSON object")
            return None
        return content

    def _refuse(self, status: HTTPStatus, message: str) -> None:
        self.close_connection = True
        self._send_json(status, {"message": message})

    def _send_json(self, status: HTTPStatus, content: Any) -> None:
        self._send(status, to_json(content), "application/json")

    def _send(self, status: HTTPStatus, text: str, kind: str) -> None:
        content = text.encode("utf-8")
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        for name, value in HEADERS.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: Any) -> None:
        """Print nothing for each request: the terminal belongs to the user."""


def _open(session: Session) -> Any:
    def again(_: Any) -> dict[str, Any]:
        session.open()
        return session.state

    return again
