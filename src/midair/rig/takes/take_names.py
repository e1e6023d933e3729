"""Subject and file names of takes that belong together."""

import json
import re
import unicodedata
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from midair.devices import make_state_folder, state_folder
from midair.errors import InputError, MissingFileError
from midair.files import atomic_file
from midair.validation import Declared, documented, setting


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Subject(Declared):
    """Subject of a recording; empty fields are unknown."""

    object: str = setting(
        "", "Name of the object, such as towel; asked for on a terminal if missing.", typed=str | None
    )
    surface: str = setting("", "Sensor surface, such as flat or grooved.", typed=str | None)
    speed: str = setting("", "Speed of the stroke, such as 50mm/s.", unit="m/s", typed=float | None)
    operator: str = setting("", "Name of the person who records.", typed=str | None)

    @property
    def notes(self) -> dict[str, str]:
        """Known fields, for the notes of a recording."""
        return {name: value for name, value in asdict(self).items() if value}

    @property
    def stem(self) -> str:
        """Start of the file names: object-surface."""
        return "-".join(part for part in (slug(self.object), slug(self.surface)) if part) or "recording"


def slug(text: str) -> str:
    """Convert text to a part of a file name: lower-case letters and digits of any script, underscores for the rest."""
    small = unicodedata.normalize("NFKC", text).casefold()
    return re.sub(r"[^\w.]+|_+", "_", small).strip("_.")[:60]


def take_name(folder: Path, stem: str) -> Path:
    """Next name in a folder: ``stem-01.h5``, or one above the highest number; MissingFileError without the folder."""
    if not folder.is_dir():
        raise MissingFileError(f"{folder}: expected a folder for the recordings, found none; make it first")
    numbers = [
        int(found[1])
        for path in folder.iterdir()
        if (found := re.fullmatch(rf"{re.escape(stem)}-(\d+)\.h5", path.name))
    ]
    return folder / f"{stem}-{max(numbers, default=0) + 1:02d}.h5"


def take_path(output: Path | None, subject: Subject, *, repeats: int) -> Path:
    """Path of the next of `repeats` takes.

    `output` is a folder (the current one if None), in which the name is made from the subject; or the name of a single
    take, or the start of the names of several. InputError if the name does not end in .h5 or the file exists,
    MissingFileError if the folder does not.
    """
    if output is None or output.is_dir():
        return take_name(output or Path(), subject.stem)
    if output.suffix != ".h5":
        raise InputError(f"{output}: expected NAME.h5, or an existing folder")
    if repeats > 1:
        return take_name(output.parent, output.stem)
    if output.exists():
        raise InputError(f"{output}: is there already; give another name, or a folder for a new name")
    return output


def last_subject() -> Subject:
    """Subject of the last recording, as a default for prompts; an empty one if there is none."""
    try:
        stored = json.loads((state_folder() / "subject.json").read_text(encoding="utf-8"))
        return Subject(**{each.name: str(stored.get(each.name, "")) for each in fields(Subject)})
    # It is only a default for prompts, so read errors are ignored.
    except (OSError, ValueError, AttributeError, RecursionError):
        return Subject()


def store_subject(subject: Subject) -> None:
    """Store the subject as the default of later prompts; FileError if it cannot be stored."""
    path = make_state_folder() / "subject.json"
    with atomic_file(path) as partial:
        partial.write_text(json.dumps(asdict(subject)), encoding="utf-8")
