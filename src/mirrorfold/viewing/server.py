"""The server of the live page. It serves this machine only, at a few addresses, none of which leads to a file by name.

Pages of other origins cannot use the server: a request must name this machine as its host, which a rebound domain name
does not, and a request that folds or saves must carry the token that only the page itself has received. Other users of
the machine cannot use it either: the page is sent only for a link that works once, and after that to the browser that
received the cookie with it. (All users can read the command line of a browser, which contains the link.)
"""

from __future__ import annotations

import json
import secrets
import sys
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

from mirrorfold.common.reading import not_too_deep
from mirrorfold.errors import InputError
from mirrorfold.reporting.page import to_html, to_json
from mirrorfold.viewing.session import ConflictError, Session

LOOPBACK = "127.0.0.1"
"""Address at which only programs on this machine reach the server."""

HOSTS = ("127.0.0.1", "localhost", "[::1]")
"""Names by which a browser on this machine calls the server."""

LARGEST_REQUEST = 1_000_000
"""Largest request that is read [bytes]; a thousand mirrors take a tenth of it."""

LONGEST_LENGTH = 20
"""Number of digits from which on the stated length of a request is not read as a number, but taken for too large."""

TOKEN_HEADER = "X-Mirrorfold-Token"
"""Header of a request that carries the page's token."""

HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


class Server(ThreadingHTTPServer):
    """A server of one session on the loopback address.

    Parameters
    ----------
    session : Session
    port : int
        Port of the server; 0 for any free port.

    Raises
    ------
    InputError
        If the port is taken or is no port number.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, session: Session, port: int = 0) -> None:
        self.session = session
        self.token, self._secret = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
        self._keys: set[str] = set()
        if not 0 <= port <= 65535:
            raise InputError(f"port is {port}, expected a number from 1 to 65535, or 0 for any that is free")
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except OSError as error:
            raise InputError(f"port {port}: cannot be had ({error.strerror}); choose another, or 0 for any") from None

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing where the browser has closed the connection; print other errors, which are bugs."""
        if not isinstance(sys.exc_info()[1], ConnectionError | TimeoutError):
            super().handle_error(request, client_address)

    @property
    def address(self) -> str:
        """Address of the page, for the browser that has the cookie."""
        return f"http://{LOOPBACK}:{self.server_port}/"

    @property
    def cookie(self) -> str:
        """The cookie that a request must carry. Its name contains the port, because cookies are shared by all ports."""
        return f"mirrorfold_{self.server_port}={self._secret}"

    def link(self) -> str:
        """A new link to the page, which works once."""
        key = secrets.token_urlsafe(24)
        self._keys.add(key)
        return f"{self.address}?key={key}"

    def admits(self, query: str) -> bool:
        """Whether the query of an address holds the key of an unused link, which is used up by this."""
        try:
            self._keys.remove(query.removeprefix("key="))
        except KeyError:
            return False
        return True


