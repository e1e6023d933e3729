"""Who may speak to the studio: its own page in this computer's browser, after a link that works once.

The array can hurt ears. A page of somebody else, open in the same browser, can send requests to this computer, and with
its own name pointed here (DNS rebinding) even read the answers; so every request is held against what only ours has.
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
"""Where the one-time link leads."""

NAMES = ("127.0.0.1", "localhost", "[::1]")
"""By which this computer may be addressed."""


@dataclass(slots=True, kw_only=True)
class LoginTokens:
    """The one-time link and the cookie that it is changed for.

    Attributes
    ----------
    port : int
        Of the studio.
    lasts : float
        For how long the link works, in s.
    clock : callable
        Seconds that never go back.
    """

    port: int
    lasts: float = 300.0
    clock: Callable[[], float] = time.monotonic
    session: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    _link: str = ""
    _until: float = 0.0

    @property
    def cookie(self) -> str:
        """Name of the cookie: two studios on one computer must not take each other's."""
        return f"midair-{self.port}"

    def link(self) -> str:
        """A new link, which works once; one that was made before works no more."""
        self._link, self._until = secrets.token_urlsafe(32), self.clock() + self.lasts
        return f"http://127.0.0.1:{self.port}{ENTRY}?key={self._link}"

    def take(self, key: str) -> bool:
        """Whether this is the key of the link, which is used up by that."""
        right = bool(self._link) and self.clock() < self._until and compare_digest(key.encode(), self._link.encode())
        if right:
            self._link = ""
        return right

    def known(self, cookies: str) -> bool:
        """Whether a Cookie header has our session."""
        try:
            found = SimpleCookie(cookies).get(self.cookie)
        except CookieError:
            return False
        return found is not None and compare_digest(found.value.encode(), self.session.encode())


class RequestGuard:
    """An ASGI application in front of another: refuses with 403 what is not our own page, and sets our headers.

    Parameters
    ----------
    app : callable
        That answers what is let through.
    keys : DoorKeys
        Of this studio.
    stop_port : int
        Where the player listens for STOP: the one other place to which the page may speak; 0 for none.
    """

    def __init__(self, app: App, keys: LoginTokens, *, stop_port: int = 0) -> None:
        self._app, self._keys, self._stop_port = app, keys, stop_port

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or hand on."""
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
        """Why a request is not let through; empty for our own page.

        What stands in the raw headers counts, twice the same header is refused, and nothing is put together from them:
        frameworks build an address from a Host that the sender chose.
        """
        headers = _Headers(scope["headers"])
        port = self._keys.port
        if headers.one("host") not in {f"{name}:{port}" for name in NAMES}:
            return "this address is not the studio's"
        if scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD"):
            if headers.one("origin") != f"http://{headers.one('host')}":
                return "this came from another page"
        elif headers.has("origin") and headers.one("origin") != f"http://{headers.one('host')}":
            return "this came from another page"
        if headers.has("sec-fetch-site") and headers.one("sec-fetch-site") not in self._sites(scope):
            return "this came from another page"
        if scope["type"] == "http" and scope["path"] == ENTRY:
            return ""
        if not self._keys.known(headers.one("cookie")):
            return "the studio does not know this browser: open the link that it printed, which works once"
        return ""

    def _sites(self, scope: Scope) -> tuple[str, ...]:
        # The link may be clicked wherever it was printed: it carries its own proof, and leads to the start page alone.
        if scope["type"] == "http" and scope["path"] == ENTRY:
            return ("none", "same-origin", "cross-site", "same-site")
        return ("none", "same-origin")

    async def _enter(self, scope: Scope, send: Send) -> None:
        """Change a link for the cookie."""
        given = parse_qs(scope["query_string"].decode("latin-1")).get("key", [""])
        if self._keys.known(_Headers(scope["headers"]).one("cookie")) and scope["method"] == "GET":
            # Who came in by it before finds the link in the terminal again, and is known: no reason to turn them away.
            await send({"type": "http.response.start", "status": 200, "headers": [*self._headers(), _HTML]})
            await send({"type": "http.response.body", "body": _ONWARDS})
            return
        if scope["method"] != "GET" or len(given) != 1 or not self._keys.take(given[0]):
            why = "this link was used, or is older than five minutes: start midair studio again for a new one"
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
                # What answers may narrow the policy of its own page, as the report's does.
                message = {**message, "headers": [*given, *(each for each in ours if each[0] not in names)]}
            await send(message)

        return sending


class _Headers:
    """The raw headers of a request."""

    def __init__(self, raw: Iterable[tuple[bytes, bytes]]) -> None:
        self._all: dict[str, list[str]] = {}
        for name, value in raw:
            self._all.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))

    def has(self, name: str) -> bool:
        return name in self._all

    def one(self, name: str) -> str:
        """Its value; empty where there is none, or more than one."""
        values = self._all.get(name, [])
        return values[0] if len(values) == 1 else ""


_ONWARDS = b"""<!doctype html><html lang="en"><meta charset="utf-8"><title>midair studio</title>
<meta http-equiv="refresh" content="0; url=/"><p><a href="/">midair studio</a></p>"""
"""Sends itself on: after a click elsewhere, a redirect would come without the new, strict cookie."""

_HTML = (b"content-type", b"text/html; charset=utf-8")


async def _refuse(scope: Scope, send: Send, why: str, headers: list[tuple[bytes, bytes]]) -> None:
    if scope["type"] == "websocket":
        # Closed before it was accepted: the browser gets 403.
        await send({"type": "websocket.close", "code": 1008, "reason": ""})
        return
    plain = (b"content-type", b"text/plain; charset=utf-8")
    await send({"type": "http.response.start", "status": 403, "headers": [*headers, plain]})
    await send({"type": "http.response.body", "body": f"midair studio: {why}\n".encode()})
