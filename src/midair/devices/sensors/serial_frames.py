"""Frame format of serial sensors: an encoder and a decoder.

One frame of all channels; all numbers are little-endian:

====== ======= ==========================================================
offset bytes   content
====== ======= ==========================================================
0      2       sync word, A5 5A
2      1       version of the protocol, 1
3      1       bytes of a sample: 2 or 3
4      1       channels, 1 to 255
5      1       flags, 0
6      4       period of the frames, in ns (1 000 000 at 1 kHz)
10     4       counter of frames, from 0; wraps after 2^32 - 1
14     4       device time of the frame, in µs; wraps after 2^32 - 1
18     n       samples of channels 0, 1, 2, ..., two's complement
18 + n 4       CRC-32 of bytes 2 to 18 + n (as in zlib, Ethernet and PNG)
====== ======= ==========================================================
"""

import struct
import zlib
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from midair.errors import DeviceError, InputError

SYNC = b"\xa5\x5a"
VERSION = 1
WRAP = 1 << 32

_HEADER = struct.Struct("<2sBBBBIII")
_CRC = struct.Struct("<I")


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Constant properties of the frames: 1 to 255 channels, 2 or 3 bytes per sample (`width`), `period` in ns."""

    channels: int
    width: int
    period: int

    @property
    def size(self) -> int:
        """Length of a frame, in bytes."""
        return _HEADER.size + self.channels * self.width + _CRC.size

    @property
    def full_scale(self) -> int:
        """Magnitude of the most negative sample, in counts."""
        return 1 << (8 * self.width - 1)

    @property
    def valid(self) -> bool:
        """True if a frame with this layout can exist."""
        return self.channels > 0 and self.width in (2, 3) and self.period > 0


def encode(samples: ArrayLike, *, counter: int, time_us: int, period_ns: int = 1_000_000, width: int = 2) -> bytes:
    """Bytes of one frame, as a sensor's firmware sends them; `samples` in counts, shape (channel,).

    Only the low 32 bits of `counter` and `time_us` are sent. Raises InputError if a sample does not fit into `width`
    bytes, or width or number of channels is invalid.
    """
    values = np.asarray(samples, np.int64)
    layout = Layout(channels=values.size, width=width, period=period_ns)
    if values.ndim != 1 or not layout.valid or values.size > 255:
        raise InputError(
            f"frame: expected 1 to 255 samples of 2 or 3 bytes, got shape {values.shape} of {width} bytes every "
            f"{period_ns} ns"
        )
    if values.min() < -layout.full_scale or values.max() >= layout.full_scale:
        raise InputError(f"frame: expected samples of {width} bytes, got {values.min()} to {values.max()} counts")
    header = _HEADER.pack(SYNC, VERSION, width, values.size, 0, period_ns, counter % WRAP, time_us % WRAP)
    body = header[2:] + values.astype("<i4").view(np.uint8).reshape(-1, 4)[:, :width].tobytes()
    return SYNC + body + _CRC.pack(zlib.crc32(body))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frames:
    """Consecutive frames without a gap; `counter` and `time_us` (in µs) are those of the first, without wraps."""

    samples: NDArray[np.int32]
    counter: int
    time_us: int


@dataclass(slots=True)
class Decoder:
    """Finds frames in a stream of bytes with any content between them."""

    layout: Layout | None = None
    """Layout of the first whole frame; frames of another layout are skipped."""
    skipped: int = 0
    """Number of bytes outside of whole frames: noise, or an incomplete or damaged frame."""
    broken: int = 0
    """Number of frames with a wrong CRC."""
    _held: bytearray = field(default_factory=bytearray)
    _counter: int = -1
    _time: int = 0

    def push(self, data: bytes) -> list[Frames]:
        """Return the whole frames that `data` completes, in runs without a gap.

        Raises DeviceError if the counter decreases: the sensor restarted, and the length of the gap is unknown.
        """
        self._held += data
        runs: list[list[tuple[int, int, bytes]]] = []
        while (found := self._next()) is not None:
            if runs and found[0] == runs[-1][-1][0] + 1:
                runs[-1].append(found)
            else:
                runs.append([found])
        return [] if self.layout is None else [_frames(run, self.layout) for run in runs]

    def _next(self) -> tuple[int, int, bytes] | None:
        """The next whole frame as (counter, time, bytes of the samples), or None if there is none yet."""
        while self._to_sync() and len(self._held) >= _HEADER.size:
            _, version, width, channels, flags, period, counter, time_us = _HEADER.unpack_from(self._held)
            layout = Layout(channels=channels, width=width, period=period)
            fits = version == VERSION and flags == 0 and layout.valid and self.layout in (None, layout)
            if fits and len(self._held) < layout.size:
                return None
            if fits and self._crc_fits(layout):
                samples = bytes(self._held[_HEADER.size : layout.size - _CRC.size])
                del self._held[: layout.size]
                self.layout = layout
                return self._unwrapped(counter, time_us, samples)
            # Skip one byte only: a valid frame may begin inside an apparent one.
            self._skip(1)
        return None

    def _to_sync(self) -> bool:
        """Discard the bytes before the next sync word, except a last byte that may be its first half."""
        at = self._held.find(SYNC)
        if at < 0:
            self._skip(len(self._held) - self._held.endswith(SYNC[:1]))
            return False
        self._skip(at)
        return True

    def _skip(self, count: int) -> None:
        self.skipped += count
        del self._held[:count]

    def _crc_fits(self, layout: Layout) -> bool:
        body = memoryview(self._held)[len(SYNC) : layout.size - _CRC.size]
        right = zlib.crc32(body) == _CRC.unpack_from(self._held, layout.size - _CRC.size)[0]
        # A bytearray cannot be resized while a view of it exists.
        body.release()
        self.broken += not right
        return right

    def _unwrapped(self, counter: int, time_us: int, samples: bytes) -> tuple[int, int, bytes]:
        if self._counter < 0:
            self._counter, self._time = counter, time_us
            return counter, time_us, samples
        ahead = (counter - self._counter) % WRAP
        # Up to half the range ahead is a gap; more is a decrease.
        if not 0 < ahead < WRAP // 2:
            raise DeviceError(
                f"serial: expected a frame after number {self._counter % WRAP}, got {counter}; the sensor restarted"
            )
        self._counter += ahead
        self._time += (time_us - self._time) % WRAP
        return self._counter, self._time, samples


def _frames(run: list[tuple[int, int, bytes]], layout: Layout) -> Frames:
    """Decode samples of 2 or 3 bytes as the upper bytes of 4, shifted down to extend the sign."""
    data = np.frombuffer(b"".join(samples for _, _, samples in run), np.uint8)
    wide = np.zeros((len(run), layout.channels, 4), np.uint8)
    wide[:, :, 4 - layout.width :] = data.reshape(len(run), layout.channels, layout.width)
    samples = wide.view("<i4")[:, :, 0].astype(np.int32) >> (8 * (4 - layout.width))
    return Frames(samples=samples, counter=run[0][0], time_us=run[0][1])
