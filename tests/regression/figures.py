"""Figures of one command: every number of what it prints, every array and number of what it writes.

Words do not count: text gives its numbers alone, in their order. A name of a figure is `command | place | part`; where
numbers have no name of their own, the part ends in `#` and their place in the sequence.
"""

import csv
import hashlib
import io
import json
import re
from collections.abc import Iterator, Mapping
from itertools import zip_longest
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import soundfile
from scipy.io import loadmat

LEFT_OUT = {
    r"\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?(?:Z|[+-]\d\d:\d\d)?)?": "a date",
    r"\b\d?\d:\d\d(?::\d\d)?\b": "a time of day, or how long something took",
    r"(?<![\w.])(?=[0-9a-f]*[a-f])(?=[a-f]*\d)[0-9a-f]{7,}\b(?![-+]\d)": "a digest, also of what is no figure",
    r"\b\d+\.\d+\.\d+\w*": "a version",
    r"\b\d[\d.]* ?[kMGT]i?B\b": "the size of a file or of memory",
    r"(?:/[\w.+-]+){2,}": "a path of this machine",
}
"""Parts of a text that are no figures, and what they are."""

UNSTEADY = {
    r"^sweep-(patterns|recordings) \| out \|": "processor time; the report of the sweep has the rest",
    r"^show-\w+ \| out \|": "how long it took; the file that is written has the figures",
    r"^sweep-[\w-]*report \| out \| /words": "processor time; the CSV files have the figures",
    r"^study-export.* \| column (reaction_s|response_time|time)\b": "when an answer came, and how long it took",
    r"\.npz \| seconds$": "processor time of each task",
}
"""Names of figures that differ from run to run, and why. Everything else is alike in two runs of one commit."""

NUMBER = re.compile(r"(?<![\w.])[-\N{MINUS SIGN}]?(?:\d+(?:\.\d+)?|\.\d+)(?:[eE][-+]?\d+)?")
EACH = 64
"""Numbers up to which a list or a text gives each of them; a longer one gives its digest."""

WORDS = {".png", ".gif", ".mp4", ".ipynb", ".md", ".toml", ".jsonl", ".lock"}
"""Files that hold drawings with words in them, or little but words; their figures stand elsewhere too."""


def numbers(text: str) -> list[str]:
    """Every number of a text in its order, without what `LEFT_OUT` names."""
    for pattern in LEFT_OUT:
        text = re.sub(pattern, " ", text)
    return [found.replace("\N{MINUS SIGN}", "-") for found in NUMBER.findall(text)]


def digest(values: Any) -> str:
    """Type, shape, root of the mean square and SHA-256 of an array, in one line."""
    values = np.asarray(values)
    if values.dtype.names:
        return "; ".join(f"{name}: {digest(values[name])}" for name in values.dtype.names)
    size = float(np.sqrt(np.nanmean(np.abs(values.astype(complex)) ** 2))) if values.size else 0.0
    return f"{values.dtype} {values.shape} rms {size:.9g} sha256 {hashlib.sha256(values.tobytes()).hexdigest()}"


def of_text(text: str, place: str) -> Iterator[tuple[str, str]]:
    """The numbers of a text; of many, their digest."""
    found = numbers(text)
    if len(found) > 40 * EACH:
        yield f"{place} | numbers", digest([float(number) for number in found])
        return
    yield from ((f"{place} | #{at:04d}", number) for at, number in enumerate(found))


def of_json(value: Any, place: str) -> Iterator[tuple[str, str]]:
    """The numbers of a JSON value by their keys; of a text in it, its numbers."""
    if isinstance(value, Mapping):
        for key, each in value.items():
            yield from of_json(each, f"{place}/{key}")
    elif isinstance(value, list) and len(value) > EACH and all(type(each) in (int, float) for each in value):
        yield place, digest(value)
    elif isinstance(value, list):
        for at, each in enumerate(value):
            yield from of_json(each, f"{place}/{at}")
    elif isinstance(value, str):
        yield from ((f"{place} #{at:04d}", number) for at, number in enumerate(numbers(value)))
    else:
        yield place, json.dumps(value)


