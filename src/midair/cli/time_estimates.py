"""Time estimates from the speed of earlier runs on this machine."""

import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from midair.errors import FileError

if TYPE_CHECKING:
    from midair.settings import Settings

LONG = 10.0
"""Work shorter than this gets no estimate, in s."""

MEASURED = 0.5
"""Work shorter than this does not update the stored speed, in s."""

_FILE = "speeds.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """A number of frames of one kind of work."""

    kind: str
    """Everything that decides the speed, such as ``solve glide windows 256 points 996 transducers``."""
    frames: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Speeds:
    """Measured frames per second of each kind of work on this machine."""

    rates: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def load(cls) -> "Speeds":
        """Speeds stored in the state folder; none if the file cannot be read."""
        with suppress(OSError, ValueError):
            stored = tomllib.loads((_folder() / _FILE).read_text(encoding="utf-8"))
            kept = {kind: float(rate) for kind, rate in stored.items() if isinstance(rate, int | float) and rate > 0}
            return cls(rates=MappingProxyType(kept))
        return cls()

    def seconds(self, works: Sequence[Work]) -> float | None:
        """Estimated time; None if the speed of any part is unknown."""
        if any(work.kind not in self.rates for work in works):
            return None
        return sum(work.frames / self.rates[work.kind] for work in works)

    def updated(self, work: Work, seconds: float) -> "Speeds":
        """Speeds updated with the time of this work: the geometric mean of the old and the new value."""
        rate = work.frames / seconds
        rate = (rate * self.rates.get(work.kind, rate)) ** 0.5
        return Speeds(rates=MappingProxyType({**self.rates, work.kind: float(f"{rate:.4g}")}))

    def save(self) -> None:
        """Store the speeds; errors are ignored, since only the next estimate is lost."""
        import tomli_w

        from midair.files import atomic_file

        with suppress(OSError, FileError):
            folder = _folder()
            folder.mkdir(parents=True, exist_ok=True)
            with atomic_file(folder / _FILE) as partial:
                partial.write_text(tomli_w.dumps(dict(self.rates)), encoding="utf-8")


def workload_of(settings: "Settings", transducers: int) -> str:
    """Settings that decide the time per frame: method, iterations, error measure, points, transducers, threads."""
    solver, grid = settings.solver, settings.target.grid
    parts = [solver.name, str(solver.fit), f"{grid.rows}x{grid.columns} points", f"{transducers} transducers"]
    parts += [] if solver.iterations is None else [f"iterations {solver.iterations}"]
    parts += [] if solver.guard is None else ["guard"]
    return " ".join([*parts, f"jobs {solver.jobs or 1}"])


def estimate_text(speeds: Speeds, works: Sequence[Work]) -> str:
    """Line to print before long work; empty for short work."""
    seconds = speeds.seconds(works)
    if seconds is None:
        return "no time estimate yet on this machine; the progress bar shows the time left"
    if seconds < LONG:
        return ""
    return f"this takes about {duration_text(seconds)}, by the speed of the last run on this machine"


def duration_text(seconds: float) -> str:
    """A duration in at most two digits: 40 s, 3 min, 2.5 h."""
    if seconds < 90:
        return f"{float(f'{seconds:.1g}' if seconds < 10 else f'{seconds:.2g}'):g} s"
    if seconds < 5400:
        return f"{seconds / 60:.2g} min"
    return f"{seconds / 3600:.2g} h"


def _folder() -> Path:
    """State folder; importing devices here keeps the help fast."""
    from midair.devices import state_folder

    return state_folder()
