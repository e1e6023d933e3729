"""Drives, pictures and sounds of a study: copied or solved when the plan is drawn, then identified by SHA-256."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path, PurePath
from typing import Literal

from midair.errors import BrokenFileError, FileError, MismatchError, MissingFileError
from midair.files import OpenedTake, load_solution, read_toml
from midair.model import Progress, TransducerArray
from midair.patterns import draw_file, load_pattern
from midair.rig import VirtualRig, pressure_to_solve, record, sensor_named, solve_to_file
from midair.settings import MODES, Mode, Settings
from midair.study.design.question import Stimulus
from midair.study.design.study_design import Design

ENDING = ".drive.h5"
Stage = Callable[[str], Progress | None]
"""Function of the name of a step that returns its progress callback."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyDrive:
    """One prepared drive of a study."""

    source: str
    """File name in the plan."""
    how: Literal["found", "drawn", "solved", "virtual"]
    """A copied drive; a drive of a pattern, of a recording, of a virtual stroke."""
    duration: float
    """In s."""
    digest: str
    """SHA-256 of the file."""


def digest_of_file(path: Path) -> str:
    """SHA-256 of a file, 64 hexadecimal digits; raises MissingFileError if it does not exist."""
    try:
        with path.open("rb") as file:
            return file_digest(file, "sha256").hexdigest()
    except FileNotFoundError as wrong:
        raise MissingFileError(
            f"{path.name}: expected the drive in the folder of the study, the file does not exist; copy it back"
        ) from wrong


def prepare_drives(
    design: Design,
    into: Path,
    *,
    found_in: Path | None,
    settings: Settings | None = None,
    mode: Mode = "quick",
    seed: int = 0,
    stage: Stage = lambda _: None,
) -> list[StudyDrive]:
    """Put every drive of a design into a folder: copied, drawn, solved from a recording, or from a virtual stroke.

    `found_in` is a folder of drives, patterns or recordings: if ``felt.drive.h5`` is missing, or older than
    ``felt.toml``, that pattern is drawn, or else ``felt.h5`` solved. If None, the
    virtual sources of the stimuli (`made_from`) are used, with `seed` for strokes and sensor. `settings` of the solver
    are by default those of `mode`, at 1 kHz for virtual strokes. `stage` receives the name of each step and returns its
    progress callback. Raises MissingFileError, which names them, if drives have no source; BrokenFileError if a file is
    no drive, or silent in all frames; MismatchError if drives are for different arrays.
    """
    drives = [one for one in design.stimuli if one.kind == "drive"]
    # If several stimuli share a drive, the one with `made_from` is used.
    wanted = {one.source: one for one in sorted(drives, key=lambda one: bool(one.made_from))}
    missing = [
        source
        for source, one in sorted(wanted.items())
        if _find_source(source, found_in) is None and not (found_in is None and one.made_from)
    ]
    if missing:
        where, stem = f"in {found_in}" if found_in else "in a folder", missing[0].removesuffix(ENDING)
        raise MissingFileError(
            f"drives: expected {', '.join(missing)} {where} (or patterns, {stem}.toml, or recordings, {stem}.h5 and so"
            " on), found none; give their folder with --drives, or --drives none for a plan that is only simulated"
        )
    gathered: list[StudyDrive] = []
    for source, stimulus in sorted(wanted.items()):
        target = into / source
        target.parent.mkdir(parents=True, exist_ok=True)
        found = _find_source(source, found_in)
        how: Literal["found", "drawn", "solved", "virtual"]
        if found is not None and found.name == Path(source).name:
            how = "found"
            shutil.copyfile(found, target)
        elif found is not None and found.suffix == ".toml":
            how, foci = "drawn", load_pattern(found).foci()
            draw_file(foci, found, target, TransducerArray.autd3(), progress=stage(source))
        elif found is not None:
            how, chosen = "solved", settings or MODES[mode]()
            _solve(found, chosen, target, stage(source))
        else:
            # At 4 kHz a simulated drive would take four times as long and four times the disk space.
            how, chosen = "virtual", settings or MODES[mode]().but(rate=1000.0)
            rig = VirtualRig(seed=seed, height=chosen.target.grid.height)
            with sensor_named(stimulus.made_from, rig) as touched:
                take = record(touched, 1.28 if "am-" not in stimulus.made_from else 0.5)
            _solve(take, chosen, target, stage(source))
        target.chmod(0o600)
        gathered.append(StudyDrive(source=source, how=how, duration=_duration(target), digest=digest_of_file(target)))
    arrays = {
        path.name: load_solution(path, streamed=True).drive.array for path in (into / one.source for one in gathered)
    }
    first = next(iter(arrays.values()), None)
    for name, array in arrays.items():
        if first is not None and (array.name, array.count) != (first.name, first.count):
            raise MismatchError(
                f"{name}: expected a drive for {first.name} with {first.count} transducers like the others, got one "
                f"for {array.name} with {array.count}; solve all drives for one array"
            )
    return gathered


def _solve(take: OpenedTake | Path, settings: Settings, target: Path, progress: Progress | None) -> None:
    solve_to_file(pressure_to_solve(take, settings), TransducerArray.autd3(), settings, target, progress=progress)


def check_digests(folder: Path, drives: Mapping[str, str], stimuli: tuple[Stimulus, ...]) -> None:
    """Check that every drive is the one for which the plan was drawn.

    Raises MissingFileError if the plan was drawn without drives, or a drive is missing; MismatchError if a drive was
    changed after the plan was drawn.
    """
    for source, kind in {one.source: one.kind for one in stimuli if one.kind in ("drive", "picture", "sound")}.items():
        if source not in drives:
            raise MissingFileError(
                f"{source}: expected a plan with drives, got one drawn without; run it with --simulate only, or"
                " draw a new one: `midair study new NAME --drives FOLDER`"
            )
        if (found := digest_of_file(folder / source)) != drives[source]:
            raise MismatchError(
                f"{source}: expected the {kind} of the plan (SHA-256 {drives[source][:12]}), got {found[:12]}; the file"
                " was changed after the plan was drawn: copy it back"
            )


def _find_source(source: str, folder: Path | None) -> Path | None:
    """Drive, pattern or recording of a source in a folder; a drive that is older than its pattern is passed over."""
    if folder is None:
        return None
    stem = source.removesuffix(ENDING)
    ready, pattern, recording = (folder / name for name in (source, f"{stem}.toml", f"{stem}.h5"))
    there = [path for path in (ready, pattern, recording) if path.is_file()]
    if pattern in there and "spot" not in read_toml(pattern, "a pattern"):
        there.remove(pattern)  # the study itself, or another table
    if there[:2] == [ready, pattern] and ready.stat().st_mtime < pattern.stat().st_mtime:
        return pattern
    return there[0] if there else None


def _duration(path: Path) -> float:
    """Duration of a drive in s; raises BrokenFileError if all its frames are silent."""
    solution = load_solution(path, streamed=True)
    if not solution.plays.any():
        raise BrokenFileError(f"{path.name}: expected a drive with sound, got silence in all frames; solve it again")
    return solution.drive.frames / solution.drive.rate


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


def media_type(path: PurePath) -> str:
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
