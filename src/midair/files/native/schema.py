"""Schema of midair's files: what is stored of each object, its dimensions, type and unit, for writers and readers."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_type_hints

import numpy as np

from midair.files.native.provenance_json import from_json, to_json
from midair.model import EventKind, Provenance, Status
from midair.version import __version__

Kind = Literal["recording", "calibration", "pressure", "drive", "array", "played"]
"""Content of a file or group."""

FORMAT = 1
"""Version of the schema; it increases when an older reader would misread a file."""

Made = TypeVar("Made")


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A stored attribute or dataset."""

    name: str
    of: str = ""
    """Attribute of the stored object, such as ``sensor.pitch``, ``response.real`` or ``band.0``; empty for none."""
    what: str
    """Meaning in a few words; ``long_name`` of a dataset."""
    dtype: Literal["f8", "i8", "i1", "u1", "text"] = "f8"
    """Little-endian; text is UTF-8 of fixed length, so that the checksum of HDF5 metadata covers it."""
    dimensions: tuple[str, ...] | None = None
    """Axes of a dataset; None for an attribute."""
    unit: str = ""
    """Attribute `units` of a dataset, "1" for a pure number, ``{unit}`` for the unit of the sensor's output; empty for
    attributes, whose names contain it."""
    required: bool = True
    single: bool = False
    """Whether it is stored as f4 if that holds every number."""
    packed: bool = False
    """Whether it is compressed, with its axes in reverse order: time last."""

    @property
    def coordinate(self) -> bool:
        """True if it holds the coordinates of the axis of the same name."""
        return self.dimensions == (self.name,)

    @property
    def counts(self) -> bool:
        """True for the coordinates 0, 1, 2 ... of an axis; the object has their number."""
        return self.coordinate and self.dtype == "i8"

    @property
    def part(self) -> str:
        """The part of the object that it belongs to, such as ``sensor``; "" for the object itself."""
        return self.of.rpartition(".")[0]


BLOCK = 128
"""Number of frames in a compressed chunk."""

_STORED = tomllib.loads(Path(__file__).with_name("schema.toml").read_text(encoding="utf-8"))


def _entries(listed: Iterable[Any]) -> Iterator[Entry]:
    """Entries of a list of the file, in which a name stands for a part."""
    for one in listed:
        if isinstance(one, str):
            yield from _entries(_STORED["part"][one])
        else:
            axes = tuple(one["dimensions"].split()) if "dimensions" in one else None
            own = "" if axes == (one["name"],) else one["name"]
            fields: dict[str, Any] = {"of": own, **one, "dimensions": axes}
            yield Entry(**fields)


TABLE: Mapping[Kind, tuple[Entry, ...]] = {kind: tuple(_entries(listed)) for kind, listed in _STORED["kind"].items()}
"""Entries of each kind."""

PACKED = frozenset(entry.name for entries in TABLE.values() for entry in entries if entry.packed)
"""Names of the compressed datasets."""

FLAGS = {"event_kind": get_args(EventKind), "status": get_args(Status)}
"""Meanings of the numbers 0, 1, 2 ... of a dataset."""

PLAYED = ("phase_steps", "intensity", "instant", "state")
"""Values of a frame of live touch."""


def stored_values(kind: Kind, what: object) -> dict[str, Any]:
    """Stored values of an object, without those that are None, and the signature that every file and group has.

    A list of objects, such as events, is stored as one list for each attribute.
    """
    values: dict[str, Any] = {
        "kind": f"midair {kind}",
        "format": FORMAT,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "created_by": f"midair {__version__}",
    }
    for entry in TABLE[kind]:
        value: Any = _attribute(what, entry.of.split(".")) if entry.of else None
        if isinstance(value, Provenance):
            value = to_json(value)
        if value is not None and entry.name in FLAGS:
            value = [FLAGS[entry.name].index(each) for each in value]
        if value is not None:
            values[entry.name] = np.arange(value) if entry.counts else value
    return values


def _attribute(value: Any, names: Sequence[str]) -> Any:
    for at, name in enumerate(names):
        if isinstance(value, list | tuple) and not name.isdecimal():
            return [_attribute(each, names[at:]) for each in value] or None
        value = value[int(name)] if value is not None and name.isdecimal() else getattr(value, name, None)
    return value


def built(made: type[Made], kind: Kind, values: Mapping[str, Any], part: str = "", **more: Any) -> Made:
    """Build an object, or the `part` of one, from its stored values; `more` are fields that are not stored as such."""
    return _built(made, {**_parts(kind, values, part), **more})


def built_rows(made: type[Made], kind: Kind, values: Mapping[str, Any], part: str) -> tuple[Made, ...]:
    """Build the objects whose attributes are stored as rows."""

    def row(columns: Any, i: int) -> Any:
        if isinstance(columns, dict):
            return {key: row(each, i) for key, each in columns.items()}
        return columns[i].item() if isinstance(columns, np.ndarray) else columns[i]

    columns = _parts(kind, values, part)
    return tuple(_built(made, row(columns, i)) for i in range(len(columns.get(next(iter(_hints(made))), ()))))


def _parts(kind: Kind, values: Mapping[str, Any], part: str) -> dict[str, Any]:
    """Stored values by attribute, at every depth."""
    found: dict[str, Any] = {}
    for entry in TABLE[kind]:
        if entry.name in values and entry.of.startswith(part):
            *folders, last = entry.of.removeprefix(f"{part}.").split(".")
            place = found
            for folder in folders:
                place = place.setdefault(folder, {})
            value = values[entry.name]
            if names := FLAGS.get(entry.name):
                value = tuple(names[i] for i in value)
            place[last] = len(value) if entry.counts else value
    return found


def _built(made: type[Made], found: Mapping[str, Any]) -> Made:
    hints = _hints(made)
    return made(**{name: _value(hints[name], value) for name, value in found.items() if name in hints})


@cache
def _hints(made: type[Any]) -> dict[str, Any]:
    """Types of the fields of a dataclass."""
    hints = get_type_hints(made)
    return {one.name: hints[one.name] for one in fields(made) if one.init}


def _value(hint: Any, value: Any) -> Any:
    """A value of a field: complex numbers, tuples and dataclasses are stored in parts."""
    if hint is Provenance and isinstance(value, str):
        return from_json(value)
    if not isinstance(value, dict):
        return value
    if "real" in value:
        return value["real"] + 1j * value["imag"]
    if "0" in value:
        return tuple(value.values())
    (made,) = (kind for kind in (hint, *get_args(hint)) if is_dataclass(kind))
    return _built(made, value)


def single(samples: np.ndarray) -> np.ndarray:
    """Samples as float32 if that is lossless, otherwise unchanged."""
    with np.errstate(over="ignore"):
        small = samples.astype(np.float32)
    return small if np.array_equal(small, samples) else samples
