import asyncio
import socket

from midair.studio.server import listen


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
