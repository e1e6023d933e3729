import socket
import urllib.error
import urllib.request

import pytest

from midair.devices import StopPort

ORIGIN = "http://127.0.0.1:8123"


@pytest.fixture
def port():
    silenced = []
    listening = socket.create_server(("127.0.0.1", 0))
    made = StopPort(listening, "word", (ORIGIN,), lambda: silenced.append(1))
    made.start()
    yield listening.getsockname()[1], silenced
    made.close()
    listening.close()


def post(port, body=b"word", **headers):
    asked = urllib.request.Request(f"http://127.0.0.1:{port}/stop", data=body, headers=headers, method="POST")
    try:
        with urllib.request.urlopen(asked, timeout=5) as answer:
            return answer.status, answer.read(), answer.headers
    except urllib.error.HTTPError as wrong:
        with wrong:
            return wrong.code, wrong.read(), wrong.headers


def test_own_page_silences_and_gets_confirmation(port):
    number, silenced = port
    status, said, headers = post(number, Origin=ORIGIN)
    assert (status, said, silenced) == (200, b"silent\n", [1])
    assert headers["Access-Control-Allow-Origin"] == ORIGIN


def test_other_callers_are_refused(subtests, port):
    for body, headers in [
        (b"wrong", {"Origin": ORIGIN}),
        (b"word", {"Origin": "http://evil.example"}),
        (b"word", {}),
        (b"x" * 300, {"Origin": ORIGIN}),
    ]:
        with subtests.test(body=body):
            number, silenced = port
            assert post(number, body, **headers)[0] == 403
            assert silenced == []


def test_failure_to_silence_is_reported():
    def fail():
        raise OSError("the link is lost")

    with socket.create_server(("127.0.0.1", 0)) as listening:
        made = StopPort(listening, "word", (ORIGIN,), fail)
        made.start()
        status, said, _ = post(listening.getsockname()[1], Origin=ORIGIN)
        assert status == 500
        assert b"silence was not confirmed: the link is lost" in said
        made.close()


def test_silent_connection_blocks_no_other(port):
    number, silenced = port
    with socket.create_connection(("127.0.0.1", number)):
        assert post(number, Origin=ORIGIN)[0] == 200
    assert silenced == [1]
