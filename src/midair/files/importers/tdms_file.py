"""TDMS, the format of LabVIEW and NI-DAQmx: the channels of one group become a recording.

Layout: "TDMS File Format Internal Structure" (National Instruments). A file is a sequence of segments; each has a
lead-in of 28 bytes, optional metadata (objects with a path, an index of their raw data, and properties) and raw data in
chunks, channel after channel or interleaved. DAQmx raw data, which NI-DAQmx logs, are rows of bytes in one or several
buffers, in which each channel has an offset. Channels may be scaled by lines and polynomials of other scales or of the
raw numbers. Not supported: digital lines, and scales of thermocouples, RTDs, strain gauges and tables.
"""

import math
import struct
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, MismatchError, UnknownFormatError
from midair.files.opened_take import Format, ImportedData, ImportOptions

_META, _NEW, _RAW, _INTERLEAVED, _BIG = 1 << 1, 1 << 2, 1 << 3, 1 << 5, 1 << 6
_TYPES = dict(enumerate(("i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f4", "f8"), 1)) | {0x19: "f4", 0x1A: "f8"}
_STRING = 0x20
_VALUES = _TYPES | {0x21: "?", 0x44: "V16"}
"""Types of properties: numbers, truth values and times."""
_UNFINISHED = 0xFFFFFFFFFFFFFFFF
_DAQMX, _DAQMX_TYPES = 0x1269, ("u1", "i1", "u2", "i2", "u4", "i4")
_UNSCALED = 0xFFFFFFFF


@dataclass(slots=True, kw_only=True)
class _Object:
    """A group or channel, as read so far."""

    properties: dict[str, Any] = field(default_factory=dict[str, Any])
    dtype: np.dtype[Any] = field(default_factory=lambda: np.dtype("u1"))
    count: int = 0
    place: tuple[int, int] = (0, 0)
    widths: tuple[int, ...] = ()
    """Buffer and byte of the channel in a row of DAQmx raw data, and the widths of the rows of all buffers."""
    pieces: list[NDArray[Any]] = field(default_factory=list[NDArray[Any]])


def read_tdms(path: Path, given: ImportOptions) -> ImportedData:
    """Read the channels of the only group that has any, or of the group `field`."""
    objects, cut = _objects(_Cursor(path.read_bytes()), path.stat().st_size)
    group, channels = _group(objects, given)
    columns = [_scaled(name, channel) for name, channel in channels.items()]
    if len({len(column) for column in columns}) != 1:
        lengths = ", ".join(f"{name} {len(column)}" for name, column in zip(channels, columns, strict=True))
        raise BrokenFileError(f"expected channels of one length in group {group!r}, got {lengths}")
    return ImportedData(
        samples=np.stack(columns, axis=1),
        form="TDMS",
        rate=_rate(channels),
        names=tuple(channels),
        units=tuple(str(channel.properties.get("unit_string", "")) for channel in channels.values()),
        notes={"group": group},
        settings={"group": group},
        report=("The file was not closed: complete records were read.",) if cut else (),
    )


def _scaled(name: str, channel: _Object) -> NDArray[np.float64]:
    """Numbers of a channel after its scales; UnknownFormatError for a scale that is neither a line nor a polynomial."""
    raw = np.concatenate([piece.astype(np.float64) for piece in channel.pieces])
    known = channel.properties
    last = int(known.get("NI_Number_Of_Scales", 0)) - 1
    if last < 0 or known.get("NI_Scaling_Status") == "scaled":
        return raw

    def numbers(scale: int) -> NDArray[np.float64]:
        kind = known.get(f"NI_Scale[{scale}]_Scale_Type")
        # The scale that has no type is the raw number itself, as DAQmx counts it.
        if scale == _UNSCALED or (kind is None and channel.widths and scale == 0):
            return raw
        if kind not in ("Linear", "Polynomial"):
            raise UnknownFormatError(f"channel {name} has the scale {kind}, which is not read; export it as text")
        own = f"NI_Scale[{scale}]_{kind}_"
        source = int(known.get(f"{own}Input_Source", _UNSCALED))
        if source != _UNSCALED and source >= scale:
            raise BrokenFileError(f"expected a scale before {scale} as its input, got {source}")
        if kind == "Linear":
            return numbers(source) * known[f"{own}Slope"] + known[f"{own}Y_Intercept"]
        terms = [known[f"{own}Coefficients[{i}]"] for i in range(int(known[f"{own}Coefficients_Size"]))]
        return np.asarray(np.polynomial.polynomial.polyval(numbers(source), terms), np.float64)

    return numbers(last)


def _group(objects: dict[str, _Object], given: ImportOptions) -> tuple[str, dict[str, _Object]]:
    groups: dict[str, dict[str, _Object]] = {}
    for name, item in objects.items():
        parts = _parts(name)
        if len(parts) == 2 and item.pieces:
            groups.setdefault(parts[0], {})[parts[1]] = item
    found = ", ".join(f"{name} ({len(channels)} channels)" for name, channels in groups.items()) or "none"
    wanted = {given.field} & groups.keys() if given.field is not None else groups.keys()
    if given.field is not None and not wanted:
        raise MismatchError(f"expected a group {given.field!r} with numbers in it, got {found}")
    if len(wanted) != 1:
        raise BrokenFileError(f"expected one group with numbers, or its name as field, got {found}")
    name = next(iter(wanted))
    return name, groups[name]


