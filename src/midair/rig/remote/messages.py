"""Messages of clients as JSON and as OSC (docs/remote.md): reading and checking them."""

import struct
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import from_json

from midair.devices import osc_messages
from midair.errors import InputError


class Message(BaseModel):
    """A message; the names and the order of its fields are those of JSON and OSC."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class OfFile(Message):
    """A message about a file of the folder."""

    file: str = Field(min_length=1, max_length=200)


class Load(OfFile):
    """Read or draw a file and check it."""

    duration: float | None = Field(None, gt=0, le=60)
    follow: bool = False


class Play(OfFile):
    """Play a loaded file."""

    repeats: int = Field(1, ge=0, le=1_000_000)


class Parameter(OfFile):
    """Change a named parameter of a loaded pattern."""

    name: str = Field(max_length=200)
    value: float


class Level(Message):
    """Set the level of all that plays."""

    level: float = Field(ge=0, le=1)


class Palm(Message):
    """Report the pose of the palm."""

    pose: list[float] = Field(min_length=9, max_length=9)
    confidence: float = Field(1.0, ge=0, le=1)


MESSAGES: dict[str, type[Message]] = {
    **dict.fromkeys(("list", "control", "release", "stop"), Message),
    **{"load": Load, "play": Play, "parameter": Parameter, "level": Level, "palm": Palm},
}
"""All messages by their name."""


def read_json(text: str | bytes) -> tuple[str, Message]:
    """Name, under the key "do", and fields of a message in JSON; InputError if it is none."""
    found: Any = None
    with suppress(ValueError):
        found = from_json(text)
    if not isinstance(found, dict):
        raise InputError("expected an object in JSON, got other text")
    return _read(found.pop("do", None), found, strict=True)


def read_osc(packet: bytes) -> Iterator[tuple[str, str, Message]]:
    """Key, name and fields of each message /midair/NAME of an OSC packet; InputError if one is none."""
    try:
        found = [(address.removeprefix("/midair/"), values or [""]) for _, address, values in osc_messages(packet)]
    except (ValueError, struct.error, IndexError):
        raise InputError("expected OSC 1.0, got other bytes") from None
    for name, (key, *given) in found:
        rest = [given[:9], *given[9:]] if name == "palm" else given
        # A value too many gets the name of no field.
        names = [*MESSAGES.get(name, Message).model_fields, *map(str, range(len(rest)))]
        yield str(key), *_read(name, dict(zip(names, rest, strict=False)), strict=False)


def osc_packet(address: str, *values: float | str) -> bytes:
    """An OSC message with numbers and texts."""
    tags = "," + "".join("s" if isinstance(each, str) else "f" for each in values)
    raw = [each.encode("ascii", "replace") if isinstance(each, str) else each for each in (address, tags, *values)]
    return b"".join(e + bytes(4 - len(e) % 4) if isinstance(e, bytes) else struct.pack(">f", e) for e in raw)


def _read(name: Any, fields: dict[str, Any], *, strict: bool) -> tuple[str, Message]:
    if not isinstance(name, str) or name not in MESSAGES:
        raise InputError(f"do: expected {', '.join(MESSAGES)}, got {repr(name)[:60]}")
    try:
        return name, MESSAGES[name].model_validate(fields, strict=strict)
    except ValidationError as wrong:
        first = wrong.errors(include_url=False, include_context=False)[0]
        where, got = ".".join(map(str, first["loc"])), repr(first["input"])
        raise InputError(f"{name}: {where[:60]}: {first['msg'][:100]}, got {got[:60]}") from None
