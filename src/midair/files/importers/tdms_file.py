"""TDMS, the format of LabVIEW and NI-DAQmx: the channels of one group become a recording.

Layout: "TDMS File Format Internal Structure" (National Instruments). A file is a sequence of segments; each has a
lead-in of 28 bytes, optional metadata (objects with a path, an index of their raw data, and properties) and raw data in
chunks, channel after channel or interleaved. Supported: integers and floats, contiguous and interleaved, either byte
order, many segments. Not supported: DAQmx raw data and scaled channels, whose numbers are not in the unit of the
sensor.
"""

import math
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, MismatchError, UnknownFormatError
from midair.files.opened_take import Format, ImportedData, ImportOptions, OpenedTake

_META, _NEW, _RAW, _INTERLEAVED, _BIG, _DAQMX = 1 << 1, 1 << 2, 1 << 3, 1 << 5, 1 << 6, 1 << 7
_TYPES = dict(enumerate(("i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f4", "f8"), 1)) | {0x19: "f4", 0x1A: "f8"}
_STRING, _BOOLEAN, _TIME = 0x20, 0x21, 0x44
_UNFINISHED = 0xFFFFFFFFFFFFFFFF


@dataclass(slots=True, kw_only=True)
class _Object:
    """A group or channel, as read so far."""

    properties: dict[str, Any] = field(default_factory=dict[str, Any])
    dtype: np.dtype[Any] = field(default_factory=lambda: np.dtype("u1"))
    count: int = 0
    pieces: list[NDArray[Any]] = field(default_factory=list[NDArray[Any]])


def read_tdms(path: Path, given: ImportOptions) -> OpenedTake:
    """Read the channels of the only group that has any, or of the group `field`."""
    objects, cut = _objects(_Cursor(data=path.read_bytes(), path=path))
    group, channels = _group(objects, path, given)
    for name, channel in channels.items():
        if any(key.startswith("NI_Scal") for key in channel.properties):
            raise UnknownFormatError(f"{path}: channel {name} is scaled by NI_Scale properties; write scaled numbers")
    columns = [np.concatenate([piece.astype(np.float64) for piece in channel.pieces]) for channel in channels.values()]
    if len({len(column) for column in columns}) != 1:
        lengths = ", ".join(f"{name} {len(column)}" for name, column in zip(channels, columns, strict=True))
        raise BrokenFileError(f"{path}: expected channels of one length in group {group!r}, got {lengths}")
    return ImportedData(
        samples=np.stack(columns, axis=1),
        form="TDMS",
        rate=_rate(channels, path),
        names=tuple(channels),
        units=tuple(str(channel.properties.get("unit_string", "")) for channel in channels.values()),
        notes={"group": group},
        settings={"group": group},
        report=("The file was not closed: complete records were read.",) if cut else (),
    ).resolve(given, path)


def _group(objects: dict[str, _Object], path: Path, given: ImportOptions) -> tuple[str, dict[str, _Object]]:
    groups: dict[str, dict[str, _Object]] = {}
    for name, item in objects.items():
        parts = _parts(name)
        if len(parts) == 2 and item.pieces:
            groups.setdefault(parts[0], {})[parts[1]] = item
    found = ", ".join(f"{name} ({len(channels)} channels)" for name, channels in groups.items()) or "none"
    wanted = {given.field} & groups.keys() if given.field is not None else groups.keys()
    if given.field is not None and not wanted:
        raise MismatchError(f"{path}: expected a group {given.field!r} with numbers in it, got {found}")
    if len(wanted) != 1:
        raise BrokenFileError(f"{path}: expected one group with numbers, or its name as field, got {found}")
    name = next(iter(wanted))
    return name, groups[name]


def _rate(channels: dict[str, _Object], path: Path) -> float | None:
    steps = {channel.properties.get("wf_increment") for channel in channels.values()}
    if len(steps) > 1:
        raise BrokenFileError(f"{path}: expected channels of one rate, got wf_increment {sorted(map(str, steps))}")
    step = next(iter(steps))
    if not isinstance(step, float) or not math.isfinite(step) or step <= 0:
        return None
    # Rounded, because the binary rounding of a step would give a rate of 1000.0000000001 Hz.
    return float(f"{1 / step:.12g}")


def _parts(path: str) -> list[str]:
    """Names in the path of an object, ``/'group'/'channel'``, where a quote in a name is doubled."""
    return [part.replace("''", "'") for part in path[2:-1].split("'/'")] if len(path) > 2 else []


