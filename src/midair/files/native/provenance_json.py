"""Convert provenance to JSON and back without loss of types."""

import json
import math
from typing import Any

import numpy as np

from midair.errors import BrokenFileError, InputError
from midair.files.atomic import reason
from midair.files.text_files import json_of
from midair.model import Provenance, Setting, Step


def to_json(provenance: Provenance) -> str:
    """One line of ASCII for `from_json`.

    Tuples become lists, which are not used otherwise; infinity and NaN, which JSON lacks, become {"float": "inf"}.
    Raises InputError if a setting has a type that is not in `Setting`.
    """
    plain = {
        "source": provenance.source,
        "simulated": provenance.simulated,
        "notes": dict(provenance.notes),
        "steps": [
            {"stage": step.stage, "settings": {name: _encode(name, value) for name, value in step.settings.items()}}
            for step in provenance.steps
        ],
    }
    return json.dumps(plain, allow_nan=False)


def from_json(text: str) -> Provenance:
    """The provenance written by `to_json`; raises BrokenFileError for other text."""
    try:
        plain = json_of(text)
        source, simulated, notes, listed = (plain[name] for name in ("source", "simulated", "notes", "steps"))
        decoded = [{name: _decode(each) for name, each in one["settings"].items()} for one in listed]
        steps = tuple(Step(stage=one["stage"], settings=own) for one, own in zip(listed, decoded, strict=True))
        texts = {type(text) for text in (source, *notes.values(), *(step.stage for step in steps))}
    except KeyError as missing:
        raise BrokenFileError(f"provenance: expected {missing.args[0]}, got none") from missing
    except (TypeError, AttributeError, ValueError) as wrong:
        raise BrokenFileError(f"expected a provenance in JSON, got {reason(wrong)}") from wrong
    if texts != {str} or (type(simulated), type(notes), type(listed)) != (bool, dict, list):
        raise BrokenFileError("expected a provenance of midair, got parts of other types")
    return Provenance(source=source, simulated=simulated, notes=notes, steps=steps)


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


def _decode(value: Any) -> Setting:
    if isinstance(value, list):
        return tuple(map(_decode, value))
    return float(value["float"]) if isinstance(value, dict) else value
