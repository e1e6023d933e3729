"""OpenMPD boards over USB: one board, or two opposing boards. EXPERIMENTAL: not tested with a real board.

A board never answers and repeats its last frame forever. Therefore the last frame sent to a board is always silent, and
it is transmitted before the port is closed. If the program is killed or hangs, its guard (`port_guard`) silences the
boards.

The USB chip of the boards (FT232H) passes bytes to the firmware as a FIFO (ParallelReceiver.vhd). Linux shows the chip
as a serial port; like another program for these boards (levitate, hardware/_interactlab.py), this driver writes to it
with pyserial. The manufacturer's driver uses FTDI's D2XX, with sync FIFO off (BoardWorkerThread.cpp).
"""

import contextlib
import importlib
import importlib.util
import math
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any

from midair.devices.arrays.openmpd_frames import PERIOD, STEPS, FramesAhead, off_frame, off_frames, rate_divider
from midair.devices.arrays.silencer import SilencerChoice
from midair.devices.interface import ArrayDevice, PlayReport
from midair.devices.safety import PortGuard
from midair.errors import DeviceError, DeviceStateError, InputError, LinkLostError, MissingExtraError
from midair.model import Board, Drive, Progress, array_of_boards

# There is no termios on Windows.
_TERMINAL = (importlib.import_module("termios").error,) if importlib.util.find_spec("termios") else ()

FAILURES: tuple[type[Exception], ...] = (OSError, TypeError, *_TERMINAL)
"""Exceptions of pyserial for a lost port; TypeError if it was closed meanwhile."""
QUIETEST = math.sin(math.pi / STEPS)
"""Level of a pulse of one step."""
LEAD = 0.025
"""Time by which a frame is sent ahead, in s: the delay of a silence, and the tolerance for delays of Python."""
BUFFERED_MAX = 32 * 255 * PERIOD
"""Maximum duration of the frames that a board can buffer, in s."""
FOUR_FRAMES = 4 * 255 * PERIOD
"""Maximum duration of four frames with any divider, in s."""


