"""Convert frozen dataclasses to nested dicts and back, with clear errors for invalid values."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import reduce
from operator import or_
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from midair.errors import InputError


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
    made = {name: _value(hints[name], value, f"{where}{name}") for name, value in values.items()}
    try:
        return kind(**made)
    except TypeError as wrong:
        raise InputError(f"{where.rstrip('.') or kind.__name__}: {wrong}") from None


def _value(hint: Any, value: Any, where: str) -> Any:
    """Validate one value against its annotation; dataclasses, and tuples of them, were made from text before."""
    if all(is_dataclass(each) for each in (value if isinstance(value, tuple) and value else (value,))):
        return value
    if isinstance(value, Mapping):
        kinds = [each for each in _alternatives(hint) if is_dataclass(each) and isinstance(each, type)]
        if kinds:
            return from_plain(kinds[0], value, where=f"{where}.")
    from pydantic import TypeAdapter, ValidationError

    # Dataclasses are excluded, because pydantic does not support those with arrays.
    plain = tuple(each for each in _alternatives(hint) if not is_dataclass(each))
    if not plain:
        raise InputError(f"{where}: expected a table, got {value!r}")
    try:
        return TypeAdapter[Any](reduce(or_, plain)).validate_python(value)
    except ValidationError as wrong:
        raise InputError(f"{where}: expected {_kinds(plain)}, got {value!r} ({wrong.errors()[0]['msg']})") from None


def _alternatives(hint: Any) -> tuple[Any, ...]:
    """Members of a union at every depth, or the annotation itself."""
    if get_origin(hint) in (Union, UnionType):
        return tuple(each for part in get_args(hint) for each in _alternatives(part))
    return (hint,)


def _kinds(kinds: tuple[Any, ...]) -> str:
    parts = [
        " or ".join(str(each) for each in get_args(kind)) if get_origin(kind) is Literal else _name(kind)
        for kind in kinds
        if kind is not type(None)
    ]
    return " or ".join(parts)


def _name(kind: Any) -> str:
    return kind.__name__ if isinstance(kind, type) and not get_args(kind) else str(kind)
