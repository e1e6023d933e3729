"""Access control: only the studio's own page in this computer's browser, after a login link that works once.

The array can harm hearing. A website that is open in the same browser can send requests to this computer and, with DNS
rebinding, even read the answers; so every request must have the Host, Origin and cookie of the studio's own page.
"""

import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from hmac import compare_digest
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import HTMLResponse, PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

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

    def __init__(self, app: ASGIApp, keys: LoginTokens, *, stop_port: int = 0) -> None:
        self._app, self._keys = app, keys
        stop = f" http://127.0.0.1:{stop_port}" if stop_port else ""
        self._headers = {
            "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
            f"media-src 'self'; connect-src 'self'{stop}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
            "x-content-type-options": "nosniff",
            "referrer-policy": "no-referrer",
            "cross-origin-opener-policy": "same-origin",
            "cross-origin-resource-policy": "same-origin",
            "cache-control": "no-store",
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse the request or pass it on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in self._headers.items():
                    # A response may set a stricter policy, as that of the report does.
                    headers.setdefault(name, value)
            await send(message)

        refusal, entry = self.refusal(scope), scope["type"] == "http" and scope["path"] == ENTRY
        answer = _refused(refusal) if refusal else self._enter(scope) if entry else self._app
        if refusal and scope["type"] == "websocket":
            # Closing before acceptance makes the server answer 403.
            answer = WebSocketClose(1008)
        await answer(scope, receive, sending)

    def refusal(self, scope: Scope) -> str:
        """Reason to refuse a request; empty for the studio's own page.

        Only the raw headers count, and a header that occurs twice is refused: frameworks build an address from a Host
        that the sender chose.
        """
        headers = Headers(scope=scope)
        port = self._keys.port
        if _one(headers, "host") not in {f"{name}:{port}" for name in NAMES}:
            return "expected the address of the studio, got another host"
        if scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD"):
            if _one(headers, "origin") != f"http://{_one(headers, 'host')}":
                return "the request came from another page"
        elif "origin" in headers and _one(headers, "origin") != f"http://{_one(headers, 'host')}":
            return "the request came from another page"
        enters = scope["type"] == "http" and scope["path"] == ENTRY
        # The link may be opened from any page: its key is the proof, and it leads only to the start page.
        sites = ("none", "same-origin", *(("cross-site", "same-site") if enters else ()))
        if "sec-fetch-site" in headers and _one(headers, "sec-fetch-site") not in sites:
            return "the request came from another page"
        if enters:
            return ""
        if not self._keys.known(_one(headers, "cookie")):
            return "this browser is not logged in: open the link that midair studio printed; it works once"
        return ""

    def _enter(self, scope: Scope) -> ASGIApp:
        given = parse_qs(scope["query_string"].decode("latin-1")).get("key", [""])
        if self._keys.known(_one(Headers(scope=scope), "cookie")) and scope["method"] == "GET":
            # A browser that is logged in may open the used link again.
            return HTMLResponse(_ONWARDS)
        if scope["method"] != "GET" or len(given) != 1 or not self._keys.take(given[0]):
            why = "this link was used before or is older than five minutes: start midair studio again for a new one"
            return _refused(why)
        cookie = f"{self._keys.cookie}={self._keys.session}; Path=/; HttpOnly; SameSite=Strict"
        return HTMLResponse(_ONWARDS, headers={"set-cookie": cookie})


def _one(headers: Headers, name: str) -> str:
    """Return the value of a header; empty if it is missing or occurs twice."""
    values = headers.getlist(name)
    return values[0] if len(values) == 1 else ""


def _refused(why: str) -> PlainTextResponse:
    return PlainTextResponse(f"midair studio: {why}\n", 403)


_ONWARDS = """<!doctype html><html lang="en"><meta charset="utf-8"><title>midair studio</title>
<meta http-equiv="refresh" content="0; url=/"><p><a href="/">midair studio</a></p>"""
"""Loads the start page by itself: after a click on another site, a redirect would not carry the new strict cookie."""
