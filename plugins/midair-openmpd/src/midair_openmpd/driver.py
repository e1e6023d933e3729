"""OpenMPD boards over USB: one board, or two opposing boards. EXPERIMENTAL: not tested with a real board.

A board never answers and repeats its last frame forever. Therefore the last frame sent to a board is always silent, and
it is transmitted before the port is closed. If the program is killed or hangs, its guard (`port_guard`) silences the
boards.

The USB chip of the boards (FT232H) passes bytes to the firmware as a FIFO (ParallelReceiver.vhd). Linux shows the chip
as a serial port; like another program for these boards (levitate, hardware/_interactlab.py), this driver writes to it
with pyserial. The manufacturer's driver uses FTDI's D2XX, with sync FIFO off (BoardWorkerThread.cpp).

A frame is 512 bytes for each board, without header, checksum or answer. From the firmware
(RMResearch/OpenMPD_Hardware, FPGA_3.4.2/src, with the file of each fact):

- Bytes 0 to 255 are phases by pin, 256 to 511 amplitudes by pin, seven bits each (CommandReader.vhd).
- The eighth bit of byte 0 starts a frame, and is ignored while a frame is being read. The eighth bits of bytes 26 to 33
  are a rate divider, lowest bit first, which that of byte 34 activates (CommandReader.vhd). The other eighth bits are
  not used here: those of bytes 1 to 25 set a light.
- Frames change at 40 kHz / divider. If the buffer is empty, the last one repeats (FrameBufferController.vhd).
- A pulse begins at step `phase` of 128 and lasts `amplitude` steps, of which 64 are full drive (MuxPhase.vhd). A larger
  phase is therefore later, as in midair: q = exp(+j phi), G = exp(+j k d), and a focus needs phi = -k d.
"""

import contextlib
import importlib
import importlib.util
import math
import sys
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Self

import numpy as np
import serial
from numpy.typing import NDArray

from midair.devices import ArrayDevice, PlayReport, SilencerChoice
from midair.errors import DeviceError, DeviceStateError, InputError, LinkLostError, RateError
from midair.model import Drive, Placement, Progress

from .boards import Board, array_of_boards, load_board
from .port_guard import PortGuard

Bytes = NDArray[np.uint8]

FRAME = 512
"""Bytes of a frame."""
STEPS = 128
"""Steps per turn."""
FULL = 64
"""Length of a pulse at full drive, in steps."""
PERIOD = 25e-6
"""Period of the ultrasound, in s: 50 MHz x 512 / 625 / 1024 (Masterclock.vhd, Counter.vhd) is 40 kHz."""
START = 0x80
"""The eighth bit."""
AHEAD = 512
"""Number of frames encoded at once, ahead of time."""


def drive_frames(drive: Drive, first: int, count: int, boards: Sequence[Board]) -> list[bytes]:
    """Encode `count` frames of a drive from `first` on for each board; after the end the drive repeats.

    Phases are rounded once, after the offset was subtracted and half of the pulse's shortening was added, so that the
    centre of a pulse does not depend on its length.
    """
    which = np.arange(first, first + count) % drive.frames
    # Select frames first, so that only these are read from lazy frames.
    phase, level = np.asarray(drive.phase[which]), np.asarray(drive.level[which])
    level = level if level.ndim == 2 else np.repeat(level[:, None], drive.array.count, 1)
    texts: list[bytes] = []
    for number, board in enumerate(boards):
        own = slice(number * len(board.pin), (number + 1) * len(board.pin))
        length = pulse_lengths(level[:, own] * board.strength)
        turns = (phase[:, own] - board.offset) / (2 * np.pi)
        frames = np.empty((count, 2, len(board.pin)), np.uint8)
        frames[:, 0, board.pin] = np.mod(np.rint(turns * STEPS + (FULL - length) / 2), STEPS)
        frames[:, 1, board.pin] = length
        frames[:, 0, 0] |= START
        texts.append(frames.tobytes())
    return texts


class FramesAhead:
    """Encodes the frames of a drive one block ahead in a thread, since reading a file may be slow; `total` includes
    repeats.
    """

    def __init__(self, drive: Drive, boards: Sequence[Board], total: int) -> None:
        self._drive, self._boards, self._total = drive, tuple(boards), total
        self._begin, self._now = 0, self._make(0)
        self._pool = ThreadPoolExecutor(max_workers=1)
        self._next = self._pool.submit(self._make, AHEAD) if total > AHEAD else None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def _make(self, first: int) -> list[bytes]:
        return drive_frames(self._drive, first, min(AHEAD, self._total - first), self._boards)

    def take(self, first: int, count: int) -> list[bytes]:
        """Return `count` frames from `first` on; `first` must not decrease."""
        parts: list[list[bytes]] = [[] for _ in self._now]
        while count > 0:
            while first >= self._begin + AHEAD and self._next is not None:
                self._begin, self._now = self._begin + AHEAD, self._next.result()
                after = self._begin + AHEAD
                self._next = self._pool.submit(self._make, after) if after < self._total else None
            at = first - self._begin
            some = min(count, AHEAD - at)
            for part, text in zip(parts, self._now, strict=True):
                part.append(text[FRAME * at : FRAME * (at + some)])
            first, count = first + some, count - some
        return [b"".join(part) for part in parts]


