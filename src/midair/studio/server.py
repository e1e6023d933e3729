"""The studio's web server on the loopback interface, with its login link."""

import socket
import sys
import webbrowser
from asyncio import BaseTransport
from collections.abc import Callable

import uvicorn
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from midair.devices import signals_end_the_program
from midair.errors import DeviceError, InputError
from midair.studio.application import Studio, StudioPlan
from midair.studio.folders import folder_of_session
from midair.studio.studio_state import LARGEST_ORDER


def listen(port: int) -> socket.socket:
    """Bind a TCP socket to the loopback interface; InputError for an invalid port, DeviceError if it is in use."""
    if not 0 <= port < 65536:
        raise InputError(f"--port: expected 0 (any that is free) to 65535, got {port}")
    # IPPROTO_TCP is explicit: asyncio sets TCP_NODELAY only then. Otherwise each small message waits until the page has
    # acknowledged the one before, which it does when it draws.
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    if sys.platform != "win32":
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind(("127.0.0.1", port))
    except OSError as wrong:
        listening.close()
        raise DeviceError(f"--port {port}: expected a free port, got: {wrong.strerror}; omit --port") from wrong
    return listening


def open_studio(plan: StudioPlan, *, port: int = 0, browser: bool = True) -> None:
    """Serve a studio until Ctrl-C or a signal ends it.

    Port 0 chooses a free one; `browser` opens the login link there. Raises InputError if the port is invalid,
    DeviceError if it is in use, MissingFileError if the folder does not exist.
    """
    with listen(port) as listening, folder_of_session() as samples:
        studio = Studio(plan, samples, listening.getsockname()[1])
        config = uvicorn.Config(
            studio.application(),
            log_level="warning",
            access_log=False,
            server_header=False,
            date_header=False,
            loop="asyncio",
            ws=_PageProtocol,
            ws_max_size=LARGEST_ORDER,
            ws_per_message_deflate=False,
            timeout_graceful_shutdown=2,
            lifespan="on",
        )
        # After its own end, the server raises the signal again.
        with signals_end_the_program():
            _Server(config, lambda: _announce(studio.keys.link(), browser)).run(sockets=[listening])


def _announce(link: str, browser: bool) -> None:
    sys.stdout.write(f"{link}\n")
    sys.stdout.flush()
    if browser:
        webbrowser.open(link)


class _PageProtocol(WebSocketsSansIOProtocol):
    """Receives 4 KiB at a time; the 15,000 short messages in 256 KiB of asyncio take a tenth of a second to read."""

    def connection_made(self, transport: BaseTransport) -> None:
        """Set the size before the first message is received."""
        setattr(transport, "max_size", 4096)  # noqa: B010  # an attribute of asyncio's own transports, without a type
        super().connection_made(transport)


class _Server(uvicorn.Server):
    """Calls `ready` when the server accepts requests."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start, then call `ready`."""
        await super().startup(sockets=sockets)
        self._ready()
