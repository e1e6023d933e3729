"""Convert provenance to JSON and back without loss of types."""

import json
import math
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np

from midair.errors import BrokenFileError, InputError
from midair.files.text_files import json_of
from midair.model import Provenance, Setting, Step

T = TypeVar("T")


def to_json(provenance: Provenance) -> str:
    """One line of ASCII for `from_json`.

    Tuples become lists, which are not used otherwise; infinity and NaN, which JSON lacks, become {"float": "inf"}.
    Raises InputError if a setting has a type that is not in `Setting`.
    """
    return json.dumps(to_plain(provenance), allow_nan=False)


def from_json(text: str) -> Provenance:
    """The provenance written by `to_json`; raises BrokenFileError for other text."""
    try:
        return from_plain(json_of(text))
    except ValueError as wrong:
        raise BrokenFileError("expected a provenance in JSON, got other text") from wrong


def to_plain(provenance: Provenance) -> dict[str, Any]:
    """Provenance as nested dicts and lists for JSON."""
    return {
        "source": provenance.source,
        "simulated": provenance.simulated,
        "notes": dict(provenance.notes),
        "steps": [
            {"stage": step.stage, "settings": {name: _encode(name, value) for name, value in step.settings.items()}}
            for step in provenance.steps
        ],
    }


def from_plain(plain: object) -> Provenance:
    """Provenance from the output of `to_plain`; raises BrokenFileError if a part is missing or has the wrong type."""
    parts = _checked(plain, dict, "provenance")
    notes = _checked(parts.get("notes"), dict, "notes")
    return Provenance(
        source=_checked(parts.get("source"), str, "source"),
        simulated=_checked(parts.get("simulated"), bool, "simulated"),
        notes={name: _checked(note, str, f"note {name}") for name, note in notes.items()},
        steps=tuple(_step(_checked(step, dict, "step")) for step in _checked(parts.get("steps"), list, "steps")),
    )


def _step(parts: Mapping[str, Any]) -> Step:
    settings = _checked(parts.get("settings"), dict, "settings")
    stage = _checked(parts.get("stage"), str, "stage")
    return Step(stage=stage, settings={name: _decode(value) for name, value in settings.items()})


def _encode(name: str, value: object) -> object:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return {"float": repr(float(value))}
    if isinstance(value, tuple):
        return [_encode(name, part) for part in value]
    if value is None or isinstance(value, str | int | float):
        return value
    raise InputError(
        f"setting {name}: expected text, a number, a truth value, None or a tuple, got {type(value).__name__}"
    )


def _decode(value: object) -> Setting:
    if isinstance(value, list):
        return tuple(_decode(part) for part in value)
    if isinstance(value, dict):
        return float(_checked(value.get("float"), str, "setting"))
    if value is None or isinstance(value, str | int | float):
        return value
    raise BrokenFileError(f"provenance, setting: expected JSON of midair, got {type(value).__name__}")


_WORDS: Mapping[type, str] = {str: "text", bool: "true or false", dict: "a JSON object", list: "a list"}


def _checked(value: object, kind: type[T], name: str) -> T:
    if not isinstance(value, kind):
        raise BrokenFileError(f"provenance, {name}: expected {_WORDS[kind]}, got {type(value).__name__}")
    return value
