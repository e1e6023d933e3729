"""Access control: only the studio's own page in this computer's browser, after a login link that works once.

The array can harm hearing. A website that is open in the same browser can send requests to this computer and, with DNS
rebinding, even read the answers; so every request must have the Host, Origin and cookie of the studio's own page.
"""

import secrets
import time
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from dataclasses import dataclass, field
from hmac import compare_digest
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

ENTRY = "/enter"
"""Path of the login link."""

NAMES = ("127.0.0.1", "localhost", "[::1]")
"""Host names that requests may use."""


@dataclass(slots=True, kw_only=True)
class LoginTokens:
    """The login link and the session cookie that replaces it."""

    port: int
    lasts: float = 300.0
    """Seconds for which the link works."""
    clock: Callable[[], float] = time.monotonic
    session: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    _link: str = ""
    _until: float = 0.0

    @property
    def cookie(self) -> str:
        """Name of the cookie; it has the port, so that two studios on one computer do not share it."""
        return f"midair-{self.port}"

    def link(self) -> str:
        """Create a link that works once; earlier links become invalid."""
        self._link, self._until = secrets.token_urlsafe(32), self.clock() + self.lasts
        return f"http://127.0.0.1:{self.port}{ENTRY}?key={self._link}"

    def take(self, key: str) -> bool:
        """True if this is the key of the link, which is then used up."""
        right = bool(self._link) and self.clock() < self._until and compare_digest(key.encode(), self._link.encode())
        if right:
            self._link = ""
        return right

    def known(self, cookies: str) -> bool:
        """True if a Cookie header contains the session."""
        try:
            found = SimpleCookie(cookies).get(self.cookie)
        except CookieError:
            return False
        return found is not None and compare_digest(found.value.encode(), self.session.encode())


class RequestGuard:
    """ASGI middleware that refuses requests of other pages with 403 and sets the security headers.

    `stop_port` is the player's port for STOP, the only other address that the page may use; 0 for none.
    """

    def __init__(self, app: App, keys: LoginTokens, *, stop_port: int = 0) -> None:
        self._app, self._keys, self._stop_port = app, keys, stop_port

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse the request or pass it on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        refusal = self.refusal(scope)
        if refusal:
            await _refuse(scope, send, refusal, self._headers())
        elif scope["type"] == "http" and scope["path"] == ENTRY:
            await self._enter(scope, send)
        else:
            await self._app(scope, receive, self._with_headers(send))

    def refusal(self, scope: Scope) -> str:
        """Reason to refuse a request; empty for the studio's own page.

        Only the raw headers count, and a header that occurs twice is refused: frameworks build an address from a Host
        that the sender chose.
        """
        headers = _Headers(scope["headers"])
        port = self._keys.port
        if headers.one("host") not in {f"{name}:{port}" for name in NAMES}:
            return "expected the address of the studio, got another host"
        if scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD"):
            if headers.one("origin") != f"http://{headers.one('host')}":
                return "the request came from another page"
        elif headers.has("origin") and headers.one("origin") != f"http://{headers.one('host')}":
            return "the request came from another page"
        if headers.has("sec-fetch-site") and headers.one("sec-fetch-site") not in self._sites(scope):
            return "the request came from another page"
        if scope["type"] == "http" and scope["path"] == ENTRY:
            return ""
        if not self._keys.known(headers.one("cookie")):
            return "this browser is not logged in: open the link that midair studio printed; it works once"
        return ""

    def _sites(self, scope: Scope) -> tuple[str, ...]:
        # The link may be opened from any page: its key is the proof, and it leads only to the start page.
        if scope["type"] == "http" and scope["path"] == ENTRY:
            return ("none", "same-origin", "cross-site", "same-site")
        return ("none", "same-origin")

    async def _enter(self, scope: Scope, send: Send) -> None:
        """Exchange the key of a link for the cookie."""
        given = parse_qs(scope["query_string"].decode("latin-1")).get("key", [""])
        if self._keys.known(_Headers(scope["headers"]).one("cookie")) and scope["method"] == "GET":
            # A browser that is logged in may open the used link again.
            await send({"type": "http.response.start", "status": 200, "headers": [*self._headers(), _HTML]})
            await send({"type": "http.response.body", "body": _ONWARDS})
            return
        if scope["method"] != "GET" or len(given) != 1 or not self._keys.take(given[0]):
            why = "this link was used before or is older than five minutes: start midair studio again for a new one"
            await _refuse(scope, send, why, self._headers())
            return
        cookie = f"{self._keys.cookie}={self._keys.session}; Path=/; HttpOnly; SameSite=Strict"
        headers = [*self._headers(), (b"set-cookie", cookie.encode()), _HTML]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": _ONWARDS})

    def _headers(self) -> list[tuple[bytes, bytes]]:
        stop = f" http://127.0.0.1:{self._stop_port}" if self._stop_port else ""
        policy = (
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
            f"connect-src 'self'{stop}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        return [
            (b"content-security-policy", policy.encode()),
            (b"x-content-type-options", b"nosniff"),
            (b"referrer-policy", b"no-referrer"),
            (b"cross-origin-opener-policy", b"same-origin"),
            (b"cross-origin-resource-policy", b"same-origin"),
            (b"cache-control", b"no-store"),
        ]

    def _with_headers(self, send: Send) -> Send:
        ours = self._headers()

        async def sending(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                given = list(message.get("headers", []))
                names = {name.lower() for name, _ in given}
                # A response may set a stricter policy, as that of the report does.
                message = {**message, "headers": [*given, *(each for each in ours if each[0] not in names)]}
            await send(message)

        return sending


class _Headers:
    """Raw headers of a request."""

    def __init__(self, raw: Iterable[tuple[bytes, bytes]]) -> None:
        self._all: dict[str, list[str]] = {}
        for name, value in raw:
            self._all.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))

    def has(self, name: str) -> bool:
        return name in self._all

    def one(self, name: str) -> str:
        """Return the value; empty if the header is missing or occurs twice."""
        values = self._all.get(name, [])
        return values[0] if len(values) == 1 else ""


_ONWARDS = b"""<!doctype html><html lang="en"><meta charset="utf-8"><title>midair studio</title>
<meta http-equiv="refresh" content="0; url=/"><p><a href="/">midair studio</a></p>"""
"""Loads the start page by itself: after a click on another site, a redirect would not carry the new strict cookie."""

_HTML = (b"content-type", b"text/html; charset=utf-8")


async def _refuse(scope: Scope, send: Send, why: str, headers: list[tuple[bytes, bytes]]) -> None:
    if scope["type"] == "websocket":
        # Closing before acceptance makes the server answer 403.
        await send({"type": "websocket.close", "code": 1008, "reason": ""})
        return
    plain = (b"content-type", b"text/plain; charset=utf-8")
    await send({"type": "http.response.start", "status": 403, "headers": [*headers, plain]})
    await send({"type": "http.response.body", "body": f"midair studio: {why}\n".encode()})
