"""The takes of the studio's folder and the samples, with the files that belong to each."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from midair.errors import InputError
from midair.studio.demo_stroke import FIRST
from midair.studio.folders import StudioFolder
from midair.studio.take_data import TakeData
from midair.studio.work import stamp_of

SAMPLE = "sample:"
"""Prefix of the names of samples, which are not files of the folder."""

_ENDINGS = (".drive.h5", ".rerecorded.h5", ".calibration.h5", ".array.h5")
"""Endings of files that are not takes."""

_IMPORTED = (".csv", ".wav", ".npz", ".npy", ".mat")
"""Endings of takes of other programs."""

_NOT_YET = ("solved", "drive", "played", "compared", "report")
"""Properties of a take that are false until its file exists."""


@dataclass(frozen=True, slots=True)
class TakesList:
    """The takes of a studio."""

    folder: StudioFolder
    """Folder that the user opened."""
    samples: Path
    """Folder of this session for samples and derived files; removed when the studio ends."""

    def rows(self) -> list[dict[str, Any]]:
        """Return one row per take, samples last."""
        own = [name for name in self.folder.names(".h5") if not name.endswith(_ENDINGS)]
        own += [name for ending in _IMPORTED for name in self.folder.names(ending)]
        samples = [SAMPLE + path.stem for path in self._sample_files()]
        rows = [self._row(name) for name in own]
        if self.is_pending(SAMPLE + FIRST):
            rows.append({**dict.fromkeys(_NOT_YET, False), "name": SAMPLE + FIRST, "sample": True, "stamp": "first"})
        return [*rows, *(self._row(name) for name in samples)]

    def is_pending(self, name: str) -> bool:
        """True for the sample that the demo stroke replaces until its file exists."""
        return name == SAMPLE + FIRST and not (self.samples / f"{FIRST}.h5").exists()

    def path(self, name: str) -> Path:
        """Return the path of a recording; InputError or MissingFileError if the name is not valid."""
        if name.startswith(SAMPLE):
            found = {SAMPLE + path.stem: path for path in self._sample_files()}
            if name not in found:
                raise InputError(f"take: expected one of {', '.join(found) or 'no samples yet'}, got {name[:80]!r}")
            return found[name]
        return self.folder.find(name)

    def incoming(self, name: str) -> Path:
        """Return the path of an uploaded file that is to be imported; InputError if there is none."""
        folder = StudioFolder(self.samples / "incoming")
        return folder.find(name)

    def beside(self, name: str, ending: str) -> Path:
        """Return the path of a file that belongs to a take (drive, re-recording, report), existing or not."""
        path = self.path(name)
        others = (path.with_suffix(kind) for kind in (".h5", *_IMPORTED) if kind != path.suffix)
        # Of several takes with one stem, the others keep their suffix.
        own = path.suffix != ".h5" and any(other.exists() for other in others)
        return path.with_name((path.name if own else path.name.removesuffix(path.suffix)) + ending)

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

    def _row(self, name: str) -> dict[str, Any]:
        return {
            "name": name,
            "sample": name.startswith(SAMPLE),
            "solved": bool(drive := stamp_of(self.beside(name, ".drive.h5"))),
            "drive": drive,
            "played": self.beside(name, ".rerecorded.h5").exists(),
            "compared": self.comparison_path(name).exists(),
            "report": self.beside(name, ".report.html").exists(),
            "stamp": self.data(name).stamp,
        }

    def _sample_files(self) -> list[Path]:
        order = {"towel": 0, "brush": 1, "sponge": 2}
        files = [path for path in self.samples.glob("*.h5") if not path.name.endswith(_ENDINGS)]
        return sorted((path for path in files if path.stem in order), key=lambda path: order[path.stem])
