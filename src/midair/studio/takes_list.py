"""The takes of the studio's folder and the samples, with the files that belong to each."""

import re
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from glob import escape
from pathlib import Path
from typing import Any

from midair.errors import InputError
from midair.files import atomic_file, check_not_recording
from midair.settings import MODES
from midair.studio.folders import BIN, StudioFolder
from midair.studio.solved_sample import SOLVED
from midair.studio.take_data import TakeData

SAMPLE, DRAWN = "sample:", "drawn:"
"""Prefixes of the names of samples and of patterns that are not saved, which are not files of the folder."""

_ENDINGS = (".drive.h5", ".rerecorded.h5", ".calibration.h5", ".array.h5")
"""Endings of files that are not takes."""

NOTES = ".notes.json"
"""Ending of the file with the notes on a take."""

_BESIDE = (".drive.h5", ".rerecorded.h5", ".report.html", NOTES)
"""Endings of the files that are made from a take."""

Stamps = Mapping[str, str]
"""Modification times by the name of a file."""

_LABEL = re.compile(rf"(.+)([@.])((?:{'|'.join(MODES)})(?:-\d+)?)")
"""A name with the label of a further drive: ``NAME@paper`` of a take, ``NAME.paper`` of the files beside it."""

SAMPLES = (SOLVED, "towel", "brush", "sponge")
"""Samples in the order in which they are shown; the first comes solved."""

_IMPORTED = (".csv", ".wav", ".npz", ".npy", ".mat")
"""Endings of takes of other programs."""


