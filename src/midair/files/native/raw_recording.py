"""The raw file of a running recording, and its conversion to HDF5.

A recording is appended to a file of its own name, which HDF5 replaces at the end. The file begins with `MAGIC`. Then
follow records: the kind, the number of bytes and their CRC-32, then the bytes. A record of text is JSON: the header
(the first record), events or stage positions; a record of frames holds the numbers of `frame_type`, little-endian.
If the program is killed or the computer stops, all records before the first incomplete one are kept, and whatever
opens the file next converts it.
"""

import json
import os
import struct
import sys
import zlib
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError
from midair.files.atomic import existing_file, lock_recording, parse_errors
from midair.files.native.hdf5 import new_file, open_hdf5, write_frames, write_group
from midair.files.native.schema import PLAYED, TABLE, stored_values
from midair.model import Event, StageStamp
from midair.streaming import BYTES
from midair.validation import check_type

if TYPE_CHECKING:
    import h5py

MAGIC = b"midair raw recording\n"

FRAMES, TEXT = b"F", b"T"
"""Kinds of records."""

_HEAD = struct.Struct("<cII")


def record(kind: bytes, content: bytes) -> bytes:
    """A record as stored."""
    return _HEAD.pack(kind, len(content), zlib.crc32(content)) + content


def records(file: BinaryIO) -> Iterator[tuple[bytes, bytes]]:
    """Kind and content of each record of a raw file, up to the first that is incomplete."""
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        return
    while len(head := file.read(_HEAD.size)) == _HEAD.size:
        kind, length, check = _HEAD.unpack(head)
        content = file.read(length)
        if kind not in (FRAMES, TEXT) or len(content) < length or zlib.crc32(content) != check:
            return
        yield kind, content


def frame_type(header: Mapping[str, Any]) -> np.dtype[Any]:
    """Type of a stored frame: the samples, and for live touch the values played during it."""
    known, played = header["recording"], header["played"]
    fields: list[Any] = [("samples", f"<{header['stored']}", (len(known["y"]), len(known["x"])))]
    for entry in TABLE["played"] if played else ():
        if entry.name in PLAYED:
            shape = (header["played_each"], *(len(played["transducer_unit"]) for _ in (entry.dimensions or ())[1:]))
            fields.append((entry.name, np.dtype(entry.dtype).newbyteorder("<"), shape))
    return np.dtype(fields)


def _read(file: BinaryIO, path: Path) -> tuple[Mapping[str, Any], int, SimpleNamespace]:
    """Header, number of frames, `events` and `stamps` of a raw file; its frames stay on the disk."""
    texts: list[Mapping[str, Any]] = []
    size = 0
    for kind, content in records(file):
        if kind == TEXT:
            texts.append(json.loads(content))
        else:
            size += len(content)
    frames = size // frame_type(texts[0]).itemsize if texts else 0
    if not frames:
        raise BrokenFileError(f"{path}: the recording stopped before its first frame was written; record it again")
    events = [Event(**row) for text in texts[1:] for row in text.get("events", ())]
    stamps = [StageStamp(**row) for text in texts[1:] for row in text.get("stamps", ())]
    return texts[0], frames, SimpleNamespace(events=events, stamps=stamps)


def _blocks(file: BinaryIO, kind: np.dtype[Any]) -> Iterator[NDArray[Any]]:
    """Frames of a raw file, about 2 MB at a time."""
    held = bytearray()
    for found, content in records(file):
        held += content if found == FRAMES else b""
        if len(held) >= BYTES:
            yield np.frombuffer(bytes(held), kind)
            held.clear()
    if held:
        yield np.frombuffer(bytes(held), kind)


def convert(path: Path, file: BinaryIO) -> tuple[int, float]:
    """Replace a raw file, which is closed, by HDF5 atomically; returns its frames and their rate in Hz.

    Raises FileError if HDF5 cannot be written; the raw file stays.
    """
    with file:
        header, frames, rows = _read(file, path)
        rate, kind, each = header["recording"]["rate_hz"], frame_type(header), header["played_each"]
        values = stored_values("recording", rows)
        values |= {**header["recording"], "samples": np.empty(0, kind)["samples"]}
        touch = None
        with new_file(path, room=path.stat().st_size + 8 * frames, recording=True) as made:
            write_group(made, "recording", values, frames=frames)
            if header["calibration"]:
                write_group(made.create_group("calibration"), "calibration", header["calibration"])
            if header["played"]:
                played = {**header["played"], "rate_hz": each * rate, **_played(np.empty(0, kind))}
                touch = made.create_group("played")
                write_group(touch, "played", played, frames=each * frames)
            done = 0
            for block in _blocks(file, kind):
                write_frames(made, {"samples": block["samples"]}, done)
                if touch is not None:
                    write_frames(touch, _played(block), each * done)
                done += len(block)
            if sys.platform == "win32":  # which replaces no open file
                file.close()
    return frames, rate


def _played(frames: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Values of live touch in stored frames."""
    return {name: frames[name].reshape(-1, *frames[name].shape[2:]) for name in PLAYED}


def complete(path: Path) -> tuple[str, ...]:
    """Convert the raw file of an interrupted recording to HDF5, and report it; other files stay as they are.

    Raises FileError if a program is recording into it, or it cannot be converted.
    """
    file = existing_file(path)
    with parse_errors(file, "a recording of midair"):
        if not _is_raw(file):
            return ()
        with file.open("rb+") as raw:
            lock_recording(raw.fileno(), file)
            if not _is_raw(file):  # another program has converted it meanwhile
                return ()
            frames, rate = convert(file, raw)
    return (f"The recording was interrupted: {frames} frames, {frames / rate:g} s, are kept.",)


def _is_raw(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


@contextmanager
def open_file(path: "str | os.PathLike[str]") -> "Generator[h5py.File]":
    """Open an HDF5 file of midair to read; an interrupted recording is converted first."""
    import h5py

    check_type(path, "path", str, os.PathLike)
    complete(Path(path))
    file = existing_file(path)
    with parse_errors(file, "an HDF5 file of midair"):
        if not h5py.is_hdf5(file):
            raise BrokenFileError(f"{file}: expected an HDF5 file of midair record, import or solve, got other bytes")
        with open_hdf5(file) as opened:
            yield opened