def printed(text: str, place: str) -> Iterator[tuple[str, str]]:
    """The figures of what a command printed: by their keys where it is JSON."""
    try:
        value = json.loads(text)
    except ValueError:
        yield from of_text(text, place)
    else:
        yield from of_json(value, f"{place} | ")


def of_file(path: Path, place: str) -> Iterator[tuple[str, str]]:
    """The figures of a file, and that it was written."""
    yield f"{place} | written", "true"
    if path.suffix == ".html":
        text = path.read_text(encoding="utf-8")
        for name, data in re.findall(r'<script[^>]*data-name="(\w+)"[^>]*>([A-Za-z0-9+/=\s]+)</script>', text):
            yield f"{place} | {name}", hashlib.sha256(data.encode()).hexdigest()
        words = re.sub(r"<(script|style|svg)\b.*?</\1>", " ", text, flags=re.DOTALL)
        yield from of_text(re.sub(r"<[^>]*>", " ", words), place)
    elif path.suffix in (".json", ".ahap"):
        yield from of_json(json.loads(path.read_text(encoding="utf-8")), f"{place} | ")
    elif path.suffix in (".csv", ".tsv"):
        text = path.read_text(encoding="utf-8")
        lines = csv.reader(io.StringIO(text), delimiter="\t" if path.suffix == ".tsv" else ",")
        for at, cells in enumerate(zip_longest(*lines, fillvalue="")):
            named = re.fullmatch(r"[A-Za-z_][\w. ]*", cells[0]) and not numbers(cells[0])
            yield from _column(cells, f"{place} | column {cells[0] if named else at}")
    elif path.suffix == ".wav":
        samples, rate = soundfile.read(path, dtype="int32")
        yield f"{place} | samples", f"{rate} Hz {digest(samples)}"
    elif path.suffix in (".npz", ".npy"):
        loaded = np.load(path)
        arrays = dict(loaded) if path.suffix == ".npz" else {"": loaded}
        yield from ((f"{place} | {name}", digest(values)) for name, values in arrays.items() if _counts(values))
    elif h5py.is_hdf5(path):
        yield from _hdf5(path, place)
    elif path.suffix == ".mat":
        yield from ((f"{place} | {name}", digest(value)) for name, value in loadmat(path).items() if _counts(value))
    elif path.suffix not in WORDS:
        yield from of_text(path.read_text(encoding="utf-8", errors="replace"), place)


def _counts(value: Any) -> bool:
    """Whether a value holds numbers."""
    kind = getattr(value, "dtype", np.dtype(object))
    return kind.kind in "biufc" or (bool(kind.names) and all(kind[name].kind in "biufc" for name in kind.names))


def _column(cells: tuple[str, ...], place: str) -> Iterator[tuple[str, str]]:
    found = [number for cell in cells for number in numbers(cell)]
    if len(found) > EACH:
        yield place, digest([float(number) for number in found])
    else:
        yield from ((f"{place} #{at:04d}", number) for at, number in enumerate(found))


def _hdf5(path: Path, place: str) -> Iterator[tuple[str, str]]:
    with h5py.File(path, "r") as file:
        names = [""]
        file.visit(names.append)
        for name in names:
            part = file[name] if name else file
            if isinstance(part, h5py.Dataset) and _counts(part):
                yield f"{place} | {name}", digest(part[()])
            for attribute in part.attrs:
                value = part.attrs[attribute]
                if _counts(value) and not attribute.startswith("_"):
                    yield f"{place} | {name}@{attribute}", repr(np.asarray(value).tolist())


def steady(figures: Mapping[str, str]) -> dict[str, str]:
    """The figures without those that `UNSTEADY` names."""
    return {name: value for name, value in figures.items() if not any(re.search(each, name) for each in UNSTEADY)}
