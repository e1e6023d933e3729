"""A recorder of every figure that midair prints or writes, to show that a change of the code changes no number.

``python -m tests.regression --write FILE`` runs the commands of `commands.txt` on the virtual rig and records their
figures; ``python -m tests.regression --against FILE`` runs them again and lists each figure that differs. Words do not
count: the figure of a text is the list of its numbers, and that of an array its digest.
"""

import csv
import hashlib
import io
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

import h5py
import numpy as np

HERE = Path(__file__).parent
ENVIRONMENT = {
    **dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
    "OPENBLAS_CORETYPE": os.environ.get("OPENBLAS_CORETYPE", "Haswell"),  # every x86 processor with AVX2 can run it
    **{"PYTHONHASHSEED": "0", "COLUMNS": "200", "TZ": "UTC", "PYTHONPATH": str(HERE.parents[1])},
}

LEFT_OUT = (
    r"\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?(?:Z|[+-]\d\d:\d\d)?)?",  # a date
    r"\b\d?\d:\d\d(?::\d\d)?\b",  # a time of day, or how long something took
    r"(?<![\w.])(?=[0-9a-f]*[a-f])(?=[a-f]*\d)[0-9a-f]{7,}\b(?![-+]\d)",  # a digest, also of what is no figure
    r"\b\d+\.\d+\.\d+\w*",  # a version
    r"\b\d[\d.]* ?[kMGT]i?B\b",  # the size of a file or of memory
    r"(?:/[\w.+-]+){2,}",  # a path of this machine
    r"<(script|style|svg)\b.*?</\1>|<[^>]*>",  # parts of a page that nobody reads
)
UNSTEADY = re.compile(
    r"sweep-(patterns|recordings) \| out|sweep-[\w-]*report \| out|\.npz \| seconds$"  # processor time
    r"|show-\w+ \| out|study-export.*(reaction_s|response_time|time)\b"  # how long it took
)
"""Names of figures that differ from run to run; everything else is alike in two runs of one commit."""
NUMBER = re.compile(r"(?<![\w.])[-\N{MINUS SIGN}]?(?:\d+(?:\.\d+)?|\.\d+)(?:[eE][-+]?\d+)?")
WORDS = {".png", ".gif", ".mp4", ".mat", ".ipynb", ".md", ".toml", ".jsonl", ".lock"}
"""Files that hold drawings, dates or little but words; their figures stand elsewhere too."""


def numbers(text: str) -> str:
    """Every number of a text in its order, without what `LEFT_OUT` lists; .5 and 0.50 are one."""
    for pattern in LEFT_OUT:
        text = re.sub(pattern, " ", text, flags=re.DOTALL)
    return " ".join(f"{float(found.replace(chr(0x2212), '-')):.15g}" for found in NUMBER.findall(text))


def digest(values: Any) -> str:
    """Type, shape and SHA-256 of an array, and its root mean square if it has one."""
    values = np.asarray(values)
    size = f" rms {np.sqrt(np.nanmean(np.abs(values) ** 2)):.9g}" if values.dtype.kind in "fc" and values.size else ""
    return f"{values.dtype} {values.shape}{size} sha256 {hashlib.sha256(values.tobytes()).hexdigest()}"


def of_text(text: str, place: str) -> Iterator[tuple[str, str]]:
    """The figures of a text; those of JSON by their keys."""
    try:
        value = json.loads(text)
    except ValueError:
        yield place, numbers(text)
        return
    pairs = [(place, value)]
    for name, each in pairs:
        if isinstance(each, dict | list):
            pairs += [
                (f"{name}/{key}", one) for key, one in (each.items() if isinstance(each, dict) else enumerate(each))
            ]
        else:
            yield name, numbers(each) if isinstance(each, str) else json.dumps(each)


