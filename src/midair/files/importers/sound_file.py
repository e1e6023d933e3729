"""Audio formats of libsndfile other than WAV: FLAC, AIFF, Ogg and MP3; one audio channel per cell, full scale 1."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from midair.errors import BrokenFileError
from midair.files.importers.wav_file import sound_of
from midair.files.opened_take import Format, ImportOptions, OpenedTake

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
