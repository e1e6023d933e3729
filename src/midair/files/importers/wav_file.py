"""WAV, and its 64-bit forms RF64 and Wave64: one audio channel a cell, full scale 1.

midair keeps its header in a chunk that other programs skip.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.errors import BrokenFileError, FileError, UnitError
from midair.files.atomic import check_room, whole_file
from midair.files.format_loss import FormatLoss, calibration_lost
from midair.files.importers.header import header_of, parse_header, recording_from
from midair.files.importers.riff import CHUNK, append_chunk, chunks, content
from midair.files.opened_take import Format, ImportedData, ImportOptions, OpenedTake, of_two
from midair.lazy_frames import LazyFrames, blocks, each_frame, moments
from midair.model import Calibration, Recording, Unit
from midair.validation import check_finite

if TYPE_CHECKING:
    import soundfile

_FORMATS = ("WAV", "WAVEX", "W64", "RF64")
_BITS = {"PCM_U8": 8, "PCM_16": 16, "PCM_24": 24, "PCM_32": 32}
_READABLE = (*_BITS, "FLOAT", "DOUBLE", "ULAW")


def write_wav(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[FormatLoss, ...]:
    """Write float64 below full scale: the samples over the power of two above their peak, so that none is rounded.

    Raises
    ------
    FileError
        If the sensor has more cells than a WAV has channels (1024), or there are more than 4 GB of samples.
    """
    import soundfile

    cells = recording.sensor.count
    if cells > 1024:
        raise FileError(f"{path}: a WAV holds up to 1024 channels, got a sensor of {cells}; save to .h5")
    # Lengths have 32 bits; a megabyte is left for the header and midair's chunk.
    if recording.samples.nbytes > 2**32 - 2**20:
        raise FileError(f"{path}: a WAV holds less than 4 GB, got {recording.samples.nbytes} bytes; save to .h5")
    # A WAV has whole rates; midair's header keeps the exact one.
    rate = max(1, round(recording.rate))
    exponent = int(np.frexp(moments(recording.samples).largest)[1])
    with whole_file(path) as partial:
        check_room(partial.parent, recording.samples.nbytes, path)
        with soundfile.SoundFile(partial, "w", rate, cells, subtype="DOUBLE", format="WAV") as file:
            for block in blocks(recording.samples):
                file.write(np.ldexp(block, -exponent).reshape(len(block), cells))
        append_chunk(partial, header_of(recording, scale_exponent=exponent).encode("ascii"))
    return (*_losses(recording, rate, exponent), *calibration_lost(calibration, "WAV"))


def read_wav(path: Path, given: ImportOptions) -> OpenedTake:
    """The recording in a WAV of midair, or of another program, also as RF64 or Wave64.

    PCM of 8, 16, 24 or 32 bits, float32, float64 and µ-law are read.

    Full scale of another program's file is 1 of the given unit; with unit "count", PCM samples are its whole numbers.

    Raises
    ------
    BrokenFileError
        If the header is wrong or samples are missing.
    InputError
        Its leaf, if the file does not say enough or a number cannot be used.
    """
    import soundfile

    held = chunks(path)
    header = next((content(path, chunk) for chunk in held if chunk.letters == CHUNK), None)
    with soundfile.SoundFile(path) as file:
        subtype, rate = file.subtype, file.samplerate
        if file.format not in _FORMATS or subtype not in _READABLE:
            raise BrokenFileError(f"{path}: expected PCM, float or µ-law in a WAV, got {file.format} with {subtype}")
        samples: Any = _reel(path, file) if given.streamed else file.read(dtype="float64", always_2d=True)
    if header is None:
        return sound_of(samples, subtype, float(rate), given, path).settle(given, path)
    parsed = parse_header(header.decode("ascii"), path)
    exponent = parsed["scale_exponent"]
    recording = recording_from(parsed, each_frame(samples, lambda block: np.ldexp(block, exponent), exact=True), path)
    given.check(recording, path)
    return OpenedTake(recording=recording)


def _reel(path: Path, file: "soundfile.SoundFile") -> LazyFrames:
    """The samples of an open file, read from it when somebody asks for them."""
    import soundfile

    def read(first: int, last: int) -> np.ndarray:
        with soundfile.SoundFile(path) as again:
            again.seek(first)
            block = again.read(last - first, dtype="float64", always_2d=True)
        if len(block) < last - first:
            raise BrokenFileError(f"{path}: expected frames {first} to {last}, got {len(block)}; the file was cut")
        check_finite(block, "samples", frame=first)
        return block

    # A float32 has 24 bits of digits; µ-law has 14.
    fits = file.subtype in ("FLOAT", "PCM_U8", "PCM_16", "PCM_24", "ULAW")
    return LazyFrames(read, (file.frames, file.channels), stored="f4" if fits else "f8")


def sound_of(
    samples: Any, subtype: str, rate: float, given: ImportOptions, path: Path, *, form: str = "WAV"
) -> ImportedData:
    """What a sound file says: samples below full scale, and its rate, of which it holds the nearest whole number.

    Parameters
    ----------
    samples : ndarray or Reel, shape (frame, channel)
        As a part of full scale.
    subtype : str
        As libsndfile calls it.
    rate : float
        That the file says, in Hz; the one given may be the exact one.
    given : Given
        What a person stated.
    path : Path
        For messages.
    form : str
        What to call the format.
    """
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
        return 2.0 ** (_BITS[subtype] - 1), f"Samples are the whole numbers of {subtype}."
    if subtype == "ULAW":
        unit: Unit = "V"
        raise UnitError(
            f'{path}: µ-law holds no counts; give the unit that full scale stands for, such as unit="{unit}"'
        )
    return 1.0, f"Samples are taken from {subtype} as they are."


def _losses(recording: Recording, rate: int, exponent: int) -> tuple[FormatLoss, ...]:
    text = f"Full scale is 2^{exponent} {recording.unit}: only midair reads that, and the sensor and the provenance."
    scale = FormatLoss(what="scale", text=text)
    if rate == recording.rate:
        return (scale,)
    text = f"WAV holds whole rates: others than midair read {rate} Hz for {recording.rate:.9g} Hz."
    return (FormatLoss(what="rate", text=text), scale)


WAV = Format(name="WAV", read=read_wav, write=write_wav)
WAVE64 = Format(name="Wave64", read=read_wav)
RF64 = Format(name="RF64", read=read_wav)
