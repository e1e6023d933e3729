"""Compare the settings of a store with those of a sweep."""

from collections.abc import Mapping
from typing import Any

from midair.errors import MismatchError
from midair.files import parse_errors
from midair.sweep.task import Sweep


def check_settings(path: object, attrs: Mapping[str, Any], sweep: Sweep) -> None:
    """Raise a MismatchError that names the first different setting, or a BrokenFileError without settings."""
    with parse_errors(str(path), "a sweep of midair"):
        stored = dict(attrs["settings"]) | {"kind": attrs["kind"]}
        asked = sweep.settings() | {"kind": sweep.kind}
    different = _difference(stored, asked)
    if different is not None:
        name, there, wanted = different
        raise MismatchError(
            f"{path}: expected {name} {wanted}, got a sweep with {there}; use its settings to continue it, or a new "
            "name"
        )


def _difference(stored: Any, asked: Any, name: str = "") -> tuple[str, str, str] | None:
    """Name and both values of the first setting that differs."""
    if isinstance(stored, Mapping) and isinstance(asked, Mapping):
        pairs = [(str(key), stored.get(key), asked.get(key)) for key in sorted({*stored, *asked})]
    elif isinstance(stored, list) and isinstance(asked, list) and len(stored) == len(asked):
        pairs = [(str(number), *pair) for number, pair in enumerate(zip(stored, asked, strict=True))]
    elif stored == asked:
        return None
    else:
        return name, _short(stored), _short(asked)
    found = (_difference(there, wanted, f"{name} {key}".strip()) for key, there, wanted in pairs)
    return next((one for one in found if one is not None), None)


def _short(value: Any) -> str:
    """Text of a value; long lists and mappings are replaced by their length."""
    return f"{len(value)} of them" if isinstance(value, list | Mapping) and len(str(value)) > 80 else str(value)
