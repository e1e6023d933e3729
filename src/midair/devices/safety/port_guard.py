"""A guard process that stops devices at serial ports if the program that drives them fails.

An OpenMPD board repeats its last frame forever, and a motion stage completes its move: after a program that was killed,
or hangs, they would go on. This file is run as the guard, by its path and without midair, so that it starts quickly; it
imports the standard library only. It also holds the ports open, reads a pipe, and stops the devices if the pipe ends or
stalls while they are active.
"""

import contextlib
import os
import select
import subprocess
import sys
import time
from collections.abc import Sequence

LIMIT = 1.0
"""Maximum time without a heartbeat while the devices are active, in s."""
SETTLE = 4.0
"""Maximum time for a device to confirm that it stands still, in s."""
ACTIVE, QUIET = b"+", b"."


class PortGuard:
    """The guard, as seen by the program that drives the devices (POSIX only).

    `ports` are file descriptors of the open ports, `stop` is the bytes that stop a device. With `settled` = (query,
    answer, last) the query is then repeated until a response contains the answer, and the last bytes are sent. The
    error of a heartbeat contains `name`, and `words` for the time, the act of the guard and the advice.
    """

    def __init__(
        self,
        name: str,
        ports: Sequence[int],
        stop: bytes,
        settled: Sequence[bytes] = (b"", b"", b""),
        *,
        words: tuple[str, str, str],
    ) -> None:
        self._error = (
            f"{name}: this program was delayed by more than {LIMIT:g} s during {words[0]}, and its guard {words[1]}, "
            f"or the guard was terminated; close other programs, then {words[2]}"
        )
        # Imported here, since the guard itself runs without midair.
        from midair.processes import python_command

        stops = (part.hex() for part in (stop, *settled))
        # In its own session, so that no key at the terminal stops or ends it with the program.
        self._process = subprocess.Popen(
            python_command("-I", "-S", __file__, *stops, *map(str, ports)),
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
        """Send a heartbeat of an active device; DeviceError once the guard has stopped the devices, or has ended."""
        try:
            self._send(ACTIVE)
        except OSError:
            self.close()
            from midair.errors import DeviceError

            raise DeviceError(self._error) from None

    def rest(self) -> None:
        """Report that the devices are silent or stand still."""
        with contextlib.suppress(OSError):
            self._send(QUIET)

    def close(self) -> None:
        """End the guard; it stops the devices first if the last message was a heartbeat."""
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


def watch(pipe: int, ports: Sequence[int], stop: bytes, settled: Sequence[bytes]) -> None:
    """Stop the devices if the pipe ends, or stalls, while they are active."""
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
            _settle(port, *settled)


def _drop(port: int) -> None:
    import termios

    with contextlib.suppress(OSError, termios.error):
        termios.tcflush(port, termios.TCOFLUSH)


def _settle(port: int, query: bytes, answer: bytes, last: bytes) -> None:
    """Repeat the query until a response contains the answer, then send the last bytes, in any case."""
    received, end = b"", time.monotonic() + SETTLE
    while answer not in received and time.monotonic() < end:
        _write(port, query)
        time.sleep(0.1)
        with contextlib.suppress(OSError):
            if select.select([port], [], [], 0)[0]:
                received = received[-256:] + os.read(port, 4096)
    _write(port, last)


def _write(port: int, text: bytes) -> None:
    end = time.monotonic() + LIMIT
    with contextlib.suppress(OSError):
        while text and time.monotonic() < end:
            if select.select([], [port], [], 0.05)[1]:
                text = text[os.write(port, text) :]


def main() -> None:
    """Run the guard: arguments are the stopping bytes and the three parts of `settled`, in hex, and the ports."""
    stop, *settled = map(bytes.fromhex, sys.argv[1:5])
    watch(0, [int(port) for port in sys.argv[5:]], stop, settled)


if __name__ == "__main__":
    main()
