"""What re-making a part of the paper gives: a picture, and its numbers for people and for programs."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from midair.files import csv_text, for_json, whole_file

Row = Mapping[str, str | int | float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperResult:
    """One figure or table, made in the paper's mode and in the best one.

    Attributes
    ----------
    name : str
        Of its files.
    title : str
        What it shows.
    rows : tuple of mapping
        Its numbers, all with the same names.
    pictures : mapping of str to bytes
        PNG files by name.
    about : mapping
        What it was made with.
    """

    name: str
    title: str
    rows: tuple[Row, ...]
    pictures: Mapping[str, bytes]
    about: Mapping[str, object] = field(default_factory=dict[str, object])

    def plain(self) -> dict[str, object]:
        """For JSON: infinities become null."""
        return {
            "name": self.name,
            "title": self.title,
            "simulated": True,
            "about": dict(self.about),
            "rows": [for_json(row) for row in self.rows],
        }

    def table(self) -> str:
        """The rows as CSV."""
        return csv_text(self.rows)

    def files(self, folder: Path) -> list[Path]:
        """Where `write` puts it."""
        return [folder / f"{self.name}.csv", folder / f"{self.name}.json", *(folder / name for name in self.pictures)]

    def write(self, folder: Path) -> list[Path]:
        """Write pictures, CSV and JSON into a folder; each file is there as a whole or not at all."""
        folder.mkdir(parents=True, exist_ok=True)
        contents = [self.table().encode(), json.dumps(self.plain(), indent=2).encode(), *self.pictures.values()]
        for path, content in zip(self.files(folder), contents, strict=True):
            with whole_file(path) as partial:
                partial.write_bytes(content)
        return self.files(folder)
