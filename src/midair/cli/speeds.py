"""How fast work of each kind went on this machine the last time: what long work will take is told from it."""

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
"""Work of fewer seconds than these is not told beforehand."""

MEASURED = 0.5
"""Work of fewer seconds than these says little of how fast the next one goes."""

_FILE = "speeds.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """So many frames of one kind.

    Attributes
    ----------
    kind : str
        What decides the speed, such as ``solve glide windows 256 points 996 transducers``.
    frames : int
        How many.
    """

    kind: str
    frames: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Speeds:
    """Frames a second of each kind of work, as they were measured on this machine.

    Attributes
    ----------
    rates : Mapping of str to float
        By the kind.
    """

    rates: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def known(cls) -> "Speeds":
        """What the state folder tells; nothing where it cannot be read."""
        with suppress(OSError, ValueError):
            told = tomllib.loads((_folder() / _FILE).read_text(encoding="utf-8"))
            kept = {kind: float(rate) for kind, rate in told.items() if isinstance(rate, int | float) and rate > 0}
            return cls(rates=MappingProxyType(kept))
        return cls()

    def seconds(self, works: Sequence[Work]) -> float | None:
        """How long it will take; None where the speed of any of it is not known."""
        if any(work.kind not in self.rates for work in works):
            return None
        return sum(work.frames / self.rates[work.kind] for work in works)

    def learnt(self, work: Work, seconds: float) -> "Speeds":
        """With what this work took; what it took before counts for half, since a machine is not always as busy."""
        rate = work.frames / seconds
        rate = (rate * self.rates.get(work.kind, rate)) ** 0.5
        return Speeds(rates=MappingProxyType({**self.rates, work.kind: float(f"{rate:.4g}")}))

    def keep(self) -> None:
        """Write it to the state folder, whole; a folder that refuses costs no more than the next estimate."""
        import tomli_w

        from midair.files import whole_file

        with suppress(OSError, FileError):
            folder = _folder()
            folder.mkdir(parents=True, exist_ok=True)
            with whole_file(folder / _FILE) as partial:
                partial.write_text(tomli_w.dumps(dict(self.rates)), encoding="utf-8")


def workload_of(settings: "Settings", transducers: int) -> str:
    """What decides how fast a frame is solved: method, iterations, what is met, points, transducers, threads."""
    solver, grid = settings.solver, settings.target.grid
    parts = [solver.name, str(solver.fit), f"{grid.rows}x{grid.columns} points", f"{transducers} transducers"]
    parts += [] if solver.iterations is None else [f"iterations {solver.iterations}"]
    parts += [] if solver.guard is None else ["guard"]
    return " ".join([*parts, f"jobs {solver.jobs or 1}"])


def estimate_text(speeds: Speeds, works: Sequence[Work]) -> str:
    """One line before long work; empty for short."""
    seconds = speeds.seconds(works)
    if seconds is None:
        return "how long it takes is not known here yet: the bar tells, and the next time this line"
    if seconds < LONG:
        return ""
    return f"this takes about {duration_text(seconds)}, as fast as the last time on this machine"


def duration_text(seconds: float) -> str:
    """A duration in two digits at most: 40 s, 3 min, 2.5 h."""
    if seconds < 90:
        return f"{float(f'{seconds:.1g}' if seconds < 10 else f'{seconds:.2g}'):g} s"
    if seconds < 5400:
        return f"{seconds / 60:.2g} min"
    return f"{seconds / 3600:.2g} h"


def _folder() -> Path:
    """Where it is kept; devices are imported with it, which help needs no more than files and settings."""
    from midair.devices import state_folder

    return state_folder()
