"""Sound files (WAV, RF64, Wave64, FLAC, AIFF, Ogg, MP3): one audio channel per cell, full scale 1.

midair writes WAV and stores its header in a chunk that other programs skip.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.errors import BrokenFileError, FileError, UnitError
from midair.files.atomic import atomic_file, check_disk_space
from midair.files.importers.header import header_of, parse_header, recording_from
from midair.files.importers.riff import CHUNK, append_chunk, chunks, content
from midair.files.opened_take import (
    Format,
    FormatLoss,
    ImportedData,
    ImportOptions,
    OpenedTake,
    calibration_lost,
    of_two,
)
from midair.model import Calibration, Recording, Unit
from midair.streaming import LazyFrames, blocks, each_frame, moments
from midair.validation import check_finite

if TYPE_CHECKING:
    import soundfile


_WAV = ("WAV", "WAVEX", "W64", "RF64")
_BITS = {"PCM_U8": 8, "PCM_16": 16, "PCM_24": 24, "PCM_32": 32}
_READABLE = (*_BITS, "FLOAT", "DOUBLE", "ULAW")


def write_wav(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[FormatLoss, ...]:
    """Write float64 divided by the power of two above the peak, without rounding; at most 1024 cells and 4 GB."""
    import soundfile

    cells = recording.sensor.count
    if cells > 1024:
        raise FileError(f"{path}: a WAV holds up to 1024 channels, got a sensor of {cells}; save to .h5")
    # Lengths have 32 bits; 1 MB is reserved for the header and midair's chunk.
    if recording.samples.nbytes > 2**32 - 2**20:
        raise FileError(f"{path}: a WAV holds less than 4 GB, got {recording.samples.nbytes} bytes; save to .h5")
    # Rates in WAV are integers; midair's header stores the exact rate.
    rate = max(1, round(recording.rate))
    exponent = int(np.frexp(moments(recording.samples).largest)[1])
    with atomic_file(path) as partial:
        check_disk_space(partial.parent, recording.samples.nbytes, path)
        with soundfile.SoundFile(partial, "w", rate, cells, subtype="DOUBLE", format="WAV") as file:
            for block in blocks(recording.samples):
                file.write(np.ldexp(block, -exponent).reshape(len(block), cells))
        append_chunk(partial, header_of(recording, scale_exponent=exponent).encode("ascii"))
    return (*_losses(recording, rate, exponent), *calibration_lost(calibration, "WAV"))


def read_wav(path: Path, given: ImportOptions) -> OpenedTake:
    """Read a WAV, RF64 or Wave64 file of midair or of another program: PCM of 8 to 32 bits, float32, float64 or µ-law.

    Full scale of another program's file is 1 of the given unit; with unit "count", PCM samples are integers.
    """
    import soundfile

    held = chunks(path)
    header = next((content(path, chunk) for chunk in held if chunk.letters == CHUNK), None)
    with soundfile.SoundFile(path) as file:
        subtype, rate = file.subtype, file.samplerate
        if file.format not in _WAV or subtype not in _READABLE:
            raise BrokenFileError(f"{path}: expected PCM, float or µ-law in a WAV, got {file.format} with {subtype}")
        samples: Any = _lazy_samples(path, file) if given.streamed else file.read(dtype="float64", always_2d=True)
    if header is None:
        return sound_of(samples, subtype, float(rate), given, path).resolve(given, path)
    parsed = parse_header(header.decode("ascii"), path)
    exponent = parsed["scale_exponent"]
    recording = recording_from(parsed, each_frame(samples, lambda block: np.ldexp(block, exponent), exact=True), path)
    given.check(recording, path)
    return OpenedTake(recording=recording)


def _lazy_samples(path: Path, file: "soundfile.SoundFile") -> LazyFrames:
    """Lazy samples of a file, which is opened again for each read."""
    import soundfile

    def read(first: int, last: int) -> np.ndarray:
        with soundfile.SoundFile(path) as again:
            again.seek(first)
            block = again.read(last - first, dtype="float64", always_2d=True)
        if len(block) < last - first:
            raise BrokenFileError(f"{path}: expected frames {first} to {last}, got {len(block)}; the file is truncated")
        check_finite(block, "samples", frame=first)
        return block

    # float32 has 24 significant bits; µ-law has 14.
    fits = file.subtype in ("FLOAT", "PCM_U8", "PCM_16", "PCM_24", "ULAW")
    return LazyFrames(read, (file.frames, file.channels), stored="f4" if fits else "f8")


def sound_of(
    samples: Any, subtype: str, rate: float, given: ImportOptions, path: Path, *, form: str = "WAV"
) -> ImportedData:
    """Data of a sound file from its samples (frame, channel); a rate in `given` that rounds to `rate` replaces it."""
    exact = given.rate if given.rate is not None and round(given.rate) == rate else rate
    full = f"1 {given.unit}" if given.scale is None else f"{given.scale:g} Pa"
    scale, remark = 1.0, f"Full scale of the {form} ({subtype}) was taken as {full}."
    if given.unit == "count" and given.scale is None:
        scale, remark = _counts(subtype, path)
    return ImportedData(
        samples=each_frame(samples, lambda block: block * scale, exact=of_two(scale)),
        form=form,
        rate=exact,
        settings={"subtype": subtype, "scale": scale},
        report=(remark,),
    )


def _counts(subtype: str, path: Path) -> tuple[float, str]:
    if subtype in _BITS:
        return 2.0 ** (_BITS[subtype] - 1), f"Samples are the integers of {subtype}."
    if subtype == "ULAW":
        unit: Unit = "V"
        raise UnitError(f'{path}: µ-law holds no counts; give the unit of full scale, such as unit="{unit}"')
    return 1.0, f"Samples of {subtype} were not scaled."


def _losses(recording: Recording, rate: int, exponent: int) -> tuple[FormatLoss, ...]:
    text = f"Full scale is 2^{exponent} {recording.unit}: only midair reads this factor, the sensor and the provenance."
    scale = FormatLoss(what="scale", text=text)
    if rate == recording.rate:
        return (scale,)
    text = f"WAV holds integer rates: other programs read {rate} Hz for {recording.rate:.9g} Hz."
    return (FormatLoss(what="rate", text=text), scale)


WAV = Format(name="WAV", read=read_wav, write=write_wav)
WAVE64 = Format(name="Wave64", read=read_wav)
RF64 = Format(name="RF64", read=read_wav)


_FORMATS = ("FLAC", "AIFF", "OGG", "MP3")
_LOSSY = {"VORBIS", "OPUS", "MPEG_LAYER_I", "MPEG_LAYER_II", "MPEG_LAYER_III"}


def read_sound(path: Path, given: ImportOptions) -> OpenedTake:
    """Read a FLAC, AIFF, Ogg (Vorbis, Opus) or MP3 file; full scale is 1 of the given unit, or integers for "count"."""
    import soundfile

    with soundfile.SoundFile(path) as file:
        form, subtype, rate, promised = file.format, file.subtype, float(file.samplerate), file.frames
        if form not in _FORMATS:
            raise BrokenFileError(f"{path}: expected one of {', '.join(_FORMATS)}, got {form}")
        samples: Any = file.read(dtype="float64", always_2d=True)
    # The decoder only estimates the length of an MP3.
    if form != "MP3" and len(samples) < promised:
        raise BrokenFileError(f"{path}: expected {promised} frames, got {len(samples)}; the file is truncated")
    found = sound_of(samples, subtype, rate, given, path, form=form)
    if subtype in _LOSSY:
        lossy = f"{form} is lossy: it removes signals that people cannot hear but may feel."
        found = replace(found, report=(*found.report, lossy))
    return found.resolve(given, path)


FLAC = Format(name="FLAC", read=read_sound)
AIFF = Format(name="AIFF", read=read_sound)
OGG = Format(name="Ogg", read=read_sound)
MP3 = Format(name="MP3", read=read_sound)
