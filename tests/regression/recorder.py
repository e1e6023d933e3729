"""Run every command of `commands.txt` in a folder of its own, record its figures, and compare them with a reference."""

import argparse
import atexit
import glob
import hashlib
import importlib
import importlib.util
import json
import os
import platform
import resource
import runpy
import shlex
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from tests.regression.comparison import compared
from tests.regression.figures import of_file, printed, steady

HERE = Path(__file__).parent
LIMIT = 120
"""Processor time that a command may take, in s."""

LOADED = ("h5py", "scipy.signal", "scipy.optimize", "matplotlib.figure", "rich.console", "cyclopts", "pydantic")
"""Packages that are imported once and not by each command: they take most of its start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A command whose figures are recorded."""

    name: str
    words: tuple[str, ...]


def rows(text: str) -> list[Row]:
    """The rows of a table as `commands.txt` is one."""
    lines = [line.split(" # ")[0] for line in text.splitlines() if line.strip() and not line.startswith("#")]
    parts = [line.split("|", 1) for line in lines]
    found = [Row(name=name.strip(), words=tuple(shlex.split(command))) for name, command in parts]
    names = [row.name for row in found]
    if len(set(names)) < len(names):
        raise SystemExit(
            f"commands.txt: expected each name once, got {sorted({n for n in names if names.count(n) > 1})}"
        )
    return found


def start(row: Row, folder: Path, told: Path) -> tuple[int, float]:
    """Run a row in a process of its own; its exit status and its processor time in s."""
    child = os.fork()
    if child:
        _, status, used = os.wait4(child, 0)
        return os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime
    code = 1
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT))
        os.chdir(folder)
        # No command reads what an earlier one learnt of this machine's speed.
        os.environ["MIDAIR_STATE"] = str(told / row.name)
        for stream, name in ((1, "out"), (2, "err")):
            os.dup2(os.open(told / f"{row.name}.{name}", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), stream)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        sys.stdout, sys.stderr = (os.fdopen(stream, "w", encoding="utf-8") for stream in (1, 2))
        kind, *words = row.words
        try:
            if kind == "script":
                runpy.run_path(str(HERE / "scripts" / f"{words[0]}.py"), run_name="__main__")
            else:
                # As a shell does it.
                sys.argv = ["midair", *chain.from_iterable(sorted(glob.glob(word)) or [word] for word in words), "-q"]
                runpy.run_module(kind, run_name="__main__", alter_sys=True)
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
    except BaseException:  # noqa: BLE001  # nothing of this process may go on in the parent's code
        sys.excepthook(*sys.exc_info())
    finally:
        os._exit(code)


def files(folder: Path) -> dict[Path, tuple[int, int]]:
    """Each file of a folder with when it was written and its size."""
    return {
        path: (path.stat().st_mtime_ns, path.stat().st_size) for path in sorted(folder.rglob("*")) if path.is_file()
    }


def record(table: list[Row], work: Path) -> tuple[dict[str, str], dict[str, float]]:
    """Run a table; its figures by name, and the processor time of each row in s."""
    folder, told = work / "folder", work / "told"
    folder.mkdir()
    told.mkdir()
    figures: dict[str, str] = {}
    taken: dict[str, float] = {}
    before = files(folder)
    for row in table:
        status, taken[row.name] = start(row, folder, told)
        after = files(folder)
        made = [path for path in after if after[path] != before.get(path)]
        figures |= dict(_figures(row, status, told, made, folder))
        before = after
        failure = f"FAILED, exit status {status}" if status else ""
        print(f"{row.name:20} {failure:24} {taken[row.name]:6.1f} s", flush=True)
        if status:
            print((told / f"{row.name}.err").read_text(encoding="utf-8")[-400:])
    return steady(figures), taken


