"""Messages of clients as JSON and as OSC (docs/remote.md): reading and checking them."""

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


def read_osc(packet: bytes) -> Iterator[tuple[float | None, str, str, BaseModel]]:
    """Time since 1970, key, name and fields of each message /midair/NAME in an OSC packet; InputError if one is bad."""
    for stamp, address, values in osc_messages(packet):
        name, (key, *given) = address.removeprefix("/midair/"), values or [""]
        rest = [given[:9], *given[9:]] if name == "palm" else given
        kinds = MESSAGES.get(name, BaseModel).model_fields
        # A value too many gets the name of no field.
        fields = dict(zip([*kinds, *map(str, range(len(rest)))], rest, strict=False))
        for (field, kind), value in zip(kinds.items(), rest, strict=False):
            # A number that is read laxly would take a boolean for 0 or 1.
            if kind.annotation is not bool and bool in map(type, value if isinstance(value, list) else [value]):
                raise InputError(f"{name}: {field}: expected no boolean, got {value!r}")
        yield stamp, str(key), *checked(name, fields, strict=False)


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
