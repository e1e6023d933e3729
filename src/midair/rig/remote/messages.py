"""The messages of clients, declared once: JSON objects with the key "do", or OSC messages /midair/DO.

The values of an OSC message are the key of the server, then the fields in their order. docs/remote.md describes all.
"""

import struct
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model
from pydantic_core import from_json

from midair.devices import osc_messages
from midair.errors import InputError

_FILE = (str, Field(min_length=1, max_length=200))
_FIELDS: dict[str, dict[str, Any]] = {
    **{name: {} for name in ("list", "control", "release", "stop")},
    "load": {"file": _FILE, "duration": (float | None, Field(None, gt=0, le=60)), "follow": (bool, False)},
    "play": {"file": _FILE, "repeats": (int, Field(1, ge=0, le=1_000_000))},
    "level": {"level": (float, Field(ge=0, le=1))},
    "palm": {"pose": (list[float], Field(min_length=9, max_length=9)), "confidence": (float, Field(1.0, ge=0, le=1))},
}
_RULES = ConfigDict(extra="forbid", allow_inf_nan=False)
MESSAGES: dict[str, type[BaseModel]] = {
    name: create_model(name, __config__=_RULES, **fields) for name, fields in _FIELDS.items()
}
"""Fields of all messages by name."""


def read_json(text: str | bytes) -> tuple[str, Any]:
    """Name and fields of a message in JSON; InputError if it is none."""
    try:
        found = from_json(text)
    except ValueError:
        raise InputError("expected JSON, got other text") from None
    found = found if isinstance(found, dict) else {}
    return _read(found.pop("do", None), found, strict=True)


def read_osc(packet: bytes) -> Iterator[tuple[str, str, Any]]:
    """Key, name and fields of each message of an OSC packet; InputError if one is none."""
    try:
        found = [(address.removeprefix("/midair/"), values or [""]) for _, address, values in osc_messages(packet)]
    except (ValueError, struct.error, IndexError):
        raise InputError("expected OSC 1.0, got other bytes") from None
    for name, (key, *given) in found:
        rest = [given[:9], *given[9:]] if name == "palm" else given
        # A value too many gets the name of no field.
        names = [*_FIELDS.get(name, ()), *map(str, range(len(rest)))]
        yield str(key), *_read(name, dict(zip(names, rest, strict=False)), strict=False)


def osc_packet(address: str, *values: float | str) -> bytes:
    """An OSC message with numbers and texts."""

    def packed(value: float | str) -> bytes:
        raw = value.encode("ascii", "replace") if isinstance(value, str) else b""
        return raw + bytes(4 - len(raw) % 4) if isinstance(value, str) else struct.pack(">f", value)

    tags = "," + "".join("s" if isinstance(each, str) else "f" for each in values)
    return b"".join(packed(each) for each in (address, tags, *values))


def _read(name: Any, fields: dict[str, Any], *, strict: bool) -> tuple[str, Any]:
    if not isinstance(name, str) or name not in MESSAGES:
        raise InputError(f"do: expected {', '.join(MESSAGES)}, got {repr(name)[:60]}")
    try:
        return name, MESSAGES[name].model_validate(fields, strict=strict)
    except ValidationError as wrong:
        first = wrong.errors(include_url=False, include_context=False)[0]
        where, got = ".".join(map(str, first["loc"])), repr(first["input"])
        raise InputError(f"{name}: {where[:60]}: {first['msg'][:100]}, got {got[:60]}") from None
