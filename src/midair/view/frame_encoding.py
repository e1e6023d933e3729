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

import base64
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.view.view_data import Channels, Sound, ViewData

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


CHUNK = 250
"""Frames per section; each section has its own unit, so that quiet frames keep a fine resolution."""

PHASE_ROWS = 1000
"""Largest number of frames with phases in a page; longer drives are thinned out."""

FINE_FRAMES = 1500
"""Fields of at most so many frames have 16 bits (0.01 % of the maximum), longer ones 8 bits (1 %)."""


def metadata(showing: ViewData) -> dict[str, object]:
    """Return metadata for JSON: lengths in mm, tables and matrices as base64 text."""
    data: dict[str, object] = {
        "title": showing.title,
        "simulated": showing.simulated,
        "rate": showing.rate,
        "frames": showing.frames,
        "first": showing.first,
        "channel": showing.channel,
        "channels": 1 if showing.samples is None else showing.samples.values.shape[1],
        "marks": [],
        "colours": {name: _text(colour_table(name).tobytes()) for name in TABLES},
        "tracks": list(_tracks(showing)),
        "sensor": None,
    }
    if showing.sensor is not None:
        cells = showing.sensor
        data["sensor"] = {"rows": cells.rows, "columns": cells.columns, "pitch": 1e3 * cells.pitch}
    if showing.sound is not None:
        data.update(_plane(showing.sound))
    return data


def sections(showing: ViewData) -> dict[str, bytes]:
    """Return the packed frames of each track."""
    packed: dict[str, bytes] = {}
    for name, channels in _channels(showing):
        packed[name] = _counts(channels.values, Kind.SAMPLES, "<i2", showing)
    sound = showing.sound
    if sound is not None and sound.wanted is not None:
        packed["wanted"] = _counts(sound.wanted, Kind.FIELD, "u1", showing)
    if sound is not None and sound.played is not None:
        dtype = "<i2" if showing.frames <= FINE_FRAMES else "i1"
        packed["played"] = _counts(sound.played, Kind.FIELD, dtype, showing)
    if sound is not None and sound.drive is not None:
        packed["phases"] = pack(_phases(sound, showing))
    return packed


def size_of(showing: ViewData) -> int:
    """Estimate the size of all sections in bytes, without packing them."""
    width, sound = 0, showing.sound
    for _, channels in _channels(showing):
        width += 2 * channels.values.shape[1]
    if sound is not None:
        width += sound.grid.count * (sound.wanted is not None)
        width += sound.grid.count * (sound.played is not None) * (4 if showing.frames <= FINE_FRAMES else 2)
    kept = -(-showing.frames // _every(showing.frames))
    rows = 0 if sound is None or sound.drive is None else kept * sound.drive.array.count
    return width * showing.frames + rows


def check_size(showing: ViewData, *, most: int = 64 * 2**20) -> None:
    """Raise InputError if the frames of a view are more than `most` bytes, too many for one page."""
    size = size_of(showing)
    if size > most:
        raise InputError(
            f"page: expected at most {most / 1e6:.3g} MB of frames for a browser, got {size / 1e6:.3g} MB; "
            "show a part (--start-at, --duration)"
        )


def _channels(showing: ViewData) -> Iterator[tuple[str, Channels]]:
    if showing.samples is not None:
        yield "samples", showing.samples
    if showing.again is not None:
        yield "again", showing.again


def _tracks(showing: ViewData) -> Iterator[dict[str, object]]:
    for name, channels in _channels(showing):
        yield {"name": name, "unit": channels.unit, "label": channels.label}
    sound = showing.sound
    if sound is None:
        return
    if sound.wanted is not None:
        yield {"name": "wanted", "unit": "Pa", "label": "target"}
    if sound.played is not None:
        yield {"name": "played", "unit": "Pa", "label": "played"}
    if sound.drive is not None:
        yield {"name": "phases", "sparse": True}


def _plane(sound: Sound) -> dict[str, object]:
    grid = sound.grid
    place = {"pitch": 1e3 * grid.pitch, "x": 1e3 * grid.centre[0], "y": 1e3 * grid.centre[1]}
    field: dict[str, object] = {"rows": grid.rows, "columns": grid.columns, "place": place}
    for name in () if sound.finer is None else ("down", "across"):
        field[name] = _text(np.asarray(getattr(sound.finer, name), "<f4").tobytes())
    data: dict[str, object] = {"field": field, "top": sound.top, "played": "Played, simulated"}
    if sound.drive is not None:
        data["positions"] = np.round(1e3 * sound.drive.array.position[:, :2], 2).ravel().tolist()
    return data


def _counts(values: NDArray[np.float64] | NDArray[np.complex128], kind: Kind, dtype: str, showing: ViewData) -> bytes:
    return pack(
        encode_counts(values[at : at + CHUNK], kind, dtype=dtype, first=showing.first + at, rate=showing.rate)
        for at in range(0, len(values), CHUNK)
    )


def _phases(sound: Sound, showing: ViewData) -> Iterator[Section]:
    """Return one section per frame, since frames may be left out."""
    if sound.drive is None:
        return
    for frame in range(0, showing.frames, _every(showing.frames)):
        phase = sound.drive.phase[frame : frame + 1]
        yield phase_counts(phase, first=showing.first + frame, rate=showing.rate)


def _every(frames: int) -> int:
    """Interval between the frames whose phases a page keeps."""
    return -(-frames // PHASE_ROWS)


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()