def of_file(path: Path, place: str) -> Iterator[tuple[str, str]]:
    """The figures of a file, and that it was written."""
    yield f"{place} | written", "true"
    if path.suffix in (".csv", ".tsv"):
        table = list(csv.reader(io.StringIO(path.read_text(encoding="utf-8")), delimiter=",\t"[path.suffix == ".tsv"]))
        columns = ([row[at] for row in table if at < len(row)] for at in range(max(map(len, table), default=0)))
        yield from (
            (f"{place} | column {at} {cells[0]}", numbers("\n".join(cells))) for at, cells in enumerate(columns)
        )
    elif path.suffix in (".npz", ".npy"):
        loaded = np.load(path)
        arrays = loaded.items() if path.suffix == ".npz" else [("", loaded)]
        yield from ((f"{place} | {name}", digest(values)) for name, values in arrays)
    elif h5py.is_hdf5(path):
        with h5py.File(path, "r") as file:
            parts = {"": file}
            file.visititems(parts.__setitem__)
            for name, part in parts.items():
                if isinstance(part, h5py.Dataset) and part.dtype.kind in "biufc":
                    yield f"{place} | {name}", digest(part[()])
                for key, value in part.attrs.items():
                    if getattr(value, "dtype", np.dtype(object)).kind in "biufc" and key[0] != "_":
                        yield f"{place} | {name}@{key}", repr(np.asarray(value).tolist())
    elif path.suffix == ".wav":
        yield f"{place} | samples", digest(np.frombuffer(path.read_bytes(), np.uint8))
    elif path.suffix not in WORDS:
        yield from of_text(path.read_text(encoding="utf-8", errors="replace"), f"{place} | text")


def record(table: str, folder: Path) -> dict[str, str]:
    """Run the rows of a table as `commands.txt` is one, in a folder; their figures by name."""
    figures: dict[str, str] = {}
    before: dict[Path, int] = {}
    for line in table.splitlines():
        name, _, command = (part.strip() for part in line.split(" # ")[0].partition("|"))
        if not command or line.startswith("#"):
            continue
        words = command.split(maxsplit=1)
        run = f"{HERE}/scripts/{words[1]}.py" if words[0] == "script" else f"-m {command} -q"
        # No command reads what an earlier one learnt of this machine's speed.
        known = os.environ | ENVIRONMENT | {"MIDAIR_STATE": str(folder.with_name(f"{folder.name}-{name}"))}
        done = subprocess.run(
            f"exec {shlex.quote(sys.executable)} {run}",
            shell=True,
            cwd=folder,
            env=known,
            text=True,
            capture_output=True,
        )
        print(f"{name:20} {f'FAILED: {done.stderr[-400:]}' if done.returncode else ''}", flush=True)
        figures[f"{name} | exit status"] = str(done.returncode)
        figures |= dict(of_text(done.stdout, f"{name} | out")) | dict(of_text(done.stderr, f"{name} | err"))
        after = {path: path.stat().st_mtime_ns for path in sorted(folder.rglob("*")) if path.is_file()}
        for path in after:
            if after[path] != before.get(path):
                figures |= dict(of_file(path, f"{name} | {path.relative_to(folder).as_posix()}"))
        before = after
    return {name: value for name, value in figures.items() if not UNSTEADY.search(name)}


def differences(old: dict[str, str], new: dict[str, str]) -> list[str]:
    """Each figure of two records that differs, in one line; of a text the numbers that do."""
    lines: list[str] = []
    for name in sorted(old.keys() | new.keys()):
        one, other = (record.get(name, "none") for record in (old, new))
        if one != other:
            parts = one.split(), other.split()
            changed = SequenceMatcher(None, *parts, autojunk=False).get_opcodes()
            pairs = [(parts[0][a:b], parts[1][c:d]) for kind, a, b, c, d in changed if kind != "equal"]
            lines.append(f"{name}: {'; '.join(' -> '.join(map(' '.join, pair)) for pair in pairs[:8])}")
    return lines
