import asyncio
import socket

import pytest
from tests.waiting import Clock

from midair.studio.request_guard import LoginTokens, RequestGuard
from midair.studio.server import listen

PORT = 8123
OURS = f"http://127.0.0.1:{PORT}"


@pytest.fixture
def keys():
    return LoginTokens(port=PORT, clock=Clock(0.0))


async def inner(scope, receive, send):
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"inside"})


def asked(keys, *, path="/", method="GET", kind="http", query="", inner=inner, **headers):
    """Status, headers (none twice) and body of an answer; headers with _ for -, a list for a repeated header."""
    raw = [(b"host", f"127.0.0.1:{PORT}".encode())] if "host" not in headers else []
    for name, values in headers.items():
        each = values if isinstance(values, list) else [values]
        raw += [(name.replace("_", "-").encode(), value.encode()) for value in each]
    scope = {"type": kind, "path": path, "method": method, "query_string": query.encode(), "headers": raw}
    if kind == "websocket":
        del scope["method"]
    sent = []

    async def send(message):
        sent.append(message)

    asyncio.run(RequestGuard(inner, keys, stop_port=999)(scope, None, send))
    if kind == "websocket" and sent[0]["type"] == "websocket.close":
        return 403, {}, b""
    found = dict(given := sent[0]["headers"])
    assert len(found) == len(given)
    return sent[0]["status"], found, sent[1]["body"]


def cookie(keys):
    return f"{keys.cookie}={keys.session}"


def test_own_pages_posts_and_sockets_are_allowed_by_the_three_names_of_this_computer(keys):
    status, headers, body = asked(keys, cookie=cookie(keys))
    assert (status, body) == (200, b"inside")
    policy = headers[b"content-security-policy"].decode()
    assert "default-src 'none'" in policy
    assert "script-src 'self'" in policy
    assert "unsafe" not in policy
    assert "connect-src 'self' http://127.0.0.1:999;" in policy
    assert headers[b"x-content-type-options"] == b"nosniff"
    for name in ["127.0.0.1", "localhost", "[::1]"]:
        assert asked(keys, host=f"{name}:{PORT}", cookie=cookie(keys))[0] == 200, name
    assert asked(keys, method="POST", origin=OURS, cookie=cookie(keys))[0] == 200
    assert asked(keys, kind="websocket", origin=OURS, cookie=cookie(keys), sec_fetch_site="same-origin")[0] == 200


REFUSED = {
    "a foreign host": {"host": "evil.example:8123"},
    "our address, another port": {"host": "127.0.0.1:80"},
    "no port": {"host": "127.0.0.1"},
    "a host that only begins like ours": {"host": "127.0.0.1.evil.example:8123"},
    "two hosts": {"host": [f"127.0.0.1:{PORT}", "evil.example"]},
    "no host": {"host": []},
    "a foreign origin": {"origin": "http://evil.example"},
    "an origin of another port": {"origin": "http://127.0.0.1:9999"},
    "an origin of a file": {"origin": "null"},
    "another site": {"sec_fetch_site": "cross-site"},
    "another port of this computer": {"sec_fetch_site": "same-site"},
    "a post without origin": {"method": "POST"},
    "a post from elsewhere": {"method": "POST", "origin": "http://evil.example"},
    "a put from elsewhere": {"method": "PUT", "origin": "http://evil.example"},
    "a socket without origin": {"kind": "websocket"},
    "a socket from elsewhere": {"kind": "websocket", "origin": "http://evil.example"},
    "a socket of another port": {"kind": "websocket", "origin": "http://127.0.0.1:1"},
    "a socket by TLS": {"kind": "websocket", "origin": f"https://127.0.0.1:{PORT}"},
}


def test_other_pages_get_403_even_with_the_cookie(keys):
    assert [case for case in REFUSED if asked(keys, cookie=cookie(keys), **REFUSED[case])[0] != 403] == []


def test_request_with_a_wrong_cookie_is_refused(keys):
    for given in ["", "midair-8123=", "midair-8123=wrong", "midair-8124={}", "session={}", "a=b; =;;"]:
        headers = {"cookie": given.format(keys.session)} if given else {}
        status, _, body = asked(keys, **headers)
        assert (status, b"open the link" in body) == (403, True), given
        assert asked(keys, kind="websocket", origin=OURS, **headers)[0] == 403, given


def test_the_link_works_once_and_gives_a_cookie_that_no_script_reads(keys):
    link = keys.link()
    assert link.startswith(f"http://127.0.0.1:{PORT}/enter?key=")
    query = link.partition("?")[2]
    status, headers, _ = asked(keys, path="/enter", query=query, sec_fetch_site="cross-site")
    assert status == 200
    said = headers[b"set-cookie"].decode()
    assert said == f"{keys.cookie}={keys.session}; Path=/; HttpOnly; SameSite=Strict"
    assert asked(keys, path="/enter", query=query)[0] == 403


def test_the_link_works_for_five_minutes_also_after_a_wrong_key_or_a_foreign_host(keys):
    query = keys.link().partition("?")[2]
    for wrong in ["", "key=", "key=wrong", "key=a&key=b"]:
        assert asked(keys, path="/enter", query=wrong)[0] == 403, wrong
    assert asked(keys, path="/enter", query=query, host="evil.example")[0] == 403
    keys.clock.now = 299
    assert asked(keys, path="/enter", query=query)[0] == 200
    query = keys.link().partition("?")[2]
    keys.clock.now += 301
    assert asked(keys, path="/enter", query=query)[0] == 403


def test_response_may_set_a_stricter_policy(keys):
    async def report(scope, receive, send):
        headers = [(b"content-security-policy", b"sandbox")]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": b""})

    _, headers, _ = asked(keys, inner=report, cookie=cookie(keys))
    assert headers[b"content-security-policy"] == b"sandbox"


def test_used_link_works_only_for_a_browser_that_is_logged_in(keys):
    key = keys.link().partition("?")[2]
    assert asked(keys, path="/enter", query=key)[0] == 200
    status, headers, body = asked(keys, path="/enter", query=key, cookie=cookie(keys))
    assert status == 200
    assert b"url=/" in body
    assert b"set-cookie" not in headers
    assert asked(keys, path="/enter", query=key)[0] == 403
    assert asked(keys, path="/enter", query=key, cookie=f"{keys.cookie}=guessed")[0] == 403
    assert asked(keys, path="/enter", query=key, cookie=cookie(keys), origin="http://evil.example")[0] == 403


def test_messages_are_sent_without_delay():
    """No message waits for the acknowledgement of the previous one, which would delay samples by a picture."""

    async def connected():
        took = asyncio.get_running_loop().create_future()

        class Studio(asyncio.Protocol):
            def connection_made(self, transport):
                took.set_result(transport.get_extra_info("socket").getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))

        with listen(0) as listening:
            server = await asyncio.get_running_loop().create_server(Studio, sock=listening)
            page = socket.create_connection(listening.getsockname())
            at_once = await took
            page.close()
            server.close()
            return at_once

    assert asyncio.run(connected())
