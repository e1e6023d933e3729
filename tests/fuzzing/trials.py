"""What midair does with a damaged file, tried in processes that may die of it."""

import contextlib
import io
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from tests.fuzzing.damage import damaged
from tests.fuzzing.folder_trials import FOLDER_TARGETS, make_folders
from tests.fuzzing.specimens import GRID, make_all

from midair.cli import run
from midair.errors import MidairError
from midair.files import open_take
from midair.model import SensorGrid

MEMORY = 4 * 2**30
SECONDS = 10.0
BATCH = 150


@dataclass
class Findings:
    """What came of the files: how many were read, refused in one line, and what must not be."""

    read: int = 0
    refused: int = 0
    bad: Counter[str] = field(default_factory=Counter)
    kept: dict[str, Path] = field(default_factory=dict)
    slowest: float = 0.0
    slowest_name: str = ""

    @property
    def count(self) -> int:
        return self.read + self.refused + self.bad.total()


def commands(*words: str) -> Callable[[Path], None]:
    """Types a command; IN is the file, OUT a name beside it."""

    def type_it(path: Path) -> None:
        out = path.with_name("out.h5")
        typed = [{"IN": str(path), "OUT": str(out)}.get(word, word) for word in words]
        said, complained = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complained):
            status = run(typed)
        lines = [line for line in complained.getvalue().splitlines() if line.startswith("midair: ")]
        if "\x1b" in said.getvalue() + complained.getvalue():
            raise AssertionError("an escape sequence reached the terminal")
        if status not in (0, 1, 2) or len(lines) != bool(status):
            raise AssertionError(f"status {status} with {len(lines)} lines: {complained.getvalue()[-300:]}")
        if status:
            raise MidairError(lines[0])

    return type_it


def import_or_open(*words: str, **said: Any) -> Callable[[Path], None]:
    """Types the command import for one file in four, and opens the others as it does: typing takes longest."""
    typed = commands("import", "IN", "OUT", "--force", *words)

    def bring(path: Path) -> None:
        if path.stat().st_size % 4:
            open_take(path, **said)
        else:
            typed(path)

    return bring


INFO = commands("info", "IN")
BRING = import_or_open("--rate", "1kHz", "--unit", "V", "--layout", "2x3:7mm", rate=1000, unit="V", sensor=GRID)
OWN = import_or_open()
STAMPED = import_or_open("--unit", "V", "--layout", "1x2:7mm", unit="V", sensor=SensorGrid(rows=1, columns=2))
SAYS_UNIT = import_or_open("--layout", "2x3:7mm", sensor=GRID)
ONE_CHANNEL = import_or_open("--unit", "V", "--layout", "1x1:7mm", unit="V", sensor=SensorGrid(rows=1, columns=1))


FOREIGN = ("wav", "ulaw.wav", "float.wav", "w64", "rf64", "npz")
READ_BY: dict[tuple[Callable[[Path], object], ...], tuple[str, ...]] = {
    (INFO, OWN): ("killed.h5",),
    (OWN,): ("own.csv", "own.wav", "own.npz", "denim.csv"),
    (BRING,): tuple(f"foreign.{ending}" for ending in FOREIGN),
    (STAMPED,): ("stamped.csv",),
    (SAYS_UNIT,): ("a.xdf", "a.tdms"),
    (ONE_CHANNEL,): ("foreign.haptic", "foreign.ahap"),
}
TARGETS = {name: readers for readers, names in READ_BY.items() for name in names} | {
    name: (reader,) for name, reader in FOLDER_TARGETS.items()
}
"""By the name of a specimen."""


def try_many(count: int, seed: int, keep: Path, *, only: str = "", first: int = 0) -> Findings:
    """Damage and read so many files; those that end badly are kept in a folder."""
    found = Findings()
    with tempfile.TemporaryDirectory(prefix="midair-fuzz-") as folder:
        originals = Path(folder) / "originals"
        originals.mkdir()
        make_all(originals)
        make_folders(originals)
        shutil.copytree(originals, Path(folder) / "trial")
        names = [name for name in TARGETS if (originals / name).exists() and only in name]
        contents = {name: (originals / name).read_bytes() for name in names}
        for name, content in contents.items():
            damaged(name, content, np.random.default_rng(0))  # what is looked up once is looked up before the copies
        number = first
        while number < first + count:
            tried = _batch(range(number, min(first + count, number + BATCH)), seed, contents, Path(folder), keep, found)
            if not tried:
                raise RuntimeError(f"file {number} could not be damaged: a process for trials ended before it began")
            number += tried
    return found


