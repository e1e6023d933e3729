"""Binary encoding of frames for a page: consecutive sections, little-endian, the same in a WebSocket and in a file.

====== ========= ==================================================================================================
offset type      content
====== ========= ==================================================================================================
0      u8 x 4    0x6D; version 1; kind (1 samples, 2 field, 3 phases, 4 meters, 5 marks);
                 type (1 i8, 2 i16, 3 f32, 4 u8)
4      u32       message number
8      f64       time of the newest frame, s
16     u64       first frame
24     u16 x 2   frames, values a frame
28     f32       unit of one count
32               values
====== ========= ==================================================================================================

A complex field of n points has 2 n values per frame (real and imaginary part of each point), a magnitude has n. Phases
have one count of 2 pi / 256 rad per transducer. A mark has one value per frame: its frame number relative to the first.
`web/view.js` reads this format.
"""

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError

Table = Literal["inferno", "cividis", "twilight"]
TABLES: tuple[Table, ...] = ("inferno", "cividis", "twilight")
"""Two for magnitudes (zero is dark in inferno; cividis suits colour-blind people) and a cyclic one for phases."""


def colour_table(name: str) -> NDArray[np.uint8]:
    """Return 256 RGB colours from the lowest to the highest value, shape (256, 3)."""
    from matplotlib import colormaps

    return np.asarray(colormaps[name](np.arange(256) / 255, bytes=True)[:, :3], np.uint8)


HEADER = struct.Struct("<4BIdQHHf")
"""The 32-byte header of a section."""

MAGIC, VERSION = 0x6D, 1

TYPES: dict[int, np.dtype[Any]] = {1: np.dtype("i1"), 2: np.dtype("<i2"), 3: np.dtype("<f4"), 4: np.dtype("u1")}
"""Data types by their number in the header."""

LONGEST = 2**16 - 1
"""Largest number of frames in a section, and of values in a frame."""


class Kind(IntEnum):
    """Kind of values in a section."""

    SAMPLES = 1
    FIELD = 2
    PHASES = 3
    METERS = 4
    MARKS = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Section:
    """Consecutive frames."""

    kind: Kind
    values: NDArray[Any]
    """Counts of `unit`, int8, int16, float32 or uint8, shape (frame, value)."""
    unit: float = 1.0
    """Size of one count in V, Pa or rad."""
    first: int = 0
    """Number of the first frame."""
    time: float = 0.0
    """Time of the newest frame in s."""
    number: int = 0
    """Number of the message, from 0."""

    def __post_init__(self) -> None:
        if self.values.ndim != 2 or max(self.values.shape) > LONGEST:
            raise ShapeError(f"section: expected (frame, value), each up to {LONGEST}, got {self.values.shape}")
        _type_number(self.values.dtype)


def pack(sections: Iterable[Section]) -> bytes:
    """Encode sections as bytes. Raises InputError if a number does not fit into the header."""
    return b"".join(_packed(section) for section in sections)


def unpack(data: bytes | bytearray | memoryview) -> list[Section]:
    """Decode sections. Raises InputError if version, kind or type is unknown, or the data is incomplete."""
    data, at, found = memoryview(data), 0, list[Section]()
    while at < len(data):
        if len(data) - at < HEADER.size:
            raise InputError(f"section at byte {at}: expected a header of {HEADER.size} bytes, got {len(data) - at}")
        magic, version, kind, kept, number, time, first, frames, width, unit = HEADER.unpack_from(data, at)
        if (magic, version) != (MAGIC, VERSION) or kind not in list(Kind) or kept not in TYPES:
            raise InputError(
                f"section at byte {at}: expected {MAGIC:#x}, version {VERSION}, a kind of 1 to {len(Kind)} and a type "
                f"of 1 to {len(TYPES)}, got {magic:#x}, {version}, {kind}, {kept}; reload the page"
            )
        dtype, at = TYPES[kept], at + HEADER.size
        size = frames * width * dtype.itemsize
        if len(data) - at < size:
            raise InputError(f"section of frame {first}: expected {size} bytes of values, got {len(data) - at}")
        values = np.frombuffer(data, dtype, frames * width, at).reshape(frames, width)
        found.append(Section(kind=Kind(kind), values=values, unit=unit, first=first, time=time, number=number))
        at += size
    return found


def encode_counts(values: NDArray[Any], kind: Kind, *, dtype: str = "<i2", first: int = 0, rate: float) -> Section:
    """Encode values (frame, value) as integer counts; the unit is the smallest in which the largest value fits.

    Complex numbers become pairs. The largest error is half a count of `dtype` ("i1", "<i2", "u1"), or that of rounding
    ("<f4"). Frame i, counted from `first`, is at i / rate.
    """
    pairs = np.ascontiguousarray(values, np.complex128).view(np.float64) if np.iscomplexobj(values) else values
    time, kept = (first + len(values) - 1) / rate, np.dtype(dtype)
    if kept.kind == "f":
        return Section(kind=kind, values=np.asarray(pairs, kept), first=first, time=time)
    # Rounded to float32 as in the header, so that both sides multiply by the same number.
    unit = float(np.float32(np.abs(pairs).max(initial=0) / np.iinfo(kept).max)) or 1.0
    least, most = max(np.iinfo(kept).min, -np.iinfo(kept).max), np.iinfo(kept).max
    counts = np.clip(np.rint(pairs / unit), least, most)
    return Section(kind=kind, values=counts.astype(kept), unit=unit, first=first, time=time)


def phase_counts(phase: NDArray[np.float64], *, first: int = 0, rate: float) -> Section:
    """Encode phases in rad, shape (frame, transducer), as the firmware does: 256 steps per cycle."""
    steps = np.mod(np.rint(phase / (2 * np.pi) * 256), 256).astype(np.uint8)
    time = (first + len(phase) - 1) / rate
    return Section(kind=Kind.PHASES, values=steps, unit=2 * np.pi / 256, first=first, time=time)


def _packed(section: Section) -> bytes:
    frames, values = section.values.shape
    number, rest = _type_number(section.values.dtype), (section.number, section.time, section.first)
    try:
        head = HEADER.pack(MAGIC, VERSION, int(section.kind), number, *rest, frames, values, section.unit)
    except (struct.error, OverflowError) as wrong:
        raise InputError(
            f"section: expected a message number below 2^32, a first frame from 0 on and a unit of float32, "
            f"got {section.number}, {section.first} and {section.unit:g}"
        ) from wrong
    return head + np.ascontiguousarray(section.values, TYPES[number]).tobytes()


def _type_number(dtype: np.dtype[Any]) -> int:
    for number, known in TYPES.items():
        if dtype == known:
            return number
    raise InputError(f"section: expected values of int8, int16, float32 or uint8, got {dtype}")
