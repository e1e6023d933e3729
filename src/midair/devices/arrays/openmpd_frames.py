"""Frame format of OpenMPD boards: 512 bytes per frame and board, no header, no checksum, no answer.

From the firmware (RMResearch/OpenMPD_Hardware, FPGA_3.4.2/src, with the file of each fact):

- Bytes 0 to 255 are phases by pin, 256 to 511 amplitudes by pin, seven bits each (CommandReader.vhd).
- The eighth bit of byte 0 starts a frame, and is ignored while a frame is being read. The eighth bits of bytes 26 to 33
  are a rate divider, lowest bit first, which that of byte 34 activates (CommandReader.vhd). The other eighth bits are
  not used here: those of bytes 1 to 25 set a light.
- Frames change at 40 kHz / divider. If the buffer is empty, the last one repeats (FrameBufferController.vhd).
- A pulse begins at step `phase` of 128 and lasts `amplitude` steps, of which 64 are full drive (MuxPhase.vhd). A larger
  phase is therefore later, as in midair: q = exp(+j phi), G = exp(+j k d), and a focus needs phi = -k d.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Self

import numpy as np
from numpy.typing import NDArray

from midair.errors import RateError
from midair.model import Board, Drive

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