@dataclass(frozen=True, slots=True)
class TakesList:
    """The takes of a studio."""

    folder: StudioFolder
    """Folder that the user opened."""
    samples: Path
    """Folder of this session for samples and derived files; removed when the studio ends."""

    def rows(self) -> list[dict[str, Any]]:
        """Return one row per take, samples last; the row has those of its further drives."""
        # One look at each folder: asking for each file takes a third of a second with 1,000 takes.
        own, session = self.folder.stamps(within=True), StudioFolder(self.samples).stamps()
        takes = [name for name in own if name.endswith(".h5") and not name.endswith(_ENDINGS)]
        takes += [name for ending in _IMPORTED for name in own if name.endswith(ending) and "/" not in name]
        labels = _labels(own)
        rows = [self._row(name, name, own, session, labels) for name in takes]
        labels, samples = _labels(session), [name for name in (f"{each}.h5" for each in SAMPLES) if name in session]
        return [*rows, *(self._row(SAMPLE + name[:-3], name, session, session, labels) for name in samples)]

    def drives(self, name: str) -> list[str]:
        """Return the names under which the drives of a take are opened: ``NAME``, ``NAME@paper``."""
        take, drive = take_of(name), self.beside(take_of(name), ".drive.h5")
        stem = drive.name.removesuffix(".drive.h5")
        names = [path.name for path in drive.parent.glob(f"{escape(stem)}.*.drive.h5")]
        labels = sorted(_labels(names).get(stem, []))
        return [*([take] if drive.exists() else []), *(f"{take}@{label}" for label in labels)]

    def free_drive(self, name: str, mode: str) -> str:
        """Return the name of a further drive of a mode that does not exist yet."""
        number, take = 1, take_of(name)
        while self.beside(found := f"{take}@{mode}" + (f"-{number}" if number > 1 else ""), ".drive.h5").exists():
            number += 1
        return found

    def path(self, name: str) -> Path:
        """Return the path of a recording; InputError or MissingFileError if the name is not valid."""
        name = take_of(name)
        if name.startswith(SAMPLE):
            paths = [self.samples / f"{each}.h5" for each in SAMPLES]
            found = {SAMPLE + path.stem: path for path in paths if path.exists()}
            if name not in found:
                raise InputError(f"take: expected one of {', '.join(found) or 'no samples yet'}, got {name[:80]!r}")
            return found[name]
        if name.startswith(DRAWN):
            return StudioFolder(self.samples / "drawn").find(name.removeprefix(DRAWN))
        return self.folder.find(name)

    @property
    def incoming_files(self) -> StudioFolder:
        """Folder of the uploaded files that are to be imported, each in a folder of its own."""
        return StudioFolder.at(self.samples / "incoming")

    def beside(self, name: str, ending: str) -> Path:
        """Return the path of a file that belongs to a take (drive, re-recording, report), existing or not."""
        path = self.path(name)
        others = (path.with_suffix(kind) for kind in (".h5", *_IMPORTED) if kind != path.suffix)
        # If several takes have one stem, the others keep their suffix.
        own = path.suffix != ".h5" and any(other.exists() for other in others)
        label = name.removeprefix(take_of(name)).replace("@", ".")
        return path.with_name((path.name if own else path.name.removesuffix(path.suffix)) + label + ending)

    def family(self, name: str) -> dict[Path, str]:
        """Return the existing files of a take of the folder, and the ending that each adds to the take's stem."""
        if name.startswith(SAMPLE):
            raise InputError(f"{name}: expected a take of the folder, got a sample, which stays as it is")
        path, take = self.path(name), take_of(name)
        check_not_recording(path)
        labels = ["", *(each.removeprefix(take).replace("@", ".") for each in self.drives(name) if each != take)]
        names = [label + ending for label in labels for ending in _BESIDE]
        others = {self.beside(take, ending): ending for ending in names}
        return {path: path.suffix} | {other: ending for other, ending in others.items() if other.exists()}

    def rename(self, name: str, stem: str) -> str:
        """Give a take and the files beside it another name; returns it. InputError if one of the names is taken."""
        moved = {file: self.folder.place(stem + ending) for file, ending in self.family(name).items()}
        next(iter(moved.values())).parent.mkdir(exist_ok=True)
        taken = [new.name for new in moved.values() if new.exists()]
        if taken:
            raise InputError(f"{stem}: expected a free name, {taken[0]} exists already; choose another one")
        for old, new in moved.items():
            old.rename(new)
        return self.folder.name_of(next(iter(moved.values())))

    def duplicate(self, name: str) -> str:
        """Copy a take or a sample into the folder, without its drive, under a free name; returns it."""
        check_not_recording(path := self.path(name))
        copy = self.folder.free(path.stem, path.suffix)
        with atomic_file(copy) as partial:
            shutil.copyfile(path, partial)
        return copy.name

    def delete(self, name: str) -> str:
        """Move a take and the files beside it into a folder of the bin; returns the name of that folder."""
        files = self.family(name)
        place = StudioFolder.at(self.folder.path / BIN).free(Path(take_of(name)).stem, "")
        for file in files:
            (target := place / self.folder.name_of(file)).parent.mkdir(parents=True, exist_ok=True)
            file.rename(target)
        return place.name

    def restore(self, folder: str) -> str:
        """Move the files of a folder of the bin back; returns the take. InputError if one of the names is taken."""
        place = self.folder.find(f"{BIN}/{folder}")
        files = sorted(place.rglob("*.*"), key=lambda file: file.name.endswith((*_ENDINGS, ".html", NOTES)))
        back = {file: self.folder.path / file.relative_to(place) for file in files}
        for target in back.values():
            if target.exists():
                raise InputError(f"{target.name}: expected a free name, it exists again; rename that one first")
        for file, target in back.items():
            target.parent.mkdir(exist_ok=True)
            file.rename(target)
        shutil.rmtree(place)
        return self.folder.name_of(back[files[0]])

    def comparison_path(self, name: str) -> Path:
        """Return the path of the pressures of a comparison, kept for this session."""
        return self.samples / ("compared-" + name.replace(":", "-").replace("/", "-") + ".npz")

    def preview_path(self, name: str) -> str:
        """Return the path of a drive that has only the visible second, used until the whole drive is solved."""
        return str(self.samples / ("in-sight-" + name.replace(":", "-").replace("/", "-") + ".drive.h5"))

    def data(self, name: str) -> TakeData:
        """Return the files of a take; the drive is that of the visible second if only that was solved again."""
        path, drive, kept = self.path(name), self.beside(name, ".drive.h5"), self.comparison_path(name)
        part = Path(self.preview_path(name))
        if part.exists():
            drive = part
        there = [each for each in (path, drive, kept) if each.exists()]
        return TakeData(
            take=str(path),
            drive=str(drive) if drive in there else "",
            comparison=str(kept) if kept in there else "",
            stamp="-".join(f"{each.stat().st_mtime_ns:x}" for each in there),
        )

    def _row(
        self, name: str, file: str, stamps: Stamps, session: Stamps, labels: Mapping[str, list[str]]
    ) -> dict[str, Any]:
        """Row of a take with this file among `stamps`; the names of files beside it are those of `beside`."""
        stem, _, suffix = file.rpartition(".")
        others = (stem + kind for kind in (".h5", *_IMPORTED) if kind != f".{suffix}")
        if suffix != "h5" and any(other in stamps for other in others):
            stem = file

        def drive_row(name: str, stem: str) -> dict[str, Any]:
            drive = stamps.get(stem + ".drive.h5", "")
            compared = session.get(self.comparison_path(name).name, "")
            part = session.get(Path(self.preview_path(name)).name, "")
            return {
                "name": name,
                "solved": bool(drive),
                "drive": drive,
                "played": stem + ".rerecorded.h5" in stamps,
                "compared": bool(compared),
                "report": stem + ".report.html" in stamps,
                "stamp": "-".join(one for one in (stamps[file], part or drive, compared) if one),
            }

        further = [drive_row(f"{name}@{label}", f"{stem}.{label}") for label in sorted(labels.get(stem, []))]
        return {**drive_row(name, stem), "sample": name.startswith(SAMPLE), "drives": further}


def take_of(name: str) -> str:
    """Name of a take without the label of a drive."""
    found = _LABEL.fullmatch(name)
    return found[1] if found and found[2] == "@" else name


def _labels(names: Iterable[str]) -> dict[str, list[str]]:
    """Labels of the further drives among file names, by the stem of their take."""
    found: dict[str, list[str]] = {}
    for name in names:
        part = _LABEL.fullmatch(name.removesuffix(".drive.h5"))
        if part and part[2] == "." and name.endswith(".drive.h5"):
            found.setdefault(part[1], []).append(part[3])
    return found
