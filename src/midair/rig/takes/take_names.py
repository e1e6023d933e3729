"""Takes that belong together: what is recorded, told once, and the names of the files."""

import json
import re
import unicodedata
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from midair.devices import make_state_folder, state_folder
from midair.errors import InputError, MissingFileError
from midair.files import whole_file


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """What is recorded, and by whom.

    Attributes
    ----------
    object, surface : str
        Such as towel and grooved; empty where nobody said.
    speed : str
        Speed of the stroke, with its unit, such as 50mm/s.
    operator : str
        The person who records.
    """

    object: str = ""
    surface: str = ""
    speed: str = ""
    operator: str = ""

    @property
    def notes(self) -> dict[str, str]:
        """What is known, for the notes of a recording."""
        return {name: value for name, value in asdict(self).items() if value}

    @property
    def stem(self) -> str:
        """Beginning of the names of its files: object-surface."""
        return "-".join(part for part in (slug(self.object), slug(self.surface)) if part) or "recording"


def slug(text: str) -> str:
    """`text` as a part of a file's name: small letters and digits of any script, the rest as single underscores."""
    small = unicodedata.normalize("NFKC", text).casefold()
    return re.sub(r"[^\w.]+|_+", "_", small).strip("_.")[:60]


def take_name(folder: Path, stem: str) -> Path:
    """The next name in a folder: ``stem-01.h5``, or one more than the highest number that is there.

    Raises
    ------
    MissingFileError
        If there is no such folder.
    """
    if not folder.is_dir():
        raise MissingFileError(f"{folder}: expected a folder for the recordings, found none; make it first")
    numbers = [
        int(found[1])
        for path in folder.iterdir()
        if (found := re.fullmatch(rf"{re.escape(stem)}-(\d+)\.h5", path.name))
    ]
    return folder / f"{stem}-{max(numbers, default=0) + 1:02d}.h5"


def take_path(output: Path | None, subject: Subject, *, repeats: int) -> Path:
    """Where the next take goes.

    Parameters
    ----------
    output : Path, optional
        A folder, this one if None: names are made of the subject. Or the name of the one take, or the beginning of the
        names of several.
    subject : Subject
        What is recorded.
    repeats : int
        How many takes there will be.

    Raises
    ------
    InputError
        If the name does not end in .h5, or somebody has it.
    MissingFileError
        If its folder is not there.
    """
    if output is None or output.is_dir():
        return take_name(output or Path(), subject.stem)
    if output.suffix != ".h5":
        raise InputError(f"{output}: expected NAME.h5, or a folder that is there")
    if repeats > 1:
        return take_name(output.parent, output.stem)
    if output.exists():
        raise InputError(f"{output}: is there already; give another name, or a folder, to have a new one made")
    return output


def remembered() -> Subject:
    """The subject that was recorded last, to offer when somebody is asked; an empty one if there is none."""
    try:
        stored = json.loads((state_folder() / "subject.json").read_text(encoding="utf-8"))
        return Subject(**{each.name: str(stored.get(each.name, "")) for each in fields(Subject)})
    # Only offered as an answer: what cannot be read is left out in silence.
    except (OSError, ValueError, AttributeError, RecursionError):
        return Subject()


def remember(subject: Subject) -> None:
    """Keep the subject for the next time somebody is asked.

    Raises
    ------
    FileError
        If there is no place to keep it.
    """
    path = make_state_folder() / "subject.json"
    with whole_file(path) as partial:
        partial.write_text(json.dumps(asdict(subject)), encoding="utf-8")
