"""Time estimates from the speeds of the last runs of the same kind on this machine."""

import os
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from midair.errors import FileError

if TYPE_CHECKING:
    from midair.settings import Settings

LONG = 10.0
"""Work shorter than this gets no estimate, in s."""

MEASURED = 0.5
"""Work shorter than this does not update the stored speed, in s."""


KEPT = 5
"""Number of runs whose speed is stored."""


def estimate_text(kind: str, frames: int) -> str:
    """Line to print before work of a kind, such as ``solve glide windows 256 points``; empty for short work."""
    speeds = _speeds().get(kind)
    if not speeds:
        return "no time estimate yet on this machine; the progress bar shows the time left"
    short, long = (duration_text(frames / speed) for speed in (max(speeds), min(speeds)))
    if frames / min(speeds) < LONG:
        return ""
    how = f"about {long}, by the last run" if short == long else f"{short} to {long}, by the last {len(speeds)} runs"
    busy = os.getloadavg()[0] > (os.cpu_count() or 1) if hasattr(os, "getloadavg") else False
    return f"this takes {how} on this machine{'; longer now, since other programs use the processors' if busy else ''}"


def is_speed_known(kind: str) -> bool:
    """Whether `estimate_text` can estimate the time of a kind of work."""
    return kind in _speeds()


def remember_speed(kind: str, frames: int, seconds: float) -> None:
    """Store the speed of finished work; errors are ignored, since only the next estimate is lost."""
    import tomli_w

    from midair.files import atomic_file

    if not frames or seconds < MEASURED:
        return
    known = _speeds()
    speeds = {**known, kind: [*known.get(kind, []), float(f"{frames / seconds:.4g}")][-KEPT:]}
    with suppress(OSError, FileError):
        path = _file()
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(path) as partial:
            partial.write_text(tomli_w.dumps(speeds), encoding="utf-8")


def workload_of(settings: "Settings", transducers: int) -> str:
    """Settings that decide the time per frame: method, iterations, error measure, points, transducers, threads."""
    solver, grid = settings.solver, settings.target.grid
    parts = [solver.name, str(solver.fit), f"{grid.rows}x{grid.columns} points", f"{transducers} transducers"]
    parts += [] if solver.iterations is None else [f"iterations {solver.iterations}"]
    parts += [] if solver.guard is None else ["guard"]
    return " ".join([*parts, f"jobs {solver.jobs or 1}"])


def duration_text(seconds: float) -> str:
    """A duration in at most two digits: 40 s, 3 min, 2.5 h."""
    if seconds < 90:
        return f"{float(f'{seconds:.1g}' if seconds < 10 else f'{seconds:.2g}'):g} s"
    if seconds < 5400:
        return f"{seconds / 60:.2g} min"
    return f"{seconds / 3600:.2g} h"


def _speeds() -> dict[str, list[float]]:
    """Frames per second of the last runs of each kind of work; none if the file cannot be read."""
    with suppress(OSError, ValueError):
        stored = tomllib.loads(_file().read_text(encoding="utf-8"))
        # Early versions stored one number.
        runs = {kind: rates if isinstance(rates, list) else [rates] for kind, rates in stored.items()}
        return {kind: [float(rate) for rate in rates if float(rate) > 0] for kind, rates in runs.items()}
    return {}


def _file() -> Path:
    """Stored speeds; importing devices here keeps the help fast."""
    from midair.devices import state_folder

    return state_folder() / "speeds.toml"
