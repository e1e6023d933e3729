"""OpenMPD boards over USB: one board, or two face to face. EXPERIMENTAL: no real board has ever played from here.

A board never answers and holds its last frame for ever, so that everything here serves one end: whatever happens, the
last thing that a board gets is silence, and it has got there before the port is closed. Should the program itself be
killed or hang, its guard (`openmpd_guard`) silences.

The boards' USB chip (FT232H) hands bytes to the firmware as a FIFO (ParallelReceiver.vhd). Linux shows such a chip as
a serial port; a program for these boards (levitate, hardware/_interactlab.py) writes to it as one with pyserial, as
is done here. The makers' own driver uses FTDI's D2XX, with sync FIFO off (BoardWorkerThread.cpp).
"""

import contextlib
import importlib
import importlib.util
import math
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any, Protocol

from midair.devices.arrays.openmpd_frames import (
    PERIOD,
    STEPS,
    FramesAhead,
    off_frame,
    off_frames,
    rate_divider,
)
from midair.devices.arrays.openmpd_guard import LIMIT, BoardGuard
from midair.devices.arrays.silencer import SilencerChoice
from midair.devices.interface import ArrayDevice, PlayReport
from midair.errors import DeviceError, DeviceStateError, InputError, LinkLostError, MissingExtraError
from midair.model import Board, Drive, Progress, array_of_boards

# Not on Windows.
_TERMINAL = (importlib.import_module("termios").error,) if importlib.util.find_spec("termios") else ()

FAILURES: tuple[type[Exception], ...] = (OSError, TypeError, *_TERMINAL)
"""What pyserial raises when a port is lost; TypeError when it was closed meanwhile."""
QUIETEST = math.sin(math.pi / STEPS)
"""Level of a pulse of one step."""
LEAD = 0.025
"""How far ahead of its time a frame is sent, in s: what a silence has to wait for, and how long Python may hesitate."""
LONGEST = 32 * 255 * PERIOD
"""How long the frames that a board can hold last at most, in s."""
FEW = 4 * 255 * PERIOD
"""How long four frames last at most, whatever divider is in force, in s."""


class BoardPort(Protocol):
    """What is used of `serial.Serial`."""

    @property
    def out_waiting(self) -> int:
        """Bytes that this computer has yet to send."""
        ...

    def write(self, data: bytes, /) -> int | None:
        """Send bytes, or raise OSError when they do not leave in time."""
        ...

    def reset_output_buffer(self) -> None:
        """Throw away what this computer has yet to send."""
        ...

    def fileno(self) -> int:
        """Its file descriptor."""
        ...

    def close(self) -> None:
        """Let go of the port."""
        ...


