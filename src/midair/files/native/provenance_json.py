"""Convert provenance to JSON and back without loss of types."""

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from midair.errors import BrokenFileError, InputError
from midair.files.text_files import json_of
from midair.model import Provenance, Setting, Step


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
    parts = _mapping(plain, "provenance")
    notes = _mapping(parts.get("notes"), "notes")
    steps = parts.get("steps")
    if not isinstance(steps, list):
        raise BrokenFileError(f"provenance, steps: expected a list, got {type(steps).__name__}")
    return Provenance(
        source=_text(parts.get("source"), "source"),
        simulated=_boolean(parts.get("simulated")),
        notes={name: _text(note, f"note {name}") for name, note in notes.items()},
        steps=tuple(_step(step) for step in steps),
    )


def _step(plain: object) -> Step:
    parts = _mapping(plain, "step")
    settings = _mapping(parts.get("settings"), "settings")
    return Step(stage=_text(parts.get("stage"), "stage"), settings={k: _decode(v) for k, v in settings.items()})


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
        return float(_text(_mapping(value, "setting").get("float"), "setting"))
    if value is None or isinstance(value, str | int | float):
        return value
    raise BrokenFileError(f"provenance, setting: expected JSON of midair, got {type(value).__name__}")


def _mapping(value: object, name: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise BrokenFileError(f"provenance, {name}: expected a JSON object, got {type(value).__name__}")
    return value


def _text(value: object, name: str) -> str:
    if not isinstance(value, str):
        raise BrokenFileError(f"provenance, {name}: expected text, got {type(value).__name__}")
    return value


def _boolean(value: object) -> bool:
    if not isinstance(value, bool):
        raise BrokenFileError(f"provenance, simulated: expected true or false, got {value!r}")
    return value
