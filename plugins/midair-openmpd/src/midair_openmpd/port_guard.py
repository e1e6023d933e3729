"""A guard process that silences boards at serial ports if the program that drives them fails.

A board repeats its last frame forever: after a program that was killed, or hangs, it would sound on. This file is run
as the guard, by its path and without midair, so that it starts quickly; it imports the standard library only. It also
holds the ports open, reads a pipe, and silences the boards if the pipe ends or stalls while they are active.
"""

import contextlib
import os
import select
import subprocess
import sys
import time
from collections.abc import Sequence

LIMIT = 1.0
"""Maximum time without a heartbeat while the boards are active, in s."""
ACTIVE, QUIET = b"+", b"."


class PortGuard:
    """The guard, as seen by the program that drives the devices (POSIX only).

    `ports` are file descriptors of the open ports, `stop` is the bytes that silence a board. The error of a heartbeat
    contains `name`.
    """

    def __init__(self, name: str, ports: Sequence[int], stop: bytes) -> None:
        self._error = (
            f"{name}: this program was delayed by more than {LIMIT:g} s during playback, and its guard silenced the "
            "boards, or the guard was terminated; close other programs, then play again"
        )
        # Imported here, since the guard itself runs without midair.
        from midair.processes import python_command

        # In its own session, so that no key at the terminal stops or ends it with the program.
        self._process = subprocess.Popen(
            python_command("-I", "-S", __file__, stop.hex(), *map(str, ports)),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=tuple(ports),
            start_new_session=True,
            bufsize=0,
        )
        if self._process.stdin is not None:
            # A guard that does not read must not block the program.
            os.set_blocking(self._process.stdin.fileno(), False)

    @property
    def ended(self) -> bool:
        """True once it was closed, also by the error of a heartbeat."""
        return self._process.returncode is not None

    def beat(self) -> None:
        """Send a heartbeat of active boards; DeviceError once the guard has silenced them, or has ended."""
        try:
            self._send(ACTIVE)
        except OSError:
            self.close()
            from midair.errors import DeviceError

            raise DeviceError(self._error) from None

    def rest(self) -> None:
        """Report that the boards are silent."""
        with contextlib.suppress(OSError):
            self._send(QUIET)

    def close(self) -> None:
        """End the guard; it silences the boards first if the last message was a heartbeat."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(10 * LIMIT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _send(self, word: bytes) -> None:
        if self._process.stdin is None or self._process.stdin.closed:
            raise BrokenPipeError
        os.write(self._process.stdin.fileno(), word)


def watch(pipe: int, ports: Sequence[int], stop: bytes) -> None:
    """Silence the boards if the pipe ends, or stalls, while they are active."""
    active = False
    while select.select([pipe], [], [], LIMIT if active else None)[0]:
        received = os.read(pipe, 4096)
        if not received:
            break
        active = received[-1:] == ACTIVE
    # The next heartbeat of a program that continues fails.
    os.close(pipe)
    if active:
        # Bytes still to be sent would come first.
        for port in ports:
            _drop(port)
        for port in ports:
            _write(port, stop)


def _drop(port: int) -> None:
    import termios

    with contextlib.suppress(OSError, termios.error):
        termios.tcflush(port, termios.TCOFLUSH)


def _write(port: int, text: bytes) -> None:
    end = time.monotonic() + LIMIT
    with contextlib.suppress(OSError):
        while text and time.monotonic() < end:
            if select.select([], [port], [], 0.05)[1]:
                text = text[os.write(port, text) :]


if __name__ == "__main__":
    # Arguments are the silencing bytes in hex and the ports.
    watch(0, [int(port) for port in sys.argv[2:]], bytes.fromhex(sys.argv[1]))