def pulse_lengths(level: NDArray[np.float64]) -> Bytes:
    """Longest pulses that do not exceed levels of 0 to 1, same shape, in steps: level = sin(pi length / 128).

    A step is up to 2.5 % of full drive. Dithering the rest over the transducers would correct the mean but increase E:
    most of a solved field is interference, which requires equal amplitudes.
    """
    exact = np.arcsin(np.clip(level, 0, 1)) * (STEPS / np.pi)
    # A tolerance of 0.01 step, so that a level rounded to three digits keeps its length.
    return np.floor(exact + 0.01).astype(np.uint8)


def off_frame(divider: int | None = None) -> bytes:
    """A silent frame, which activates a rate divider if one is given."""
    frame = np.zeros(FRAME, np.uint8)
    frame[0] = START
    if divider is not None:
        frame[26:34] = np.unpackbits(np.array([divider], np.uint8), bitorder="little") * START
        frame[34] = START
    return frame.tobytes()


def off_frames() -> bytes:
    """Frames that silence a board in any state.

    An incomplete frame absorbs the beginning of the first, the rest of which has no eighth bit and is skipped; the
    third pushes the second through a buffer that is read 512 bytes at a time.
    """
    return 3 * off_frame()


def rate_divider(rate: float) -> int:
    """Number N of ultrasound periods in a frame: rate = 40 kHz / N, N from 4 to 255; raises RateError if there is none.

    The firmware accepts 1 to 255; below 4 a board would need more than the 5.12 MB/s of the manufacturer's driver.
    """
    exact = 1 / (PERIOD * rate)
    whole = round(exact)
    if not 4 <= whole <= 255 or abs(exact - whole) > 1e-6 * exact:
        nearest = sorted({1 / (PERIOD * min(255, max(4, number))) for number in (int(exact), int(exact) + 1)})
        raise RateError(
            f"drive: expected a rate of 40 kHz / N with N whole, 4 to 255, on an OpenMPD board, got {rate:g} Hz; "
            f"solve it at {' or '.join(f'{each:.6g}' for each in nearest)} Hz"
        )
    return whole


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
    order, without which the boards can be silenced, but not play. `silencer` must be off: the firmware has none.
    """

    streams, steps_a_turn = True, STEPS

    def __init__(
        self,
        ports: Sequence[str],
        boards: Sequence[Board] = (),
        *,
        name: str = "openmpd",
        silencer: SilencerChoice = "off",
    ) -> None:
        if boards and len(boards) != len(ports):
            raise InputError(f"{name}: expected a board file for each of {len(ports)} ports, got {len(boards)}")
        if silencer != "off":
            raise InputError(f"{name}: expected --silencer off, got {silencer}; this firmware has none")
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
            self._guard = PortGuard(self.name, [port.fileno() for port in self._ports], off_frames())
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
        return serial.Serial(name, 250_000, write_timeout=1.0, timeout=0, exclusive=True)
    except (OSError, ValueError) as wrong:
        raise DeviceError(f"openmpd: expected a port {name}, got: {wrong}; see midair doctor") from wrong


def open_openmpd(name: str, placement: Placement | None, silencer: SilencerChoice) -> OpenMpdArray:
    """Boards of a name such as ``openmpd:LOWER,UPPER?board=FILE,FILE``; the file ``none`` is a board without one."""
    where, question, options = name.removeprefix("openmpd").removeprefix(":").partition("?")
    if not where:
        raise InputError(f"{name}: expected openmpd:PORT[,PORT]?board=FILE[,FILE]")
    if placement is not None:
        raise InputError(f"{name}: expected no placement, got one; boards are single, or opposing at 238.8 mm")
    key, _, files = options.partition("=")
    if question and key != "board":
        raise InputError(f"{name}: expected the option board, got {key}")
    boards = [Board.nominal() if file == "none" else load_board(file) for file in files.split(",")] if question else []
    return OpenMpdArray(where.split(","), boards, name=f"openmpd:{where}", silencer=silencer)
