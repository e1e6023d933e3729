"""A guard process that silences OpenMPD boards if the playing program fails.

A board repeats its last frame forever, so that a program that is killed, or hangs, would leave it sounding. This file
is run as the guard, by its path and without midair, so that it starts quickly; it imports the standard library only. It
also holds the ports open, reads a pipe, and silences the boards if the pipe ends or stalls during playback.
"""

import contextlib
import os
import select
import subprocess
import sys
import time
from collections.abc import Sequence

LIMIT = 1.0
"""Maximum time without a heartbeat during playback, in s."""
SOUNDS, QUIET = b"+", b"."


class PortGuard:
    """The guard, as seen by the playing program (POSIX only).

    `ports` are file descriptors of the open ports, `off` is the bytes that silence a board.
    """

    def __init__(self, ports: Sequence[int], off: bytes) -> None:
        words = [sys.executable, "-I", "-S", __file__, str(len(off)), *map(str, ports)]
        # In its own session, so that no key at the terminal stops or ends it with the program.
        self._process = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=tuple(ports),
            start_new_session=True,
            bufsize=0,
        )
        self._send(off)
        if self._process.stdin is not None:
            # A guard that does not read must not block the program.
            os.set_blocking(self._process.stdin.fileno(), False)

    def beat(self) -> None:
        """Send a heartbeat during playback; OSError if the guard has silenced the boards, or has ended."""
        self._send(SOUNDS)

    def rest(self) -> None:
        """Report that the boards are silent."""
        with contextlib.suppress(OSError):
            self._send(QUIET)

    def close(self) -> None:
        """End the guard; it silences the boards first if the last message was a heartbeat."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(5 * LIMIT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _send(self, word: bytes) -> None:
        if self._process.stdin is not None:
            os.write(self._process.stdin.fileno(), word)


def watch(pipe: int, ports: Sequence[int], off: bytes) -> None:
    """Silence the ports if the pipe ends, or stalls, during playback."""
    sounds = False
    while True:
        if not select.select([pipe], [], [], LIMIT if sounds else None)[0]:
            break
        said = os.read(pipe, 4096)
        if not said:
            break
        sounds = said[-1:] == SOUNDS
    if sounds:
        # Bytes still to be sent would come first.
        for port in ports:
            _drop(port)
        for port in ports:
            _write(port, off)


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


def main() -> None:
    """Run the guard: arguments are the length of the silencing bytes, which the pipe delivers first, and the ports."""
    length, *ports = map(int, sys.argv[1:])
    off = b""
    while len(off) < length and (more := os.read(0, length - len(off))):
        off += more
    watch(0, ports, off)


if __name__ == "__main__":
    main()