class _Handler(BaseHTTPRequestHandler):
    """The answer to one request."""

    server: Server
    protocol_version = "HTTP/1.1"
    timeout = 60

    def do_GET(self) -> None:
        """Send the page, or the state of the session."""
        if not self._is_local():
            return
        path, query = _split(self.path)
        if path in ("/", "/api/state") and not self._is_known(path, query):
            return
        if path == "/":
            live = {"token": self.server.token, "header": TOKEN_HEADER}
            page = to_html({}, title=self.server.session.path.name, live=live)
            self._send(HTTPStatus.OK, page, "text/html; charset=utf-8", cookie=True)
        elif path == "/api/state":
            self._send_json(HTTPStatus.OK, self.server.session.state)
        elif path == "/favicon.ico":
            self._send(HTTPStatus.NO_CONTENT, "", "image/x-icon")
        else:
            self._refuse(HTTPStatus.NOT_FOUND, "there is nothing at this address")

    def do_POST(self) -> None:
        """Fold, stop a fold, save, or open the file again."""
        if not self._is_local():
            return
        request = self._request()
        if request is None or not self._is_known("", ""):
            return
        session = self.server.session
        actions = {"/api/fold": session.fold, "/api/save": session.save, "/api/open": _open(session)}
        actions["/api/cancel"] = session.cancel
        action = actions.get(_split(self.path)[0])
        if action is None:
            self._refuse(HTTPStatus.NOT_FOUND, "there is nothing at this address")
            return
        try:
            answer = action(request)
        except ConflictError as error:
            self._refuse(HTTPStatus.CONFLICT, str(error))
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
        """Whether the request names this machine as host and origin; it is refused otherwise."""
        names = {f"{host}:{self.server.server_port}" for host in HOSTS}
        origin = self.headers.get("Origin")
        if self.headers.get("Host", "").lower() in names and (
            origin is None or origin.lower() in {f"http://{name}" for name in names}
        ):
            return True
        self._refuse(HTTPStatus.FORBIDDEN, "only a browser on this machine may look")
        return False

    def _is_known(self, path: str, query: str) -> bool:
        """Whether the request has the cookie, or asks for the page by an unused link; it is refused otherwise."""
        brought = [item.strip().encode() for item in self.headers.get("Cookie", "").split(";")]
        if any(secrets.compare_digest(item, self.server.cookie.encode()) for item in brought):
            return True
        if path == "/" and self.server.admits(query):
            return True
        self._refuse(
            HTTPStatus.FORBIDDEN,
            "the page is for the browser that opened it first, by a link that works once; if that was not you, end "
            "mirrorfold view, and start it again for a new link",
        )
        return False

    def _request(self) -> Any:
        """The JSON object that was sent; None, after a refusal, if it is too long, has no token, or is no object."""
        said = self.headers.get_all("Content-Length", [])
        if not said:
            self._refuse(HTTPStatus.LENGTH_REQUIRED, "the request does not say its length")
            return None
        if len(said) > 1 or not (said[0].isascii() and said[0].isdigit()):
            self._refuse(HTTPStatus.BAD_REQUEST, "the length of the request is no number of bytes")
            return None
        length = int(said[0]) if len(said[0]) < LONGEST_LENGTH else 10**LONGEST_LENGTH
        if not 0 < length <= LARGEST_REQUEST:
            # A browser reads the answer only after all of its request has been received.
            self.rfile.read(length if length <= 4 * LARGEST_REQUEST else 0)
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"expected a request of 1 to {LARGEST_REQUEST} bytes")
            return None
        body = self.rfile.read(length)
        if len(body) < length:
            self._refuse(HTTPStatus.BAD_REQUEST, "the request is shorter than the length that it says")
            return None
        if not secrets.compare_digest(self.headers.get(TOKEN_HEADER, "").encode(), self.server.token.encode()):
            self._refuse(HTTPStatus.FORBIDDEN, "the page is not of this server any more; load it again")
            return None
        try:
            content = not_too_deep(json.loads(body))
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            self._refuse(HTTPStatus.BAD_REQUEST, "the request is not a JSON object, or is nested too deeply")
            return None
        return content

    def _refuse(self, status: HTTPStatus, message: str) -> None:
        """Send a message that says why the request is refused, and close the connection."""
        self.close_connection = True
        self._send_json(status, {"message": message})

    def _send_json(self, status: HTTPStatus, content: Any) -> None:
        """Send an answer in JSON."""
        self._send(status, to_json(content), "application/json")

    def _send(self, status: HTTPStatus, text: str, kind: str, *, cookie: bool = False) -> None:
        """Send an answer of a media type, with the cookie if it is asked for."""
        content = text.encode("utf-8")
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        for name, value in HEADERS.items():
            self.send_header(name, value)
        if cookie:
            self.send_header("Set-Cookie", f"{self.server.cookie}; Path=/; HttpOnly; SameSite=Strict")
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: Any) -> None:
        """Print nothing for each request: the terminal belongs to the user."""


def _split(address: str) -> tuple[str, str]:
    """Path and query of the address in a request; empty where it is not valid."""
    try:
        _, _, path, query, _ = urlsplit(address)
    except ValueError:
        return "", ""
    return path, query


def _open(session: Session) -> Any:
    """The action that opens the file again."""

    def again(_: Any) -> dict[str, Any]:
        session.open()
        return session.state

    return again
