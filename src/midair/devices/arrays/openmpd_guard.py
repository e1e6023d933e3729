"""What silences OpenMPD's boards when the program that plays on them cannot any more: a process of its own.

A board holds its last frame for ever, so that a program that is killed, or hangs, would leave it sounding. This file is
run as the guard, by its path and without midair, so that it is there in no time: it imports the standard library alone.
It has the boards' ports open as well, reads a pipe, and silences when the pipe ends or falls silent while they sound.
"""

import contextlib
import os
import select
import subprocess
import sys
import time
from collections.abc import Sequence

LIMIT = 1.0
"""How long the boards may sound without a word from the program, in s."""
SOUNDS, QUIET = b"+", b"."


class BoardGuard:
    """The guard's other end, in the program that plays. POSIX only.

    Parameters
    ----------
    ports : sequence of int
        File descriptors of the open ports.
    off : bytes
        What silences a board.
    """

    def __init__(self, ports: Sequence[int], off: bytes) -> None:
        words = [sys.executable, "-I", "-S", __file__, str(len(off)), *map(str, ports)]
        # In a session of its own, so that no key at the terminal stops or ends it with the program.
        self._process = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=tuple(ports),
            start_new_session=True,
            bufsize=0,
        )
        self._say(off)
        if self._process.stdin is not None:
            # A guard that does not read must not hold up the program either.
            os.set_blocking(self._process.stdin.fileno(), False)

    def beat(self) -> None:
        """Say that the boards sound and the program is well; OSError if the guard had to silence them, or is gone."""
        self._say(SOUNDS)

    def rest(self) -> None:
        """Say that the boards are silent."""
        with contextlib.suppress(OSError):
            self._say(QUIET)

    def close(self) -> None:
        """Let the guard go; it silences before if the last that it heard was that the boards sound."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(5 * LIMIT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _say(self, word: bytes) -> None:
        if self._process.stdin is not None:
            os.write(self._process.stdin.fileno(), word)


def watch(pipe: int, ports: Sequence[int], off: bytes) -> None:
    """Silence the ports when the pipe ends, or has nothing for too long, while the boards sound."""
    sounds = False
    while True:
        if not select.select([pipe], [], [], LIMIT if sounds else None)[0]:
            break
        said = os.read(pipe, 4096)
        if not said:
            break
        sounds = said[-1:] == SOUNDS
    if sounds:
        # What this computer still has to send would come first.
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
    """Be the guard: arguments are the length of what silences, which the pipe brings first, and the ports."""
    length, *ports = map(int, sys.argv[1:])
    off = b""
    while len(off) < length and (more := os.read(0, length - len(off))):
        off += more
    watch(0, ports, off)


if __name__ == "__main__":
    main()
