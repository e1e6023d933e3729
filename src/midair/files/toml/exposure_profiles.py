"""Exposure profiles in TOML: those of midair and those of users; frozen dataclasses as nested dicts."""

import os
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache, reduce
from json import dumps
from operator import or_
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from midair.errors import BrokenFileError, InputError
from midair.files.text_files import read_toml
from midair.physics import ExposureProfile, Place
from midair.validation import check_settings, one_of, setting

if TYPE_CHECKING:
    from pydantic import TypeAdapter

Sheet = TypeVar("Sheet")
Made = TypeVar("Made")


def read_sheet(
    path: str | os.PathLike[str], expected: str, sheet: type[Sheet], make: Callable[[Sheet], Made] = lambda keys: keys
) -> Made:
    """Read a TOML file with the keys of a dataclass, and convert it by `make`; `expected` is for messages.

    A missing name is that of the file.
    Raises MissingFileError if the file does not exist; BrokenFileError if it is not TOML, or a key or value is invalid.
    """
    content = read_toml(path, expected)
    if "name" in get_type_hints(sheet):
        content.setdefault("name", Path(path).stem)
    try:
        return make(from_plain(sheet, content))
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from wrong


_SCALES = {"_mm_s": 1e-3, "_mm": 1e-3, "_deg": np.pi / 180, "_db": 1.0, "_k": 1.0}


def in_si(sheet: Any) -> dict[str, Any]:
    """Fields of a sheet that are not None, by their names without the unit: lengths in m, angles in rad."""
    found: dict[str, Any] = {}
    for name, value in ((one.name, getattr(sheet, one.name)) for one in fields(sheet)):
        end = next((end for end in _SCALES if name.endswith(end)), "")
        if end and isinstance(value, tuple):
            found[name.removesuffix(end)] = tuple(each * _SCALES[end] for each in value)
        elif value is not None:
            found[name.removesuffix(end)] = value * _SCALES[end] if end else value
    return found