def _figures(row: Row, status: int, told: Path, made: list[Path], folder: Path) -> Iterator[tuple[str, str]]:
    yield f"{row.name} | exit status", str(status)
    for name in ("out", "err"):
        yield from printed((told / f"{row.name}.{name}").read_text(encoding="utf-8"), f"{row.name} | {name}")
    for path in made:
        place = f"{row.name} | {path.relative_to(folder).as_posix()}"
        try:
            yield from of_file(path, place)
        except Exception as wrong:  # noqa: BLE001  # one file that cannot be read is a figure that differs
            yield f"{place} | not read", f"{type(wrong).__name__}: {wrong}"


def machine() -> dict[str, str]:
    """What the bits of figures depend on, beside the code."""
    cpu = Path("/proc/cpuinfo")
    names = (
        [line for line in cpu.read_text(encoding="utf-8").splitlines() if line.startswith("model name")]
        if cpu.exists()
        else []
    )
    return {
        "kernel": os.environ["OPENBLAS_CORETYPE"],
        "numpy": np.__version__,
        "processor": names[0].partition(":")[2].strip() if names else platform.processor(),
        "python": platform.python_version(),
    }


def source() -> str:
    """SHA-256 of the code that runs: of every Python file of midair."""
    (folder,) = importlib.util.find_spec("midair").submodule_search_locations
    whole = hashlib.sha256()
    for path in sorted(Path(folder).rglob("*.py")):
        whole.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    return whole.hexdigest()


def command_line() -> int:
    """Record, and compare where a reference is given; 1 where something differs or failed."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.regression", description="Record every figure of midair's commands."
    )
    parser.add_argument(
        "--write", type=Path, metavar="FILE", help="JSON file for the figures; keep it outside of the repository"
    )
    parser.add_argument("--against", type=Path, metavar="FILE", help="file of an earlier --write, to compare with")
    parser.add_argument("--rows", nargs="+", metavar="NAME", help="only these rows, and none that they need")
    parser.add_argument(
        "--report", type=Path, metavar="FILE", help="text file for the comparison, beside standard output"
    )
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="new folder for all files that the commands write")
    asked = parser.parse_args()
    if not (asked.write or asked.against):
        parser.error("expected --write FILE, --against FILE or both")
    reference = json.loads(asked.against.read_text(encoding="utf-8")) if asked.against else None
    if reference and reference["machine"] != machine():
        parser.error(
            f"expected the machine of the record, {reference['machine']}, got {machine()}, whose bits may differ; "
            f"set OPENBLAS_CORETYPE={reference['machine']['kernel']} if only the kernel differs"
        )
    table = [
        row
        for row in rows((HERE / "commands.txt").read_text(encoding="utf-8"))
        if not asked.rows or row.name in asked.rows
    ]
    for name in LOADED:
        importlib.import_module(name)
    if asked.keep:
        asked.keep.mkdir(parents=True)
    # Not a TemporaryDirectory: each forked process would remove it when it ends.
    code, work = source(), asked.keep.absolute() if asked.keep else Path(tempfile.mkdtemp())
    try:
        figures, taken = record(table, work)
    finally:
        if not asked.keep:
            shutil.rmtree(work)
    if source() != code:
        print("midair's source files changed while its commands ran: nothing is recorded or compared; run again")
        return 1
    failed = [name for name in figures if name.endswith("| exit status") and figures[name] != "0"]
    spent = sum(taken.values())
    print(f"{len(table)} commands, {len(failed)} failed, {len(figures)} figures, {spent:.0f} s of processor time")
    if asked.write:
        whole = {"machine": machine(), "source": code, "figures": figures}
        asked.write.write_text(json.dumps(whole, indent=0, sort_keys=True) + "\n", encoding="utf-8")
    if reference is None:
        return int(bool(failed))
    names = {row.name for row in table}
    old = {
        name: value for name, value in reference["figures"].items() if not asked.rows or name.split(" | ")[0] in names
    }
    report = compared(steady(old), figures)
    print(report.text)
    if asked.report:
        asked.report.write_text(report.text + "\n", encoding="utf-8")
    return int(bool(failed or report.differ))
