"""Pictures and sounds of a study: copied when the plan is drawn, then identified by their SHA-256."""

import shutil
from collections.abc import Mapping
from pathlib import Path

from midair.errors import BrokenFileError, FileError, MissingFileError
from midair.study.design import Design
from midair.study.drives import digest_of_file

LARGEST = 20_000_000
"""Largest file, in bytes."""


def prepare_media(design: Design, into: Path, *, found_in: Path | None) -> dict[str, str]:
    """Copy every picture and sound of a design from a folder into another one; return the SHA-256 of each.

    Raises MissingFileError if a file does not exist, or no folder is given; FileError if a file is larger than
    `LARGEST`; BrokenFileError if a file is no picture or no sound.
    """
    digests: dict[str, str] = {}
    for one in design.stimuli:
        if one.kind not in ("picture", "sound") or one.source in digests:
            continue
        if found_in is None or not (found := found_in / one.source).is_file():
            raise MissingFileError(
                f"{one.source}: expected the {one.kind} in {found_in or 'a folder'}, found none; put it beside the"
                " TOML, or name its folder with --drives"
            )
        if (size := found.stat().st_size) > LARGEST:
            raise FileError(f"{one.source}: expected at most {LARGEST / 1e6:g} MB, got {size / 1e6:.1f} MB; reduce it")
        _ = sound_duration(found) if one.kind == "sound" else _check_picture(found)
        target = into / one.source
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(found, target)
        target.chmod(0o600)
        digests[one.source] = digest_of_file(target)
    return digests


def sound_duration(path: Path) -> float:
    """Duration of a sound file in s; raises BrokenFileError if it is none."""
    import soundfile

    try:
        return float(soundfile.info(path).duration)
    except soundfile.LibsndfileError as wrong:
        raise BrokenFileError(f"{path.name}: expected a sound such as WAV, FLAC or MP3, got: {wrong}") from wrong


def media_type(path: Path) -> str:
    """Type of a picture or sound by its ending, such as ``image/png``; empty for other files."""
    return _TYPES.get(path.suffix.lower(), "")


_TYPES: Mapping[str, str] = {
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".webp": "image/webp",
    ".wav": "audio/wav",
    ".flac": "audio/flac",
    ".mp3": "audio/mpeg",
    ".ogg": "audio/ogg",
}


def _check_picture(path: Path) -> None:
    from PIL import Image

    try:
        with Image.open(path) as picture:
            picture.verify()
    except (OSError, SyntaxError) as wrong:
        raise BrokenFileError(f"{path.name}: expected a picture, got: {wrong}") from wrong
