"""A drive as OpenMPD's boards take it: 512 bytes a frame and board, no header, no checksum, no answer.

From the firmware (RMResearch/OpenMPD_Hardware, FPGA_3.4.2/src, with the file of each fact):

- Bytes 0 to 255 are phases by pin, 256 to 511 amplitudes by pin, seven bits each (CommandReader.vhd).
- The eighth bit of byte 0 begins a frame, and is looked for only where none is being read. Those of bytes 26 to 33 are
  a rate divider, lowest bit first, which that of byte 34 puts in force (CommandReader.vhd). Elsewhere it means nothing
  here: bytes 1 to 25 set a light.
- Frames change at 40 kHz / divider. Where none waits, the last one is held for ever (FrameBufferController.vhd).
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
"""Steps of a turn."""
FULL = 64
"""Length of a pulse at full drive, in steps."""
PERIOD = 25e-6
"""Of the ultrasound, in s: 50 MHz x 512 / 625 / 1024 (Masterclock.vhd, Counter.vhd) is 40 kHz."""
START = 0x80
"""The eighth bit."""
AHEAD = 512
"""Frames that are made at once, before they are due."""


def drive_frames(drive: Drive, first: int, count: int, boards: Sequence[Board]) -> list[bytes]:
    """`count` frames of a drive from `first` on, as one text of bytes for each board; past its end it begins again.

    A phase is rounded once, after the offset was taken off and half of what the pulse is short was added: so the middle
    of a pulse stays where it is, whatever its length.
    """
    which = np.arange(first, first + count) % drive.frames
    # Some frames first: of a reel that is all that is read.
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
    """The frames of a drive as bytes for each board, made a block before they are due: a file takes its time.

    Parameters
    ----------
    drive : Drive
        In memory or on the disk.
    boards : sequence of Board
        That are to play it.
    total : int
        How many frames are to come, repeats included.
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
        """`count` frames from `first` on, which is never before what was taken last."""
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
    """Longest pulses that are no louder than levels of 0 to 1, same shape, in steps: level = sin(pi length / 128).

    A step is up to 2.5 % of full drive. Spreading what is lost over the transducers, some a step longer than others,
    would get the mean right and make E worse: most of a solved field is what cancels, and that wants them alike.
    """
    exact = np.arcsin(np.clip(level, 0, 1)) * (STEPS / np.pi)
    # A hundredth of a step, so that a level that was written with three digits finds its own length.
    return np.floor(exact + 0.01).astype(np.uint8)


def off_frame(divider: int | None = None) -> bytes:
    """A frame of no sound, which puts a rate divider in force if one is given."""
    frame = np.zeros(FRAME, np.uint8)
    frame[0] = START
    if divider is not None:
        frame[26:34] = np.unpackbits(np.array([divider], np.uint8), bitorder="little") * START
        frame[34] = START
    return frame.tobytes()


def off_frames() -> bytes:
    """Frames that silence a board whatever it was in the middle of.

    A frame that was cut swallows the beginning of the first, what is left of that has no eighth bit and is skipped, and
    the last one pushes the second whole through a buffer that is read 512 bytes at a time.
    """
    return 3 * off_frame()


def rate_divider(rate: float) -> int:
    """The whole number N of ultrasound periods in a frame: rate = 40 kHz / N, N from 4 to 255.

    The firmware takes 1 to 255; below 4 one board would need more than the 5.12 MB/s that its makers send it.

    Raises
    ------
    RateError
        If there is none.
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