def to_plain(value: Any) -> Any:
    """A frozen dataclass as a nested dict; tuples become lists, and None is omitted.

    TOML has no null, so None has to be the default of any field that may be None.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: to_plain(got) for one in fields(value) if (got := getattr(value, one.name)) is not None}
    return [to_plain(each) for each in value] if isinstance(value, tuple | list) else value


def from_plain(kind: type[Any], values: Mapping[str, Any], *, where: str = "") -> Any:
    """Create the dataclass `kind` from the output of `to_plain`; missing fields take their defaults.

    `where` is the prefix of names in messages, such as ``solver.``. Raises InputError if a name is unknown, or a value
    has the wrong type or is out of range.
    """
    hints, known = get_type_hints(kind), {one.name for one in fields(kind)}
    if unknown := sorted(set(values) - known):
        raise InputError(f"{where}{unknown[0]}: expected one of {', '.join(sorted(known))}")
    needed = [one.name for one in fields(kind) if one.init and one.default is one.default_factory is MISSING]
    if missing := [name for name in needed if name not in values]:
        raise InputError(f"{where}{missing[0]} is missing: expected {', '.join(needed)}")
    return kind(**{name: _value(hints[name], value, f"{where}{name}") for name, value in values.items()})


def _value(hint: Any, value: Any, where: str) -> Any:
    """Validate one value against its annotation; dataclasses, and tuples of them, were made from text before."""
    if all(is_dataclass(each) for each in (value if isinstance(value, tuple) and value else (value,))):
        return value
    if isinstance(value, Mapping):
        kinds = [each for each in _alternatives(hint) if is_dataclass(each) and isinstance(each, type)]
        if kinds:
            return from_plain(kinds[0], value, where=f"{where}.")
    if get_origin(hint) is tuple and is_dataclass(get_args(hint)[0]):
        if not isinstance(value, list):
            raise InputError(f"{where}: expected tables [[{where}]], got {value!r}")
        return tuple(_value(get_args(hint)[0], each, f"{where} {number}") for number, each in enumerate(value))
    # Dataclasses are excluded, because pydantic does not support those with arrays.
    plain = tuple(each for each in _alternatives(hint) if not is_dataclass(each))
    if not plain:
        raise InputError(f"{where}: expected a table, got {value!r}")
    # Importing pydantic takes a tenth of a second, and most values need no conversion.
    if (simple := _simple(plain, value)) is not None:
        return simple
    from pydantic import ValidationError

    try:
        # Strict, so that true and "4" are no numbers; from JSON, whose lists become tuples.
        return _adapter(plain).validate_json(dumps(value, default=str), strict=True)
    except ValidationError as wrong:
        raise InputError(f"{where}: expected {_kinds(plain)}, got {value!r} ({wrong.errors()[0]['msg']})") from None


def _simple(kinds: tuple[Any, ...], value: Any) -> Any:
    """A value with exactly the type of an annotation, whole numbers for floats, or tuples of these; otherwise None."""
    if type(value) in kinds or (type(value) is str and any(value in get_args(kind) for kind in kinds)):
        return value
    if type(value) is int and float in kinds and abs(value) < 2**53:
        return float(value)
    given: tuple[Any, ...] = tuple(value) if isinstance(value, list | tuple) else ()
    for parts in (get_args(kind) for kind in kinds if given and get_origin(kind) is tuple):
        each = [_simple((part,), one) for part, one in zip(parts, given, strict=False)]
        if len(parts) == len(given) and None not in each:
            return tuple(each)
    return None


@cache
def _adapter(kinds: tuple[Any, ...]) -> "TypeAdapter[Any]":
    from pydantic import TypeAdapter

    return TypeAdapter(reduce(or_, kinds))


def _alternatives(hint: Any) -> tuple[Any, ...]:
    """Members of a union at every depth, or the annotation itself."""
    if get_origin(hint) in (Union, UnionType):
        return tuple(each for part in get_args(hint) for each in _alternatives(part))
    return (hint,)


def _kinds(kinds: tuple[Any, ...]) -> str:
    parts = [
        " or ".join(str(each) for each in get_args(kind))
        if get_origin(kind) is Literal
        else (kind.__name__ if isinstance(kind, type) and not get_args(kind) else str(kind))
        for kind in kinds
        if kind is not type(None)
    ]
    return " or ".join(parts)


DEFAULT_PROFILE = "occupational-110"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceSheet:
    """Keys of a place with a limit."""

    name: str
    position_mm: tuple[float, float, float]
    reach_mm: float
    limit_db: float
    enforced: bool = True
    source: str = ""

    def __post_init__(self) -> None:
        if not np.isfinite([*self.position_mm, self.reach_mm, self.limit_db]).all() or self.reach_mm < 0:
            raise InputError(f"place {self.name}: expected finite numbers, and reach_mm from 0 on")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileSheet:
    """Keys of a profile."""

    name: str
    title: str
    source: str
    evidence: str
    place: tuple[PlaceSheet, ...]
    duty: float | None = setting(None, "", limits=(0, 1), above=True)
    warming_k: float | None = setting(None, "", unit="K", limits=(0, np.inf), above=True)
    hours: float | None = setting(None, "", unit="h", limits=(0, 24), above=True)

    def __post_init__(self) -> None:
        check_settings(self)
        if not any(each.enforced for each in self.place):
            raise InputError(f"profile {self.name}: expected at least one enforced limit, got none")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfilesSheet:
    """Keys of a file of profiles."""

    profile: tuple[ProfileSheet, ...]


def load_profiles(path: str | os.PathLike[str] | None = None) -> dict[str, ExposureProfile]:
    """Exposure profiles of a TOML file, by name and in its order; those of midair if None.

    Raises the errors of `read_sheet`.
    """

    def profiles(keys: ProfilesSheet) -> dict[str, ExposureProfile]:
        known = [in_si(each) for each in keys.profile]
        places = [tuple(Place(**in_si(place)) for place in each.pop("place")) for each in known]
        return {each["name"]: ExposureProfile(places=own, **each) for each, own in zip(known, places, strict=True)}

    file = Path(__file__).with_name("exposure.toml") if path is None else path
    return read_sheet(file, "a TOML file of exposure profiles", ProfilesSheet, profiles)


def profile_named(name: str, path: str | os.PathLike[str] | None = None) -> ExposureProfile:
    """One exposure profile; raises InputError if none has that name."""
    profiles = load_profiles(path)
    one_of(name, profiles, "exposure profile")
    return profiles[name]
