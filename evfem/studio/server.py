"""The server of the studio: http on 127.0.0.1, from the standard library.

Only this machine is served: the socket is bound to 127.0.0.1, a request must name it (`Host`), and one that a
page of another origin sends (`Origin`, `Sec-Fetch-Site`) is refused, so that a site that is open in the same
browser can neither read nor start anything. The page loads nothing from elsewhere, and its policy forbids it.
Tried and left: Starlette with uvicorn takes 45 of these lines away and brings 7 packages; NiceGUI brings 49.
"""

from __future__ import annotations

import sys
import threading
import webbrowser
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from evfem.common.checks import real
from evfem.common.storage import disk
from evfem.errors import EvfemError, InputError
from evfem.studio import page, runs
from evfem.studio.state import parse
from evfem.textures.library import about, names

ADDRESS = "127.0.0.1"
#: bytes of a state and of an upload
MOST_STATE, MOST_UPLOAD = 1_000_000, 16_000_000
#: seconds that a connection may be silent while it sends
PATIENCE = 30.0
ASSETS = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/studio.css": ("studio.css", "text/css; charset=utf-8"),
    "/studio.js": ("studio.js", "text/javascript; charset=utf-8"),
    "/charts.js": ("charts.js", "text/javascript; charset=utf-8"),
}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data: blob:; frame-ancestors 'none'; "
    "base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Refused(Exception):
    """A request that gets a status and a sentence."""

    def __init__(self, status: HTTPStatus, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


class Studio(ThreadingHTTPServer):
    """The server; `url` is where the page is."""

    daemon_threads = True

    def __init__(self, port: int = 0) -> None:
        allowed = "a port from 0 (any that is free) to 65535"
        number = int(real("port", port, allowed, lambda p: 0 <= p <= 65535 and p == int(p)))
        with disk(f"use port {number}"):
            super().__init__((ADDRESS, number), Handler)

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{ADDRESS}:{self.server_address[1]}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A connection that broke is no news."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    """One connection."""

    protocol_version = "HTTP/1.1"
    server_version, sys_version = "evfem", ""
    timeout = PATIENCE
    server: Studio

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing is logged."""

    def do_GET(self) -> None:
        self._answered(self._get)

    def do_POST(self) -> None:
        self._answered(self._post)

    def _answered(self, what: Callable[[], None]) -> None:
        """Do `what`; a mistake becomes a sentence with a status."""
        try:
            self._check_sender()
            what()
        except Refused as error:
            self.close_connection = True  # whatever else it sent is not read
            self._say({"error": str(error)}, error.status)
        except EvfemError as error:
            wrong, failed = HTTPStatus.BAD_REQUEST, HTTPStatus.INTERNAL_SERVER_ERROR
            self._say({"error": str(error)}, wrong if isinstance(error, InputError) else failed)

    def _check_sender(self) -> None:
        port = self.server.server_address[1]
        hosts = {f"{name}:{port}" for name in (ADDRESS, "localhost")}
        if self.headers.get_all("Host", []) not in [[host] for host in hosts]:
            raise Refused(HTTPStatus.FORBIDDEN, "another host was asked for")
        origin = self.headers.get("Origin")
        if origin is not None and origin not in {f"http://{host}" for host in hosts}:
            raise Refused(HTTPStatus.FORBIDDEN, "another origin asks")
        if self.headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none"):
            raise Refused(HTTPStatus.FORBIDDEN, "another site asks")

    def _asked(self) -> tuple[str, dict[str, str]]:
        """Path and options of the request's address."""
        try:
            parts = urlsplit(self.path)
        except ValueError:  # as http://[/
            raise Refused(HTTPStatus.BAD_REQUEST, "the address of a request must be one") from None
        return parts.path, dict(parse_qsl(parts.query))

    def _get(self) -> None:
        path, _ = self._asked()
        if path == "/library":
            self._say([{"name": name, "about": about(name)} for name in names()])
        elif path in ASSETS:
            name, kind = ASSETS[path]
            content = (Path(__file__).parent / "assets" / name).read_bytes()
            self._send(page.with_choices(content) if path == "/" else content, kind)
        else:
            raise Refused(HTTPStatus.NOT_FOUND, "there is no such page")

    def _post(self) -> None:
        path, query = self._asked()
        body = self._body(MOST_UPLOAD if path == "/upload" else MOST_STATE)
        if path == "/answer":
            self._say(page.answer(parse(body)))
        elif path == "/upload":
            self._say(page.uploaded(body, query.pop("name", ""), query))
        elif path == "/file":
            kind = query.get("kind", "")
            data, (name, media) = page.file(parse(body), kind), page.FILES[kind]
            self._send(data, media, name)
        elif path == "/run":
            self._stream(body.decode("utf-8", "replace"), query.get("encoding") == "exact")
        else:
            raise Refused(HTTPStatus.NOT_FOUND, "there is no such question")

    def _body(self, most: int) -> bytes:
        """The request's body; what is too long is not read."""
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit()) or len(length) > 12:
            raise Refused(HTTPStatus.LENGTH_REQUIRED, "the length of a request must be said")
        if int(length) > most:
            sentence = f"{int(length) / 1e6:.1f} MB are too much; allowed: {most / 1e6:g} MB"
            raise Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, sentence)
        return self.rfile.read(int(length))

    def _stream(self, state: str, exact: bool) -> None:
        """Lines of JSON as a run says them; the connection's end is the run's end."""
        begun = False

        def send(line: dict[str, Any]) -> None:
            nonlocal begun
            if not begun:
                self._head(HTTPStatus.OK, "application/x-ndjson", None)
                self.end_headers()
                begun = True
            self.wfile.write(page.text(line) + b"\n")
            self.wfile.flush()

        self.close_connection = True
        runs.run(state, exact, send)

    def _head(self, status: int, kind: str, length: int | None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        if length is None or self.close_connection:
            self.send_header("Connection", "close")
        if length is not None:
            self.send_header("Content-Length", str(length))

    def _send(self, data: bytes, kind: str, name: str | None = None, status: int = HTTPStatus.OK) -> None:
        self._head(status, kind, len(data))
        if name is not None:
            self.send_header("Content-Disposition", f'attachment; filename="{name}"')
        self.end_headers()
        self.wfile.write(data)

    def _say(self, told: Any, status: int = HTTPStatus.OK) -> None:
        self._send(page.text(told), "application/json", status=status)


def warm() -> None:
    """Load what the first answer needs."""
    page.answer(parse("{}"))


def serve(port: int, browser: bool) -> None:
    """Serve until interrupted; says where the page is, and opens it in a browser."""
    with Studio(port) as server:
        threading.Thread(target=warm, daemon=True).start()
        print(f"the studio is at {server.url}, Ctrl-C ends it", flush=True)
        if browser:
            webbrowser.open(server.url)
        try:
            server.serve_forever(poll_interval=0.2)
        except KeyboardInterrupt:
            print("the studio is closed", flush=True)
