"""Sound files (WAV, RF64, FLAC, AIFF, Ogg, MP3): one audio channel per cell, full scale 1.

midair writes WAV and FLAC, and stores its header in a chunk or a comment that other programs skip.

RIFF: Multimedia Programming Interface and Data Specifications 1.0 (IBM and Microsoft, 1991): a chunk is four letters,
the length of its content as a little-endian uint32, and the content, padded to an even length. RF64 (ITU-R BS.2088): as
RIFF, but lengths of 2^32 - 1 refer to 64-bit lengths in the first chunk, ds64.
"""

import struct
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from midair.errors import BrokenFileError, FileError, UnitError
from midair.files.atomic import atomic_file, check_disk_space
from midair.files.importers.header import header_of, own_take
from midair.files.opened_take import Format, FormatLoss, ImportedData, ImportOptions, OpenedTake
from midair.model import Recording, Unit
from midair.streaming import blocks

CHUNK = b"mdar"
"""Letters of midair's chunk."""

_LONG = 0xFFFFFFFF


class RiffChunk(NamedTuple):
    """Letters of a chunk, start and length of its content in bytes, and whether the length was not stated."""

    letters: bytes
    start: int
    length: int
    unstated: bool


def chunks(path: Path) -> tuple[RiffChunk, ...]:
    """The chunks of a WAV or RF64 file, in order; raises BrokenFileError if it is another file or truncated.

    A program that writes to a pipe, or is cut off, cannot state the length of the samples: if it is 0, or 2^31 - 2^10
    bytes or more and more than the file has, they reach to its end.
    """
    size, found, place, long = path.stat().st_size, list[RiffChunk](), 12, 0
    with path.open("rb") as file:
        start = file.read(12)
        if start[:4] not in (b"RIFF", b"RF64") or start[8:12] != b"WAVE":
            raise BrokenFileError(f"{path}: expected a WAV, got a file that begins with {start!r}")
        while place + 8 <= size:
            letters, length = _numbers_at(file, place, "<4sI")
            if letters == b"ds64" and length >= 16 and place + 24 <= size:
                (long,) = _numbers_at(file, place + 16, "<Q")
            if letters == b"data" and length == _LONG and long:
                length = long
            rest = size - place - 8
            unstated = rest < length >= 2**31 - 2**10 if length else not _chunk_at(file, place + 8, size)
            if letters == b"data" and unstated:
                length = rest
            elif length > rest:
                raise BrokenFileError(
                    f"{path}: expected {length} bytes in chunk {letters.decode('latin-1')!r}, got {rest}; the file is "
                    "truncated or its header is wrong"
                )
            found.append(RiffChunk(letters, place + 8, length, letters == b"data" and unstated))
            place += 8 + length + length % 2
    return tuple(found)


def append_chunk(path: Path, content: bytes) -> None:
    """Append midair's chunk to a RIFF file and update the length of the file."""
    with path.open("rb+") as file:
        end = file.seek(0, 2)
        # Chunks start at even positions.
        file.write(b"\0" * (end % 2) + CHUNK + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2))
        length = file.tell() - 8
        file.seek(4)
        file.write(struct.pack("<I", length))


def _numbers_at(file: BinaryIO, place: int, layout: str) -> tuple[Any, ...]:
    file.seek(place)
    return struct.unpack(layout, file.read(struct.calcsize(layout)))


def _chunk_at(file: BinaryIO, place: int, size: int) -> bool:
    """True at the end of a file and where a chunk begins."""
    if place + 8 > size:
        return True
    letters, length = _numbers_at(file, place, "<4sI")
    return letters.isascii() and letters.decode().isprintable() and place + 8 + length <= size


_WAV = ("WAV", "WAVEX", "RF64")
_FORMATS = ("FLAC", "AIFF", "OGG", "MP3")
_LOSSY = {"VORBIS", "OPUS", "MPEG_LAYER_I", "MPEG_LAYER_II", "MPEG_LAYER_III"}
_BITS = {"PCM_U8": 8, "PCM_16": 16, "PCM_24": 24, "PCM_32": 32}
_READABLE = (*_BITS, "FLOAT", "DOUBLE", "ULAW")


def write_wav(recording: Recording, path: Path) -> tuple[FormatLoss, ...]:
    """Write float64 without rounding; at most 1024 cells and 4 GB."""
    if (cells := recording.sensor.count) > 1024:
        raise FileError(f"{path}: a WAV holds up to 1024 channels, got a sensor of {cells}; save to .h5")
    # Lengths have 32 bits; 1 MB is reserved for the header and midair's chunk.
    if recording.samples.nbytes > 2**32 - 2**20:
        raise FileError(f"{path}: a WAV holds less than 4 GB, got {recording.samples.nbytes} bytes; save to .h5")
    return _write(recording, path, "WAV")


def write_flac(recording: Recording, path: Path) -> tuple[FormatLoss, ...]:
    """Write integers of 24 bits; at most 8 cells and 655,350 Hz (RFC 9639)."""
    if recording.sensor.count > 8 or recording.rate > 655_350:
        raise FileError(
            f"{path}: a FLAC holds up to 8 channels of up to 655350 Hz, got {recording.sensor.count} of "
            f"{recording.rate:g} Hz; choose some with --channels 5,6, or save to .wav"
        )
    return _write(recording, path, "FLAC")


