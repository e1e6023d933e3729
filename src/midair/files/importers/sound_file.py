"""Sound files (WAV, RF64, FLAC, AIFF, Ogg, MP3): one audio channel per cell, full scale 1.

RIFF: Multimedia Programming Interface and Data Specifications 1.0 (IBM and Microsoft, 1991): a chunk is four letters,
the length of its content as a little-endian uint32, and the content, padded to an even length. RF64 (ITU-R BS.2088): as
RIFF, but the length of the samples is a uint64 in the first chunk, ds64.
"""

import re
import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from midair.errors import BrokenFileError, FileError, UnitError
from midair.files.atomic import atomic_file
from midair.files.opened_take import Format, FormatLoss, ImportedData, ImportOptions
from midair.model import Recording, Unit
from midair.streaming import blocks

_LONG = 0xFFFFFFFF
_WAV = ("WAV", "WAVEX", "RF64")
_FORMATS = ("FLAC", "AIFF", "OGG", "MP3")
_LOSSY = {"VORBIS", "OPUS", "MPEG_LAYER_I", "MPEG_LAYER_II", "MPEG_LAYER_III"}
_BITS = {"PCM_U8": 8, "PCM_16": 16, "PCM_24": 24, "PCM_32": 32}
_READABLE = (*_BITS, "FLOAT", "DOUBLE", "ULAW")


def write_wav(recording: Recording, path: Path) -> tuple[FormatLoss, ...]:
    """Write float64 without rounding; at most 1024 cells and 4 GB."""
    if (cells := recording.sensor.count) > 1024:
        raise FileError(f"{path}: a WAV holds up to 1024 channels, got a sensor of {cells}; save to .h5")
    # Lengths have 32 bits; 1 MB is reserved for the header.
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
    """Write the samples divided by the power of two above the peak."""
    import soundfile

    rate, most = max(1, round(recording.rate)), 2**23 - 1
    exponent = int(np.frexp(np.abs(recording.samples).max())[1])
    subtype = "DOUBLE" if form == "WAV" else "PCM_24"
    form_of: Any = {"samplerate": rate, "channels": recording.sensor.count, "subtype": subtype, "format": form}
    with atomic_file(path) as partial, soundfile.SoundFile(partial, "w", **form_of) as file:
        if recording.provenance.simulated:
            file.comment = "SIMULATED"
        for block in blocks(recording.samples):
            part = np.ldexp(block, -exponent).reshape(len(block), -1)
            if form == "FLAC":
                # The upper 24 of 32 bits, since libsndfile would multiply numbers by 2^23 - 1.
                part = np.clip(np.rint(part * 2**23), -most, most).astype(np.int32) << 8
            file.write(part)
    return tuple(_losses(form, recording, rate, exponent))


def read_wav(path: Path, given: ImportOptions) -> ImportedData:
    """Read a WAV or RF64 file: PCM of 8 to 32 bits, float32, float64 or µ-law.

    A program that writes to a pipe, or is cut off, cannot state the length of the samples: if it is 0, or 2^31 - 2^10
    bytes or more and more than the file has, they reach to its end.
    """
    data = path.read_bytes()
    if data[:4] not in (b"RIFF", b"RF64") or data[8:12] != b"WAVE":
        raise BrokenFileError(f"expected a WAV file, got one that begins with {data[:12].decode('latin-1')!r}")
    place, letters, length = 12, b"", 0
    while letters != b"data":
        if len(data) < place + 8:
            raise BrokenFileError(f"expected samples, got a file that ends in chunk {letters.decode('latin-1')!r}")
        letters, length = struct.unpack_from("<4sI", data, place)
        place += 8 + (0 if letters == b"data" else length + length % 2)
    if length == _LONG and data[:4] == b"RF64":
        (length,) = struct.unpack_from("<Q", data, 28)
    rest = len(data) - place
    if rest < length < 2**31 - 2**10:
        raise BrokenFileError(f"expected {length} bytes of samples, got {rest}; the file is truncated")
    if rest < length or (not length and not re.match(rb"[\w ]{4}|$", data[place:])):
        stated = struct.pack("<I", min(rest, _LONG))
        return _read(
            path,
            given,
            BytesIO(data[: place - 4] + stated + data[place:]),
            "The length of the samples was not stated: the file was read to its end.",
        )
    return _read(path, given, BytesIO(data))


def read_sound(path: Path, given: ImportOptions) -> ImportedData:
    """Read a FLAC, AIFF, Ogg (Vorbis, Opus) or MP3 file."""
    return _read(path, given)


def _read(path: Path, given: ImportOptions, wav: BytesIO | None = None, *notes: str) -> ImportedData:
    """Recording in a sound file, or in the content of a WAV.

    Full scale is 1 of the given unit; with unit "count", PCM samples are integers. A stated rate that rounds to the
    file's whole one replaces it.
    """
    import soundfile

    with soundfile.SoundFile(wav or path) as file:
        form, subtype, rate, promised = file.format, file.subtype, float(file.samplerate), file.frames
        if form not in (_WAV if wav else _FORMATS) or (wav and subtype not in _READABLE):
            expected = "PCM, float or µ-law in a WAV" if wav else f"one of {', '.join(_FORMATS)}"
            raise BrokenFileError(f"expected {expected}, got {form} with {subtype}")
        simulated = file.comment == "SIMULATED"
        samples: Any = file.read(dtype="float64", always_2d=True)
    # The decoder only estimates the length of an MP3.
    if form != "MP3" and len(samples) < promised:
        raise BrokenFileError(f"expected {promised} frames, got {len(samples)}; the file is truncated")
    name, scale = "WAV" if wav else form, 1.0
    full = f"1 {given.unit}" if given.scale is None else f"{given.scale:g} Pa"
    report = [f"Full scale of the {name} ({subtype}) was taken as {full}."]
    if given.unit == "count" and given.scale is None:
        scale, report[0] = _counts(subtype)
    if subtype in _LOSSY:
        report.append(f"{form} is lossy: it removes signals that people cannot hear but may feel.")
    return ImportedData(
        samples=samples * scale,
        form=name,
        rate=given.rate if given.rate is not None and round(given.rate) == rate else rate,
        settings={"subtype": subtype, "scale": scale},
        simulated=simulated,
        report=(*report, *notes),
    )


def _counts(subtype: str) -> tuple[float, str]:
    if subtype in _BITS:
        return 2.0 ** (_BITS[subtype] - 1), f"Samples are the integers of {subtype}."
    if subtype == "ULAW":
        unit: Unit = "V"
        raise UnitError(f'µ-law holds no counts; give the unit of full scale, such as unit="{unit}"')
    return 1.0, f"Samples of {subtype} were not scaled."


def _losses(form: str, recording: Recording, rate: int, exponent: int) -> Iterator[FormatLoss]:
    if rate != recording.rate:
        text = f"{form} holds integer rates: other programs read {rate} Hz for {recording.rate:.9g} Hz."
        yield FormatLoss(what="rate", text=text)
    text = f"Samples are stored from -1 to 1; multiply them by {2.0**exponent:g} to get {recording.unit}."
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
