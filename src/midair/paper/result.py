"""Result of a reproduced figure or table: pictures, and numbers as CSV and JSON."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from midair.files import atomic_file, csv_text, for_json

Row = Mapping[str, str | int | float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperResult:
    """One figure or table in the paper's mode and in another one."""

    name: str
    """Base name of the files."""
    title: str
    rows: tuple[Row, ...]
    """Numbers; all rows have the same keys."""
    pictures: Mapping[str, bytes]
    """PNG files by name."""
    about: Mapping[str, object] = field(default_factory=dict[str, object])
    """Parameters of the computation."""

    def plain(self) -> dict[str, object]:
        """Values for JSON; infinite values become null."""
        return {
            "name": self.name,
            "title": self.title,
            "simulated": True,
            "about": dict(self.about),
            "rows": [for_json(row) for row in self.rows],
        }

    def table(self) -> str:
        """Return the rows as CSV."""
        return csv_text(self.rows)

    def files(self, folder: Path) -> list[Path]:
        """Paths of the files that `write` creates."""
        return [folder / f"{self.name}.csv", folder / f"{self.name}.json", *(folder / name for name in self.pictures)]

    def write(self, folder: Path) -> list[Path]:
        """Write pictures, CSV and JSON into a folder; each file is written atomically."""
        folder.mkdir(parents=True, exist_ok=True)
        contents = [self.table().encode(), json.dumps(self.plain(), indent=2).encode(), *self.pictures.values()]
        for path, content in zip(self.files(folder), contents, strict=True):
            with atomic_file(path) as partial:
                partial.write_bytes(content)
        return self.files(folder)