def _write(recording: Recording, path: Path, form: str) -> tuple[FormatLoss, ...]:
    """Write the samples divided by the power of two above the peak, and midair's header."""
    import soundfile

    # Sound files have integer rates; midair's header stores the exact rate.
    rate, most = max(1, round(recording.rate)), 2**23 - 1
    exponent = int(np.frexp(np.abs(recording.samples).max())[1])
    header = header_of(recording, scale_exponent=exponent)
    subtype = "DOUBLE" if form == "WAV" else "PCM_24"
    with atomic_file(path) as partial:
        check_disk_space(partial.parent, recording.samples.nbytes, path)
        with soundfile.SoundFile(partial, "w", rate, recording.sensor.count, subtype=subtype, format=form) as file:
            if form == "FLAC":
                file.comment = header
            for block in blocks(recording.samples):
                part = np.ldexp(block, -exponent).reshape(len(block), -1)
                if form == "FLAC":
                    # The upper 24 of 32 bits, since libsndfile would multiply numbers by 2^23 - 1.
                    part = np.clip(np.rint(part * 2**23), -most, most).astype(np.int32) << 8
                file.write(part)
        if form == "WAV":
            append_chunk(partial, header.encode("ascii"))
    return tuple(_losses(form, recording, rate, exponent))


def read_wav(path: Path, given: ImportOptions) -> OpenedTake:
    """Read a WAV or RF64 file: PCM of 8 to 32 bits, float32, float64 or µ-law."""
    found = chunks(path)
    with path.open("rb") as file:
        header = next((_numbers_at(file, own.start, f"{own.length}s")[0] for own in found if own.letters == CHUNK), b"")
    if unknown := next((chunk for chunk in found if chunk.unstated), None):
        data = bytearray(path.read_bytes())
        data[unknown.start - 4 : unknown.start] = struct.pack("<I", min(unknown.length, _LONG))
        note = "The length of the samples was not stated: the file was read to its end."
        return _read(path, given, _WAV, "", BytesIO(data), (note,))
    return _read(path, given, _WAV, header.decode("ascii"))


def read_sound(path: Path, given: ImportOptions) -> OpenedTake:
    """Read a FLAC, AIFF, Ogg (Vorbis, Opus) or MP3 file."""
    return _read(path, given, _FORMATS, "")


def _read(
    path: Path,
    given: ImportOptions,
    forms: Sequence[str],
    header: str,
    data: BytesIO | None = None,
    notes: tuple[str, ...] = (),
) -> OpenedTake:
    """Recording in a sound file of one of these forms, with midair's header if there is one.

    Full scale of another program's file is 1 of the given unit; with unit "count", PCM samples are integers. A stated
    rate that rounds to the file's whole one replaces it.
    """
    import soundfile

    with soundfile.SoundFile(path if data is None else data) as file:
        form, subtype, rate, promised = file.format, file.subtype, float(file.samplerate), file.frames
        if form not in forms or (forms == _WAV and subtype not in _READABLE):
            expected = "PCM, float or µ-law in a WAV" if forms == _WAV else f"one of {', '.join(forms)}"
            raise BrokenFileError(f"{path}: expected {expected}, got {form} with {subtype}")
        header = file.comment if form == "FLAC" and '"midair recording"' in file.comment else header
        samples: Any = file.read(dtype="float64", always_2d=True)
    # The decoder only estimates the length of an MP3.
    if form != "MP3" and len(samples) < promised:
        raise BrokenFileError(f"{path}: expected {promised} frames, got {len(samples)}; the file is truncated")
    if header:
        return own_take(header, samples, given, path)
    name, scale = "WAV" if forms == _WAV else form, 1.0
    full = f"1 {given.unit}" if given.scale is None else f"{given.scale:g} Pa"
    report = [f"Full scale of the {name} ({subtype}) was taken as {full}."]
    if given.unit == "count" and given.scale is None:
        scale, report[0] = _counts(subtype, path)
    if subtype in _LOSSY:
        report.append(f"{form} is lossy: it removes signals that people cannot hear but may feel.")
    return ImportedData(
        samples=samples * scale,
        form=name,
        rate=given.rate if given.rate is not None and round(given.rate) == rate else rate,
        settings={"subtype": subtype, "scale": scale},
        report=(*report, *notes),
    ).resolve(given, path)


def _counts(subtype: str, path: Path) -> tuple[float, str]:
    if subtype in _BITS:
        return 2.0 ** (_BITS[subtype] - 1), f"Samples are the integers of {subtype}."
    if subtype == "ULAW":
        unit: Unit = "V"
        raise UnitError(f'{path}: µ-law holds no counts; give the unit of full scale, such as unit="{unit}"')
    return 1.0, f"Samples of {subtype} were not scaled."


def _losses(form: str, recording: Recording, rate: int, exponent: int) -> Iterator[FormatLoss]:
    if rate != recording.rate:
        text = f"{form} holds integer rates: other programs read {rate} Hz for {recording.rate:.9g} Hz."
        yield FormatLoss(what="rate", text=text)
    text = f"Full scale is 2^{exponent} {recording.unit}: only midair reads this factor, the sensor and the provenance."
    yield FormatLoss(what="scale", text=text)
    if form == "FLAC":
        text = f"Samples are rounded to 24 bits, steps of {2.0 ** (exponent - 23):.3g} {recording.unit}."
        yield FormatLoss(what="waveform", text=text)


WAV = Format(name="WAV", read=read_wav, write=write_wav, memory=2)
RF64 = Format(name="RF64", read=read_wav, memory=2)


FLAC = Format(name="FLAC", read=read_sound, write=write_flac)
AIFF = Format(name="AIFF", read=read_sound)
OGG = Format(name="Ogg", read=read_sound)
MP3 = Format(name="MP3", read=read_sound)