def _rate(channels: dict[str, _Object]) -> float | None:
    steps = {channel.properties.get("wf_increment") for channel in channels.values()}
    if len(steps) > 1:
        raise BrokenFileError(f"expected channels of one rate, got wf_increment {sorted(map(str, steps))}")
    step = next(iter(steps))
    if not isinstance(step, float) or not math.isfinite(step) or step <= 0:
        return None
    # Rounded, because the binary rounding of a step would give a rate of 1000.0000000001 Hz.
    return float(f"{1 / step:.12g}")


def _parts(path: str) -> list[str]:
    """Names in the path of an object, ``/'group'/'channel'``, where a quote in a name is doubled."""
    return [part.replace("''", "'") for part in path[2:-1].split("'/'")] if len(path) > 2 else []


class _Cursor(BytesIO):
    """The bytes of a file, and the byte order of the segment that is read."""

    order = "<"

    def values(self, layout: str) -> tuple[Any, ...]:
        return struct.unpack(self.order + layout, self.read(struct.calcsize("<" + layout)))

    def text(self) -> str:
        return self.read(*self.values("I")).decode()


def _objects(cursor: _Cursor, size: int) -> tuple[dict[str, _Object], bool]:
    """All objects by path in a file of so many bytes, and whether the last segment is truncated."""
    objects: dict[str, _Object] = {}
    active: list[str] = []
    start, cut = 0, False
    while start + 28 <= size:
        cursor.order = "<"
        # The flags, which give the byte order of the rest, are always little-endian.
        mark, flags = cursor.values("4sI")
        if mark != b"TDSm":
            raise BrokenFileError(f"expected a TDMS segment at byte {start}, got other bytes")
        cursor.order = ">" if flags & _BIG else "<"
        _, length, raw = cursor.values("IQQ")
        cut = length == _UNFINISHED or start + 28 + length > size
        end = size if cut else start + 28 + length
        if flags & _META:
            active = _metadata(cursor, objects, [] if flags & _NEW else active)
        if flags & _RAW and raw != _UNFINISHED:
            cursor.seek(start + 28 + raw)
            _raw(cursor, objects, active, end, interleaved=bool(flags & _INTERLEAVED))
        start = cursor.seek(end)
    return objects, cut


def _metadata(cursor: _Cursor, objects: dict[str, _Object], active: list[str]) -> list[str]:
    active = list(active)
    for _ in range(*cursor.values("I")):
        name = cursor.text()
        item = objects.setdefault(name, _Object())
        (index,) = cursor.values("I")
        if index not in (0, 0xFFFFFFFF):
            code, dimension, count = cursor.values("IIQ")
            if index == _DAQMX and cursor.values("I") == (1,):
                code, buffer, byte, _, _, widths = cursor.values("6I")
                item.place, item.widths = (buffer, byte), cursor.values(f"{widths}I")
                kind = _DAQMX_TYPES[code] if code < len(_DAQMX_TYPES) else ""
            else:
                # The index of plain numbers is 20 bytes long.
                kind = _TYPES.get(code, "") if index == 20 else ""
            if not kind or dimension != 1:
                raise UnknownFormatError(f"{name} holds text, digital lines or data of type {code}, not read")
            item.dtype, item.count = np.dtype(cursor.order + kind), count
        if index == 0xFFFFFFFF:
            active = [other for other in active if other != name]
        elif name not in active:
            active.append(name)
        for _ in range(*cursor.values("I")):
            key = cursor.text()
            item.properties[key] = _value(cursor, *cursor.values("I"))
    return active


def _value(cursor: _Cursor, code: int) -> Any:
    if code == _STRING:
        return cursor.text()
    if code not in _VALUES:
        raise UnknownFormatError(f"a property of type {code} is not known")
    kind = np.dtype(cursor.order + _VALUES[code])
    return np.frombuffer(cursor.read(kind.itemsize), kind)[0].item()


def _raw(cursor: _Cursor, objects: dict[str, _Object], active: list[str], end: int, *, interleaved: bool) -> None:
    """Read complete chunks up to `end`; an incomplete last chunk is ignored.

    A chunk is one or several buffers of rows. Interleaved channels share the rows of one buffer; else each has its own.
    """
    held = [objects[name] for name in active if objects[name].count]
    if not held:
        return
    sizes, stored = tuple(item.dtype.itemsize for item in held), {item.widths for item in held}
    if any(stored):
        widths, places = held[0].widths, [item.place for item in held]
    elif interleaved:
        widths, places = (sum(sizes),), [(0, sum(sizes[:i])) for i in range(len(held))]
    else:
        widths, places = sizes, [(i, 0) for i in range(len(held))]
    shared = interleaved or any(stored)
    counts = [held[0].count] * len(widths) if shared else [item.count for item in held]
    if shared and (len(stored) > 1 or len({item.count for item in held}) > 1):
        raise BrokenFileError("expected channels of one length in shared rows, got several")
    chunk = [count * width for count, width in zip(counts, widths, strict=True)]
    whole = max(0, end - cursor.tell()) // sum(chunk) if sum(chunk) else 0
    table = np.frombuffer(cursor.read(whole * sum(chunk)), np.uint8).reshape(whole, sum(chunk))
    buffers = np.split(table, np.cumsum(chunk)[:-1], axis=1)
    for item, (buffer, first) in zip(held, places, strict=True):
        rows = buffers[buffer].reshape(-1, widths[buffer])[:, first : first + item.dtype.itemsize]
        item.pieces.append(np.ascontiguousarray(rows).view(item.dtype).reshape(-1))


TDMS = Format(name="TDMS", read=read_tdms, memory=3)