@dataclass(slots=True, kw_only=True)
class _Cursor:
    """Read position in the bytes of a file."""

    data: bytes
    path: Path
    place: int = 0
    order: str = "<"

    def take(self, count: int) -> bytes:
        if count < 0 or self.place + count > len(self.data):
            raise BrokenFileError(
                f"{self.path}: expected {count} bytes at {self.place}, got the end; the file is truncated"
            )
        self.place += count
        return self.data[self.place - count : self.place]

    def number(self, code: str) -> Any:
        return struct.unpack(self.order + code, self.take(struct.calcsize(code)))[0]

    def text(self) -> str:
        return self.take(self.number("I")).decode("utf-8")


def _objects(cursor: _Cursor) -> tuple[dict[str, _Object], bool]:
    """All objects by path, and whether the last segment is truncated."""
    objects: dict[str, _Object] = {}
    active: list[str] = []
    cut = False
    while cursor.place + 28 <= len(cursor.data):
        start = cursor.place
        cursor.order = "<"
        if cursor.take(4) != b"TDSm":
            raise BrokenFileError(f"{cursor.path}: expected a TDMS segment at byte {start}, got other bytes")
        # The flags, which give the byte order of the rest, are always little-endian.
        flags = cursor.number("I")
        cursor.order = ">" if flags & _BIG else "<"
        cursor.number("I")
        length, raw = cursor.number("Q"), cursor.number("Q")
        cut = length == _UNFINISHED or start + 28 + length > len(cursor.data)
        end = len(cursor.data) if cut else start + 28 + length
        if flags & _META:
            active = _metadata(cursor, objects, [] if flags & _NEW else active)
        if flags & _RAW and raw != _UNFINISHED:
            if flags & _DAQMX:
                raise UnknownFormatError(f"{cursor.path}: DAQmx raw data is not read; convert it to scaled TDMS")
            cursor.place = start + 28 + raw
            _raw(cursor, objects, active, end, interleaved=bool(flags & _INTERLEAVED))
        cursor.place = end
    return objects, cut


def _metadata(cursor: _Cursor, objects: dict[str, _Object], active: list[str]) -> list[str]:
    active = list(active)
    for _ in range(cursor.number("I")):
        name = cursor.text()
        item = objects.setdefault(name, _Object())
        index = cursor.number("I")
        if index not in (0, 0xFFFFFFFF):
            # The index of plain numbers is 20 bytes long.
            if index != 20:
                raise UnknownFormatError(f"{cursor.path}: {name} holds text or DAQmx raw data, which is not read")
            code, dimension, count = cursor.number("I"), cursor.number("I"), cursor.number("Q")
            if code not in _TYPES or dimension != 1:
                raise UnknownFormatError(f"{cursor.path}: {name} holds data of type {code}, which is not read")
            item.dtype, item.count = np.dtype(cursor.order + _TYPES[code]), count
        if index == 0xFFFFFFFF:
            active = [other for other in active if other != name]
        elif name not in active:
            active.append(name)
        for _ in range(cursor.number("I")):
            key = cursor.text()
            item.properties[key] = _value(cursor, cursor.number("I"))
    return active


def _value(cursor: _Cursor, code: int) -> Any:
    if code == _STRING:
        return cursor.text()
    if code == _BOOLEAN:
        return bool(cursor.number("B"))
    if code == _TIME:
        return cursor.take(16)
    if code not in _TYPES:
        raise UnknownFormatError(f"{cursor.path}: a property of type {code} is not known")
    return np.frombuffer(cursor.take(np.dtype(_TYPES[code]).itemsize), cursor.order + _TYPES[code])[0].item()


def _raw(cursor: _Cursor, objects: dict[str, _Object], active: list[str], end: int, *, interleaved: bool) -> None:
    """Read complete chunks up to `end`; an incomplete last chunk is ignored."""
    held = [objects[name] for name in active if objects[name].count]
    sizes = [item.count * item.dtype.itemsize for item in held]
    if not held or not 0 < sum(sizes) <= end - cursor.place:
        return
    whole = (end - cursor.place) // sum(sizes)
    if interleaved:
        if len({item.count for item in held}) != 1:
            raise BrokenFileError(f"{cursor.path}: expected interleaved channels of one length, got several")
        rows = np.frombuffer(
            cursor.take(whole * sum(sizes)), np.dtype([(str(i), item.dtype) for i, item in enumerate(held)])
        )
        for i, item in enumerate(held):
            item.pieces.append(rows[str(i)])
        return
    table = np.frombuffer(cursor.take(whole * sum(sizes)), np.uint8).reshape(whole, sum(sizes))
    for item, part in zip(held, np.split(table, np.cumsum(sizes)[:-1], axis=1), strict=True):
        item.pieces.append(np.ascontiguousarray(part).view(item.dtype).reshape(-1))


TDMS = Format(name="TDMS", read=read_tdms, memory=3)
