"""Messages of clients as JSON and as OSC (docs/remote.md): reading and checking them."""

import struct
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model
from pydantic_core import from_json

from midair.devices import osc_messages
from midair.errors import InputError


def models(extra: Literal["forbid", "ignore"], fields: Mapping[str, Any]) -> dict[str, type[BaseModel]]:
    """Models of messages by name, from the type and the default or limits of each field."""
    rules = ConfigDict(extra=extra, allow_inf_nan=False)
    return {name: create_model(name, __config__=rules, **each) for name, each in fields.items()}


_FILE = (str, Field(min_length=1, max_length=200))
_POSE, _SHARE = Field(min_length=9, max_length=9), Field(ge=0, le=1)
MESSAGES = models(
    "forbid",
    {
        **{name: {} for name in ("list", "control", "release", "stop")},
        "load": {"file": _FILE, "duration": (float | None, Field(None, gt=0, le=60)), "follow": (bool, False)},
        "play": {"file": _FILE, "repeats": (int, Field(1, ge=0, le=1_000_000))},
        "parameter": {"file": _FILE, "name": (str, Field(max_length=200)), "value": (float, ...)},
        "level": {"level": (float, _SHARE)},
        "palm": {
            "pose": (list[float], Field(min_length=9, max_length=9)),
            "confidence": (Annotated[float, _SHARE], 1.0),
        },
    },
)
"""All messages of clients by name; fields have the order of OSC."""


def read_json(text: str | bytes) -> tuple[str, BaseModel]:
    """Name, under the key "do", and fields of a message in JSON; InputError if it is none."""
    return checked((found := object_of(text)).pop("do", None), found, strict=True)


def object_of(text: str | bytes) -> dict[str, Any]:
    """An object in JSON; InputError if it is none."""
    with suppress(ValueError):
        if isinstance(found := from_json(text), dict):
            return found
    raise InputError("expected an object in JSON, got other text")


def read_osc(packet: bytes) -> Iterator[tuple[str, str, BaseModel]]:
    """Key, name and fields of each message /midair/NAME of an OSC packet; InputError if one is none."""
    try:
        found = [(address.removeprefix("/midair/"), values or [""]) for _, address, values in osc_messages(packet)]
    except (ValueError, struct.error, IndexError):
        raise InputError("expected OSC 1.0, got other bytes") from None
    for name, (key, *given) in found:
        rest = [given[:9], *given[9:]] if name == "palm" else given
        # A value too many gets the name of no field.
        names = [*MESSAGES.get(name, BaseModel).model_fields, *map(str, range(len(rest)))]
        yield str(key), *checked(name, dict(zip(names, rest, strict=False)), strict=False)


def osc_packet(address: str, *values: float | str) -> bytes:
    """An OSC message with numbers and texts."""
    tags = "," + "".join("s" if isinstance(each, str) else "f" for each in values)
    raw = [each.encode("ascii", "replace") if isinstance(each, str) else each for each in (address, tags, *values)]
    return b"".join(e + bytes(4 - len(e) % 4) if isinstance(e, bytes) else struct.pack(">f", e) for e in raw)


def checked(
    name: Any, fields: Any, known: Mapping[str, type[BaseModel]] = MESSAGES, *, strict: bool
) -> tuple[str, BaseModel]:
    """Name and fields of one of the known messages; InputError if it is none."""
    if not isinstance(name, str) or name not in known:
        raise InputError(f"message: expected {', '.join(known)}, got {repr(name)[:60]}")
    try:
        return name, known[name].model_validate(fields, strict=strict)
    except ValidationError as wrong:
        first = wrong.errors(include_url=False, include_context=False)[0]
        where, got = ".".join(map(str, first["loc"])), repr(first["input"])
        raise InputError(f"{name}: {where[:60]}: {first['msg'][:100]}, got {got[:60]}") from None