class OpenMpdArray(ArrayDevice):
    """Plays drives on boards frame by frame, and is silent at all other times.

    Parameters
    ----------
    ports : sequence of str
        Of one board, or of the lower and then the upper of two.
    boards : sequence of Board
        What is known of each, in the same order; without it the boards can be silenced, but not played on.
    name : str
        What it was opened by.
    silencer : {"auto", "off"}
        Nothing to choose: the firmware steps at once.
    """

    streams, steps_a_turn = True, STEPS

    def __init__(
        self,
        ports: Sequence[str],
        boards: Sequence[Board] = (),
        *,
        name: str = "openmpd",
        silencer: SilencerChoice = "auto",
    ) -> None:
        if boards and len(boards) != len(ports):
            raise InputError(f"{name}: expected a board file for each of {len(ports)} ports, got {len(boards)}")
        if silencer not in ("auto", "off"):
            raise InputError(f"{name}: expected --silencer auto or off, got {silencer}; this firmware has none")
        self.name, self.exclusive = name, f"openmpd:{','.join(ports)}"
        self.array = array_of_boards(*(boards or [Board.nominal()] * len(ports)))
        self._names, self._boards = tuple(ports), tuple(boards)
        self._ports: list[BoardPort] = []
        self._guard: BoardGuard | None = None
        self._lock = threading.RLock()
        self._silenced = 0
        self._sounding = self._lost = False
        # How long a board may go on with what it has; unknown until a divider was sent.
        self._holds = LONGEST

    @property
    def emitting(self) -> bool:
        """Whether the last that the boards surely got is no silence; they cannot be asked."""
        return self._sounding

    def open(self) -> None:
        """Take hold of the boards, and silence what some other program may have left sounding."""
        if self._ports:
            return
        self._lost, self._holds = False, LONGEST
        try:
            for name in self._names:
                self._ports.append(_serial_port(name))
            self.silence()
            # Nothing but the silence of here can be waiting from now on.
            self._holds = FEW
        except BaseException:
            self.close()
            raise

    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Send every frame a little before its time, and silence right behind the last.

        A board cannot be asked when it plays: the report is what this computer's clock says. A frame that is sent too
        late leaves the one before it standing for as long.
        """
        if not self._ports:
            raise DeviceStateError(f"{self.name}: expected open before play")
        if not self._boards:
            raise DeviceStateError(
                f"{self.name}: expected the board's own file with its phase offsets, got none; "
                "name it after the port, ?board=board_N.pat, or ?board=none if it has none"
            )
        if 0 < drive.level.max() < QUIETEST:
            raise InputError(
                f"{self.name}: expected a level of at least {QUIETEST:.1%} of full drive, the shortest pulse there is, "
                f"got {drive.level.max():.1%}; nothing would sound"
            )
        divider, ordered = rate_divider(drive.rate), self._silenced
        period, total = divider * PERIOD, drive.frames * repeats
        ahead = max(2, int(LEAD / period))
        if self._guard is None and sys.platform != "win32":
            self._guard = BoardGuard([port.fileno() for port in self._ports], off_frames())
        self._wait(delay, ordered)
        # In its own frame: in one that sounds, its bits could be taken for the beginning of another.
        self._send([off_frames() + off_frame(divider)] * len(self._ports), ordered)
        self._wait(FEW, ordered)
        self._holds = (ahead + 4) * period
        with FramesAhead(drive, self._boards, total) as frames:
            begin, sent, held = time.monotonic(), 0, 0
            while sent < total:
                now = time.monotonic()
                if sent and now > begin + sent * period:
                    held, begin = held + 1, now - sent * period
                count = min(int((now - begin) / period) + ahead, total) - sent
                if count > 0:
                    self._send(frames.take(sent, count), ordered, sounds=True)
                    sent += count
                    if progress:
                        progress(max(0, sent - ahead), total)
                self._wait(min(LEAD / 4, period), ordered)
        self._send([off_frames()] * len(self._ports), ordered)
        self._wait(begin + total * period - time.monotonic(), ordered)
        if progress:
            progress(total, total)
        return PlayReport(frames=total, duration=total * period, late=held, repeated=held)

    def silence(self) -> None:
        """Silence all boards, from any thread, and wait until they are; what plays then ends with an error.

        Raises
        ------
        LinkLostError
            If a board could not be reached; the others are silent.
        """
        with self._lock:
            self._silenced += 1
            failures = [wrong for port in self._ports if (wrong := self._hush(port)) is not None]
            if failures:
                self._lost = True
                raise failures[0]
            if self._ports:
                time.sleep(self._holds)
            self._sounding = False
            if self._guard is not None:
                self._guard.rest()

    def close(self) -> None:
        """Silence the boards, unless that has failed before, and let go of them."""
        with self._lock:
            try:
                if self._ports and not self._lost:
                    self.silence()
            finally:
                self._dismiss()
                ports, self._ports = self._ports, []
                for port in ports:
                    with contextlib.suppress(*FAILURES):
                        port.close()

    def describe(self) -> dict[str, str]:
        """What is known of the boards, which cannot be asked."""
        known = ", ".join(board.serial or "no serial number" for board in self._boards)
        return {
            "boards": f"{len(self._names)} at {', '.join(self._names)}; whether they are there, they cannot say",
            "board files": known or "none: it can be silenced, but not played on",
            "failsafe": "none of its own: a board holds its last frame for ever; a process beside midair silences it "
            "when midair dies, none when the computer does or the cable is pulled",
            "rate": "any that is 40 kHz / N, N from 4 to 255: 1000 Hz is N = 40",
        }

    def _send(self, texts: Sequence[bytes], ordered: int, *, sounds: bool = False) -> None:
        """Frames for each board, unless it has been silenced since."""
        with self.sounding(), self._lock:
            self._check(ordered)
            self._sounding = self._sounding or sounds
            if sounds:
                self._beat()
            for port, text in zip(self._ports, texts, strict=True):
                try:
                    port.write(text)
                except FAILURES as wrong:
                    raise self._gone(wrong) from wrong

    def _beat(self) -> None:
        """Tell the guard that all is well; what it had to silence must not sound again by itself."""
        try:
            if self._guard is not None:
                self._guard.beat()
        except OSError:
            self._dismiss()
            raise DeviceError(
                f"{self.name}: this program stood still for more than {LIMIT:g} s while it played, and its guard "
                "silenced the boards, or the guard was ended; close other programs, then play again"
            ) from None

    def _dismiss(self) -> None:
        guard, self._guard = self._guard, None
        if guard is not None:
            guard.close()

    def _wait(self, seconds: float, ordered: int) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._check(ordered)
            if self._sounding:
                self._beat()
            time.sleep(min(left, LEAD))
        self._check(ordered)

    def _check(self, ordered: int) -> None:
        # A stop says so itself.
        with self.sounding():
            if self._silenced != ordered:
                raise DeviceError(f"{self.name}: silenced from elsewhere while it played")

    def _hush(self, port: BoardPort) -> LinkLostError | None:
        """Silence behind nothing but what the board already has; what went wrong, if anything."""
        try:
            port.reset_output_buffer()
            port.write(off_frames())
            end = time.monotonic() + 1
            while port.out_waiting:
                if time.monotonic() > end:
                    raise OSError("it takes no more bytes")
                time.sleep(0.001)
        except FAILURES as wrong:
            return self._gone(wrong)
        return None

    def _gone(self, wrong: Exception) -> LinkLostError:
        return LinkLostError(
            f"{self.name}: lost a board: {wrong}; it holds the last frame that it got: switch off its power now"
        )


def _serial_port(name: str) -> Any:
    """A port as pyserial opens it. The rate in bits per second means nothing to a FIFO."""
    try:
        serial = importlib.import_module("serial")
    except ModuleNotFoundError:
        raise MissingExtraError(
            'openmpd: expected the package pyserial, it is not installed; pip install "midair[serial]"'
        ) from None
    try:
        return serial.Serial(name, 250_000, write_timeout=1.0, timeout=0, exclusive=True)
    except (OSError, ValueError) as wrong:
        raise DeviceError(f"openmpd: expected a port {name}, got: {wrong}; see midair doctor") from wrong
