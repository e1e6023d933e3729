"""The player's own port for STOP: a page reaches it even when the studio's server hangs."""

import socket
import threading
from collections.abc import Callable
from hmac import compare_digest
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

SILENT = b"silent\n"


class StopPort:
    """Answers POST /stop, with the token in its body, after the array is silent.

    `listening` is a bound socket on the loopback interface; `silence` returns when the array is silent, or raises.
    """

    def __init__(
        self, listening: socket.socket, token: str, origins: tuple[str, ...], silence: Callable[[], None]
    ) -> None:
        class StopAnswer(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"
            timeout = 2.0

            def do_POST(self) -> None:
                origin = self.headers.get("Origin", "")
                length = self.headers.get("Content-Length", "")
                if origin not in origins or not length.isdecimal() or int(length) > 256:
                    self._say(403, b"refused\n", "")
                    return
                if not compare_digest(self.rfile.read(int(length)).strip(), token.encode()):
                    self._say(403, b"refused\n", origin)
                    return
                try:
                    silence()
                except Exception as wrong:  # noqa: BLE001  # the page must learn of any failure
                    self._say(500, f"silence was not confirmed: {wrong}\n".encode(), origin)
                else:
                    self._say(200, SILENT, origin)

            def _say(self, status: int, body: bytes, origin: str) -> None:
                self.send_response_only(status)
                self.send_header("Content-Type", "text/plain; charset=utf-8")
                self.send_header("Content-Length", str(len(body)))
                self.send_header("X-Content-Type-Options", "nosniff")
                self.send_header("Connection", "close")
                if origin:
                    self.send_header("Access-Control-Allow-Origin", origin)
                self.end_headers()
                self.wfile.write(body)
                self.close_connection = True

            def log_message(self, format: str, *args: object) -> None:  # the name is the base class's
                """Print nothing."""

        class Server(ThreadingHTTPServer):
            daemon_threads = True

            def __init__(self) -> None:
                super().__init__(listening.getsockname(), StopAnswer, bind_and_activate=False)
                self.socket.close()
                self.socket = listening

            def handle_error(self, request: object, client_address: object) -> None:
                """Ignore clients that disconnect."""

        self._server = Server()

    def start(self) -> None:
        """Serve in a thread."""
        threading.Thread(target=self._server.serve_forever, args=(0.2,), name="stop port", daemon=True).start()

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
