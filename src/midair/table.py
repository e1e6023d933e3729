"""Tables of names and values, which commands print on a terminal or as JSON."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import KW_ONLY, dataclass
from functools import singledispatch
from typing import Any


@dataclass(frozen=True, slots=True)
class Row:
    """A value with its name."""

    name: str
    value: object
    _: KW_ONLY
    key: str = ""
    """Name in JSON; by default `name`."""
    text: str | None = None
    """The value as a person reads it, with its unit; by default the value alone."""


class Details(tuple["Line", ...]):
    """Lines that are printed only with all others, by ``--all``; JSON contains them."""


Line = Row | tuple[str, str] | Mapping[str, object] | Details | Callable[[], Details]
"""A row, or a name and a text that are printed only, or values that are in JSON only, or details, or a function that
computes details, which is called only where they are needed."""


@singledispatch
def describe(thing: Any) -> list[Line]:
    """The table of what a command prints; registered for each type beside its command."""
    raise TypeError(type(thing))


def printed(table: Iterable[Line], *, all: bool = False) -> list[tuple[str, str]]:
    """Name and text of each row of a table that is printed; a row without a text is not."""
    rows: list[tuple[str, str]] = []
    for line in table:
        if isinstance(line, Details):
            rows += printed(line, all=True) if all else []
        elif isinstance(line, Row):
            rows.append((line.name, str(line.value) if line.text is None else line.text))
        elif isinstance(line, tuple):
            rows.append(line)
        elif not isinstance(line, Mapping):
            rows += printed(line(), all=True) if all else []
    return [(name, text) for name, text in rows if text]


def plain(table: Iterable[Line]) -> dict[str, object]:
    """The values of a table by their names in JSON."""
    values: dict[str, object] = {}
    for line in table:
        if isinstance(line, Details):
            values |= plain(line)
        elif isinstance(line, Row):
            values[line.key or line.name] = line.value
        elif isinstance(line, Mapping):
            values.update(line)
        elif not isinstance(line, tuple):
            values |= plain(line())
    return values