class OpenMpdArray(ArrayDevice):
    """Plays drives on boards frame by frame, and is silent at all other times.

    `ports` is that of one board, or of the lower and then the upper of two; `boards` are the data of each in the same
    order, without which the boards can be silenced, but not play. `silencer`, "auto" or "off", has no effect: the
    firmware has none.
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
        self._ports: list[Any] = []
        self._guard: PortGuard | None = None
        self._lock = threading.RLock()
        self._silenced = 0
        self._sounding = self._lost = False
        # Maximum duration of buffered frames, in s; unknown until a divider was sent.
        self._buffered = BUFFERED_MAX

    @property
    def emitting(self) -> bool:
        """True unless the last frames sent were silent; the boards cannot be queried."""
        return self._sounding

    def open(self) -> None:
        """Open the ports, and silence sound that another program may have left."""
        if self._ports:
            return
        self._lost, self._buffered = False, BUFFERED_MAX
        try:
            for name in self._names:
                self._ports.append(_serial_port(name))
            self.silence()
            # From now on only the silent frames sent here can be buffered.
            self._buffered = FOUR_FRAMES
        except BaseException:
            self.close()
            raise

    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Send every frame slightly ahead of its time, and silence after the last.

        A board cannot be queried: the report relies on this computer's clock. A late frame prolongs the one before.
        """
        if not self._ports:
            raise DeviceStateError(f"{self.name}: expected open before play")
        if not self._boards:
            raise DeviceStateError(
                f"{self.name}: expected the board's own file with its phase offsets, got none; "
                "add it to the port, ?board=board_N.pat, or ?board=none if it has none"
            )
        if 0 < drive.level.max() < QUIETEST:
            raise InputError(
                f"{self.name}: expected a level of at least {QUIETEST:.1%} of full drive, the shortest possible pulse, "
                f"got {drive.level.max():.1%}; nothing would sound"
            )
        divider, ordered = rate_divider(drive.rate), self._silenced
        period, total = divider * PERIOD, drive.frames * repeats
        ahead = max(2, int(LEAD / period))
        if (self._guard is None or self._guard.ended) and sys.platform != "win32":
            words = ("playback", "silenced the boards", "play again")
            self._guard = PortGuard(self.name, [port.fileno() for port in self._ports], off_frames(), words=words)
        self._wait(delay, ordered)
        # In a silent frame: with sound, the divider's bits could be mistaken for the start of a frame.
        self._send([off_frames() + off_frame(divider)] * len(self._ports), ordered)
        self._wait(FOUR_FRAMES, ordered)
        self._buffered = (ahead + 4) * period
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
        """Silence all boards, from any thread, and wait until they are silent; active playback ends with an error.

        Raises LinkLostError if a board could not be reached; the others are silent.
        """
        with self._lock:
            self._silenced += 1
            failures = [wrong for port in self._ports if (wrong := self._silence_port(port)) is not None]
            if failures:
                self._lost = True
                raise failures[0]
            if self._ports:
                time.sleep(self._buffered)
            self._sounding = False
            if self._guard is not None:
                self._guard.rest()

    def close(self) -> None:
        """Silence the boards, unless that failed before, and close the ports."""
        with self._lock:
            try:
                if self._ports and not self._lost:
                    self.silence()
            finally:
                if self._guard is not None:
                    self._guard.close()
                ports, self._ports = self._ports, []
                for port in ports:
                    with contextlib.suppress(*FAILURES):
                        port.close()

    def describe(self) -> dict[str, str]:
        """Properties of the boards, which cannot be queried."""
        known = ", ".join(board.serial or "no serial number" for board in self._boards)
        return {
            "boards": f"{len(self._names)} at {', '.join(self._names)}; a connection cannot be confirmed",
            "board files": known or "none: the boards can be silenced, but cannot play",
            "failsafe": "none on the board, which repeats its last frame forever; a second process silences it "
            "if midair dies, but not if the computer fails or the cable is unplugged",
            "rate": "any that is 40 kHz / N, N from 4 to 255: 1000 Hz is N = 40",
        }

    def _send(self, texts: Sequence[bytes], ordered: int, *, sounds: bool = False) -> None:
        """Send frames to each board, unless it was silenced since."""
        with self.sounding(), self._lock:
            self._check(ordered)
            self._sounding = self._sounding or sounds
            if sounds and self._guard is not None:
                self._guard.beat()
            for port, text in zip(self._ports, texts, strict=True):
                try:
                    port.write(text)
                except FAILURES as wrong:
                    raise self._board_lost(wrong) from wrong

    def _wait(self, seconds: float, ordered: int) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._check(ordered)
            if self._sounding and self._guard is not None:
                self._guard.beat()
            time.sleep(min(left, LEAD))
        self._check(ordered)

    def _check(self, ordered: int) -> None:
        # After `midair stop`, `sounding` raises StoppedError.
        with self.sounding():
            if self._silenced != ordered:
                raise DeviceError(f"{self.name}: silenced by another thread during playback")

    def _silence_port(self, port: Any) -> LinkLostError | None:
        """Discard unsent bytes and send silence; return the error, if any."""
        try:
            port.reset_output_buffer()
            port.write(off_frames())
            end = time.monotonic() + 1
            while port.out_waiting:
                if time.monotonic() > end:
                    raise OSError("it accepts no more bytes")
                time.sleep(0.001)
        except FAILURES as wrong:
            return self._board_lost(wrong)
        return None

    def _board_lost(self, wrong: Exception) -> LinkLostError:
        return LinkLostError(f"{self.name}: lost a board: {wrong}; it repeats its last frame: switch off its power now")


def _serial_port(name: str) -> Any:
    """A port opened with pyserial; a FIFO ignores the baud rate."""
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
