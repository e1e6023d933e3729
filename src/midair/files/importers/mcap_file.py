"""MCAP, a log format of robotics: the messages of one topic become frames.

Supported are JSON messages that contain one list of numbers (or numbers by name), and the MultiArrays of ROS 2
(std_msgs/msg/Float32MultiArray and similar, in CDR). The time of a frame is its publish time.
"""

import contextlib
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, MismatchError, MissingExtraError
from midair.files.atomic import reason
from midair.files.opened_take import Format, ImportedData, ImportOptions, OpenedTake
from midair.files.size_limits import check_expansion
from midair.files.text_files import json_of

_NUMBERS = ("Float32", "Float64", "Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64")
_ROS = {f"std_msgs/msg/{name}MultiArray": np.dtype(name.lower()).str[1:] for name in _NUMBERS}

_CHUNK = 6
_EXPANDED_ANYWAY = 2**24  # bytes; low, because parsing numbers from text is slow

Decoder = Callable[[bytes], dict[str, Any] | list[Any] | NDArray[Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Topic:
    """Decoder of a topic (None if unsupported), and (publish time in ns, bytes) of each message."""

    decode: Decoder | None
    messages: list[tuple[int, bytes]] = field(default_factory=list[tuple[int, bytes]])


def read_mcap(path: Path, given: ImportOptions) -> OpenedTake:
    """Read the only numeric topic of an MCAP, or the topic `stream`; files that were not closed are read too."""
    try:
        from mcap.records import Channel, Footer, Message, Schema
    except ImportError as wrong:
        raise MissingExtraError(f"{path}: MCAP needs mcap; pip install 'midair[mcap]'") from wrong
    schemas: dict[int, str] = {}
    channels: dict[int, _Topic] = {}
    topics: dict[str, _Topic] = {}
    # Only a closed file has a footer.
    cut = True
    for record in _records(path):
        if isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            decoder = _decoder(record.message_encoding, schemas.get(record.schema_id, ""))
            channels[record.id] = topics.setdefault(record.topic, _Topic(decode=decoder))
        elif isinstance(record, Message):
            channels[record.channel_id].messages.append((record.publish_time, record.data))
        elif isinstance(record, Footer):
            cut = False
    topic, name = _chosen(topics, path, given)
    decode = topic.decode or _from_json
    rows, names = _rows([decode(data) for _, data in topic.messages], name, path)
    # Subtract as integers first, because float64 rounds absolute times to 256 ns.
    stamps = np.array([time - topic.messages[0][0] for time, _ in topic.messages], np.float64) * 1e-9
    return ImportedData(
        samples=rows,
        form="MCAP",
        stamps=stamps,
        names=names,
        notes={"topic": name},
        settings={"topic": name},
        report=("The file was not closed: complete records were read.",) if cut else (),
    ).resolve(given, path)


def _chosen(topics: dict[str, _Topic], path: Path, given: ImportOptions) -> tuple[_Topic, str]:
    usable = [name for name, topic in topics.items() if topic.decode is not None and len(topic.messages) > 1]
    found = ", ".join(f"{name} ({len(topic.messages)})" for name, topic in topics.items()) or "none"
    if given.stream is not None:
        if given.stream not in usable:
            raise MismatchError(f"{path}: expected a topic {given.stream!r} of numbers, got {found}")
        return topics[given.stream], given.stream
    if len(usable) != 1:
        raise BrokenFileError(f"{path}: expected one topic of numbers, or its name as stream, got {found}")
    return topics[usable[0]], usable[0]


def _check_chunks(path: Path) -> None:
    """Raise BrokenFileError if the chunks, or their zstd frames, expand to more than the limit for this file."""
    # Opcode, length (8 bytes), two times, expanded size, checksum, compression (MCAP Format Specification, Chunk).
    from zstandard import ZstdError, get_frame_parameters

    place, size, expanded = 8, path.stat().st_size, 0
    with path.open("rb") as file:
        while place + 9 <= size:
            file.seek(place)
            opcode, length = struct.unpack("<BQ", file.read(9))
            if opcode == 0:  # not valid in MCAP; millions of such records in a block of zeros would take long
                raise BrokenFileError(f"{path}: expected an MCAP file, got zeros in place of a record at byte {place}")
            head = file.read(min(length, 128)) if opcode == _CHUNK else b""
            place += 9 + length
            if len(head) < 40:
                continue
            expanded += struct.unpack_from("<Q", head, 16)[0]
            start = 40 + struct.unpack_from("<I", head, 28)[0]
            with contextlib.suppress(ZstdError):
                stated = get_frame_parameters(head[start:]).content_size if head[32:36] == b"zstd" else 0
                # 2**64 - 1 means "unknown".
                expanded += stated if stated < 2**64 - 1 else 0
            check_expansion(path, expanded // 2 if head[32:36] == b"zstd" else expanded, anyway=_EXPANDED_ANYWAY)


def _records(path: Path) -> Iterator[Any]:
    """The records of a file, up to its end or to its truncation."""
    from mcap.exceptions import EndOfFile, McapError
    from mcap.stream_reader import StreamReader
    from zstandard import ZstdError

    _check_chunks(path)
    with path.open("rb") as file:
        try:
            yield from StreamReader(file, validate_crcs=True, record_size_limit=1 << 30).records
        except (EndOfFile, struct.error) as wrong:
            # At the end of the bytes the file is truncated; before it, a length in it is wrong.
            if file.read(1):
                raise BrokenFileError(f"{path}: expected an MCAP file, got a damaged one ({reason(wrong)})") from wrong
        except (McapError, ZstdError) as wrong:
            raise BrokenFileError(f"{path}: expected an MCAP file, got damaged records ({reason(wrong)})") from wrong


def _decoder(encoding: str, schema: str) -> Decoder | None:
    if encoding == "json":
        return _from_json
    if encoding == "cdr" and schema in _ROS:
        dtype = _ROS[schema]
        return lambda data: _from_cdr(data, dtype)
    return None


def _from_json(data: bytes) -> dict[str, Any] | list[Any]:
    """The only list in a message, or its numbers by name."""
    value = json_of(data)
    if isinstance(value, list):
        return value
    if not isinstance(value, dict):
        raise BrokenFileError(f"expected an object or a list in each message, got {type(value).__name__}")
    lists = [each for each in value.values() if isinstance(each, list)]
    if len(lists) == 1:
        return lists[0]
    numbers = {
        name: each for name, each in value.items() if isinstance(each, int | float) and not isinstance(each, bool)
    }
    if lists or not numbers:
        raise BrokenFileError(f"expected one list of numbers in each message, got {', '.join(value) or 'nothing'}")
    return numbers


def _from_cdr(data: bytes, dtype: str) -> NDArray[Any]:
    """Data of a MultiArray: labels, sizes and strides of the axes, an offset, then the numbers."""
    # XCDR1 (OMG DDSI-RTPS 2.5, 10.2): 4 bytes give the byte order, then each value is aligned to its own size.
    order = "<" if data[1] & 1 else ">"
    words = struct.Struct(order + "I")

    def word(place: int) -> tuple[int, int]:
        """The number at the next multiple of 4, and the position after it."""
        place += -place % 4
        return words.unpack_from(data, place)[0], place + 4

    axes, place = word(4)
    for _ in range(axes):
        length, place = word(place)
        place = word(word(place + length)[1])[1]
    count, place = word(word(place)[1])
    size = np.dtype(dtype).itemsize
    place += -(place - 4) % size
    if place + count * size > len(data):
        raise BrokenFileError(f"expected {count} numbers in each message, got {(len(data) - place) // size}")
    return np.frombuffer(data, order + dtype, count, place)


def _rows(decoded: list[Any], topic: str, path: Path) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    names: tuple[str, ...] = ()
    if isinstance(decoded[0], dict):
        names = tuple(decoded[0])
        decoded = [[message[name] for name in names] for message in decoded]
    shapes = {np.shape(message) for message in decoded}
    if len(shapes) != 1 or not 0 < len(next(iter(shapes))) <= 2:
        found = ", ".join(map(str, sorted(shapes)[:4]))
        raise BrokenFileError(
            f"{path}: expected messages of one shape, channels or rows x columns, in {topic}, got {found}"
        )
    return np.asarray(decoded, np.float64), names


MCAP = Format(name="MCAP", read=read_mcap, memory=3)
