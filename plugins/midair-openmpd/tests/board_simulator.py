"""A simulated OpenMPD board on a pty: parses bytes as the firmware does, keeps its timing, holds its last frame.

Written from the firmware only (RMResearch/OpenMPD_Hardware, FPGA_3.4.2/src), without the driver's code: input are
bytes, output are the pulses of each pin. POSIX only.
"""

import os
import select
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tests.simulators.pty_device import BehindPty

from midair_openmpd import Board


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PinFrame:
    """Pulses of all pins during one frame."""

    start: NDArray[np.uint8]
    """Step of 128 at which each pulse begins, shape (pin,)."""
    length: NDArray[np.uint8]
    """Length of each pulse in steps, shape (pin,)."""
    divider: int
    """Minimum duration of the frame in ultrasound periods."""

    @property
    def sounds(self) -> bool:
        """Whether any pin pulses."""
        return bool(self.length.any())

    def sound(self) -> NDArray[np.complex128]:
        """First harmonic at each pin, relative to a full pulse that begins at step 0; later pulses have a positive
        phase.
        """
        count, start = np.arange(128), self.start.astype(int)[:, None]
        end = start + self.length[:, None]
        # MuxPhase.vhd: from `start` on, wrapping around at the end of the period.
        wave = ((count >= start) & (count < end)) | ((end >= 128) & (count < end % 128))
        full = np.exp(2j * np.pi * np.arange(64) / 128).sum()
        return np.asarray(wave @ np.exp(2j * np.pi * count / 128) / full, np.complex128)


class OpenMpdSimulator(BehindPty):
    """A simulated OpenMPD board; a driver opens `port`, and `close` ends it.

    `frames` are all since the start, of which the first is silence, and `begins` their times by the board's clock,
    in s. With `stalled` set to True it reads no bytes.
    """

    def __init__(self) -> None:
        super().__init__()
        silence = PinFrame(start=np.zeros(256, np.uint8), length=np.zeros(256, np.uint8), divider=4)
        self.frames = [silence]
        self.stalled = False
        self.begins = [time.monotonic()]
        self._fifo = bytearray()
        self._reader = CommandReader(self._stand)
        self._due: float | None = None
        self._begin = self.begins[0]
        self._full_since = time.monotonic()
        self.switch_on()

    @property
    def held(self) -> PinFrame:
        return self.frames[-1]

    @property
    def sounds(self) -> bool:
        """Whether the current frame is audible."""
        return self.held.sounds

    @property
    def heard(self) -> list[PinFrame]:
        return [frame for frame in self.frames if frame.sounds]

    def settle(self, limit: float = 30.0) -> None:
        """Wait until the board has played everything; TimeoutError after `limit` seconds."""
        end = time.monotonic() + limit
        while time.monotonic() < end:
            idle = len(self._fifo) < 512 and self._due is None and not select.select([self._master], [], [], 0.05)[0]
            if idle and len(self._fifo) < 512 and self._due is None:
                return
        raise TimeoutError("the simulated board still has frames to play")

    def _run(self) -> None:
        while not self._over.is_set():
            self._play(time.monotonic())
            # FrameBufferController.vhd: the buffer holds 28 frames.
            if self.stalled or len(self._fifo) >= 28 * 512:
                time.sleep(0.0005)
            elif select.select([self._master], [], [], 0.0005)[0]:
                self._fifo += os.read(self._master, 1024)

    def _stand(self, frame: PinFrame) -> None:
        self.begins.append(self._begin)
        self.frames.append(frame)

    def _play(self, now: float) -> None:
        """Play all frames that are due (FrameBufferController.vhd, states Idle, ReadFIFO and WaitFrame)."""
        while self._due is None or now >= self._due:
            if len(self._fifo) < 512:
                self._due = None
                break
            begin = self._begin = now if self._due is None else self._due
            self._reader.read(self._fifo[:512])
            del self._fifo[:512]
            self._due = begin + (self._reader.divider or 256) * 25e-6
        if len(self._fifo) >= 512:
            self._full_since = now
        elif now - self._full_since >= 1:
            # An incomplete frame is discarded after a second.
            self._fifo.clear()
            self._full_since = now


class CommandReader:
    """Splits bytes into frames (CommandReader.vhd) and calls `swap` with each."""

    def __init__(self, swap: Callable[[PinFrame], None]) -> None:
        self.divider = 4
        self._swap = swap
        self._bytes: list[int] = []
        self._next_divider = 0

    def read(self, text: bytes | bytearray) -> None:
        """Parse bytes, in pieces of any size."""
        for byte in text:
            place, top = len(self._bytes), byte >> 7
            if place == 0 and not top:
                continue
            self._bytes.append(byte & 0x7F)
            if 26 <= place < 34:
                self._next_divider = self._next_divider & ~(1 << place - 26) | top << place - 26
            elif place == 34 and top:
                self.divider = self._next_divider
            if len(self._bytes) == 512:
                pins = np.array(self._bytes, np.uint8)
                self._bytes = []
                self._swap(PinFrame(start=pins[:256], length=pins[256:], divider=self.divider))


def measured_board(seed: int = 0) -> Board:
    """A board whose phase offsets form two groups in opposite phase, as in the makers' files."""
    rng, plain = np.random.default_rng(seed), Board.nominal()
    offset = np.radians(rng.integers(-40, 40, 256) + 180 * rng.integers(0, 2, 256))
    return Board(position=plain.position, pin=plain.pin, offset=offset, strength=plain.strength, serial=f"FT{seed:06}")
