"""An OpenMPD board behind a pty: reads the bytes as the board's firmware does, keeps its time, holds its last frame.

Written from the firmware alone (RMResearch/OpenMPD_Hardware, FPGA_3.4.2/src), with no line of the driver: what goes in
are bytes, what comes out are the pulses of each pin. POSIX only.
"""

import os
import select
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.model import Board
from midair.testing.behind_pty import BehindPty


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PinFrame:
    """What the pins do for as long as a frame stands.

    Attributes
    ----------
    start : ndarray of uint8, shape (pin,)
        Step of 128 at which each pulse begins.
    length : ndarray of uint8, shape (pin,)
        Its length in steps.
    divider : int
        Ultrasound periods for which the frame stands at least.
    """

    start: NDArray[np.uint8]
    length: NDArray[np.uint8]
    divider: int

    @property
    def sounds(self) -> bool:
        """Whether any pin pulses."""
        return bool(self.length.any())

    def sound(self) -> NDArray[np.complex128]:
        """First harmonic of the pulses at each pin, where a full pulse that begins at step 0 is 1; later is +phase."""
        count, start = np.arange(128), self.start.astype(int)[:, None]
        end = start + self.length[:, None]
        # MuxPhase.vhd: from `start` on, and around the end of the turn.
        wave = ((count >= start) & (count < end)) | ((end >= 128) & (count < end % 128))
        full = np.exp(2j * np.pi * np.arange(64) / 128).sum()
        return np.asarray(wave @ np.exp(2j * np.pi * count / 128) / full, np.complex128)


class OpenMpdStandIn(BehindPty):
    """One board. `port` is what a driver opens; leave it by `close`.

    Attributes
    ----------
    port : str
        Name of the pty.
    frames : list of PinFrame
        That have stood since it was switched on, its own silence first.
    begins : list of float
        When each of them began by the board's own clock, in s.
    stalled : bool
        Set it to have the board take no more bytes.
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
        """What stands now."""
        return self.frames[-1]

    @property
    def sounds(self) -> bool:
        """Whether what stands now can be heard."""
        return self.held.sounds

    @property
    def heard(self) -> list[PinFrame]:
        """The frames that sounded."""
        return [frame for frame in self.frames if frame.sounds]

    def settle(self, limit: float = 30.0) -> None:
        """Wait until the board has nothing left to do."""
        end = time.monotonic() + limit
        while time.monotonic() < end:
            idle = len(self._fifo) < 512 and self._due is None and not select.select([self._master], [], [], 0.05)[0]
            if idle and len(self._fifo) < 512 and self._due is None:
                return
        raise TimeoutError("the stand-in still has frames to play")

    def _run(self) -> None:
        while not self._over.is_set():
            self._play(time.monotonic())
            # FrameBufferController.vhd: no more is read from 28 frames on.
            if self.stalled or len(self._fifo) >= 28 * 512:
                time.sleep(0.0005)
            elif select.select([self._master], [], [], 0.0005)[0]:
                self._fifo += os.read(self._master, 1024)

    def _stand(self, frame: PinFrame) -> None:
        self.begins.append(self._begin)
        self.frames.append(frame)

    def _play(self, now: float) -> None:
        """All frames whose time has come (FrameBufferController.vhd, states Idle, ReadFIFO and WaitFrame)."""
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
            # What is left of a frame for a second is thrown away.
            self._fifo.clear()
            self._full_since = now


class CommandReader:
    """Finds frames among bytes (CommandReader.vhd).

    Parameters
    ----------
    swap : callable
        Called with each whole frame.
    """

    def __init__(self, swap: Callable[[PinFrame], None]) -> None:
        self.divider = 4
        self._swap = swap
        self._bytes: list[int] = []
        self._next_divider = 0

    def read(self, text: bytes | bytearray) -> None:
        """Bytes, cut anywhere."""
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
    """A board with offsets in two groups half a turn apart, as the makers' own files have them."""
    rng, plain = np.random.default_rng(seed), Board.nominal()
    offset = np.radians(rng.integers(-40, 40, 256) + 180 * rng.integers(0, 2, 256))
    return Board(position=plain.position, pin=plain.pin, offset=offset, strength=plain.strength, serial=f"FT{seed:06}")