def _batch(numbers: range, seed: int, contents: dict[str, bytes], folder: Path, keep: Path, found: Findings) -> int:
    """Try one file after the other in a copy of this process; how many were tried before it ended."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _end_with(lambda: _child(numbers, seed, contents, folder, writing))
    os.close(writing)
    tried, current, begun = 0, "", time.monotonic()
    with os.fdopen(reading, "r", encoding="utf-8", errors="replace") as lines:
        for line in lines:
            word, _, rest = line.rstrip("\n").partition(" ")
            if word == "try":
                current, begun = rest, time.monotonic()
                continue
            tried += 1
            if time.monotonic() - begun > found.slowest:
                found.slowest, found.slowest_name = time.monotonic() - begun, current
            if word == "read":
                found.read += 1
            elif word == "refused":
                found.refused += 1
            else:
                _note(found, f"{current.split()[1]}: {rest}", folder, keep, current)
            current = ""
    _, status = os.waitpid(child, 0)
    if current:
        tried += 1
        name = signal.Signals(os.WTERMSIG(status)).name if os.WIFSIGNALED(status) else f"status {status}"
        what = "hang" if name in ("SIGALRM", "SIGPROF") else name
        _note(found, f"{current.split()[1]}: {what}", folder, keep, current)
    return tried


def _note(found: Findings, what: str, folder: Path, keep: Path, current: str) -> None:
    number, name = current.split()
    found.bad[what] += 1
    if what not in found.kept:
        keep.mkdir(parents=True, exist_ok=True)
        found.kept[what] = keep / f"{number}-{name.replace(os.sep, '-')}"
        bad = folder / f"bad-{number}"
        shutil.copy(bad if bad.exists() else folder / "trial" / name, found.kept[what])
    shutil.copy(folder / "originals" / name, folder / "trial" / name)


def _end_with(work: Callable[[], None]) -> None:
    try:
        work()
    finally:
        os._exit(0)


def _child(numbers: range, seed: int, contents: dict[str, bytes], folder: Path, writing: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.environ["MIDAIR_TRACEBACK"] = "1"
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)
    trial = folder / "trial"
    names = list(contents)
    for number in numbers:
        rng = np.random.default_rng((seed, number))
        name = names[number % len(names)]
        path = trial / name
        path.write_bytes(damaged(name, contents[name], rng))
        _tell(writing, f"try {number} {name}")
        outcome = _outcome(path, TARGETS[name])
        if outcome.startswith("bad"):
            shutil.copy(path, folder / f"bad-{number}")
        _tell(writing, outcome)
        if name in FOLDER_TARGETS or outcome.startswith("bad"):
            path.write_bytes(contents[name])


_TIMERS = ((signal.ITIMER_PROF, signal.SIGPROF, SECONDS), (signal.ITIMER_REAL, signal.SIGALRM, 6 * SECONDS))


def _outcome(path: Path, targets: tuple[Callable[[Path], object], ...]) -> str:
    # Without a handler the signal ends the process, also inside a library that never returns.
    # Processor time, so that a busy machine makes no hangs; what only waits ends after six times as long.
    for kind, number, seconds in _TIMERS:
        signal.signal(number, signal.SIG_DFL)
        signal.setitimer(kind, seconds)
    try:
        return _reading(path, targets)
    finally:
        for kind, _, _ in _TIMERS:
            signal.setitimer(kind, 0)


def _reading(path: Path, targets: tuple[Callable[[Path], object], ...]) -> str:
    word = "read"
    for target in targets:
        try:
            target(path)
        except MidairError as wrong:
            word = "refused"
            if "\n" in str(wrong):
                return f"bad more than one line: {str(wrong)[:80]!r}"
        except Exception as wrong:  # noqa: BLE001  # whatever it is, it is what is looked for
            return f"bad {type(wrong).__name__} at {_place(wrong)}: {str(wrong)[:120]!r}"
    return word


def _place(wrong: BaseException) -> str:
    frames = [frame for frame in traceback.extract_tb(wrong.__traceback__) if "/midair/" in frame.filename]
    return f"{frames[-1].filename.split('/midair/')[-1]}:{frames[-1].lineno}" if frames else "nowhere"


def _tell(writing: int, line: str) -> None:
    os.write(writing, (line.replace("\n", " ") + "\n").encode("utf-8", "replace"))


def told(found: Findings, seconds: float) -> Iterator[str]:
    kinds = Counter(what.split(": ")[1].split(" at ")[0] for what in found.bad.elements())
    dead = sum(count for kind, count in kinds.items() if kind.startswith("SIG"))
    hangs = kinds["hang"]
    yield (
        f"{found.count} damaged files in {seconds:.0f} s, {found.slowest:.1f} s the slowest "
        f"({found.slowest_name}): {found.read} read, "
        f"{found.refused} refused in one line, {found.bad.total() - dead - hangs} tracebacks, "
        f"{dead} crashes, {hangs} hangs"
    )
    for what, count in found.bad.most_common():
        yield f"  {count:5d}  {what}  {found.kept[what]}"


def main(arguments: list[str] | None = None) -> int:
    import argparse

    parser = argparse.ArgumentParser(prog="python -m tests.fuzzing", description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first, to go on with a seed")
    parser.add_argument("--only", default="", help="names of specimens that hold this")
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "midair-fuzz-kept")
    given = parser.parse_args(arguments)
    begun = time.monotonic()
    found = try_many(given.count, given.seed, given.keep, only=given.only, first=given.first)
    for line in told(found, time.monotonic() - begun):
        print(line)
    return int(bool(found.bad))


if __name__ == "__main__":
    sys.exit(main())
