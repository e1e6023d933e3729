"""Help of a command: its group and the examples below it."""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from inspect import cleandoc
from textwrap import wrap
from types import MappingProxyType
from typing import Any

from cyclopts import App, ArgumentCollection, Group, Parameter, Token
from cyclopts.annotations import resolve_optional

_NAMES = ("Get started", "Record", "Edit", "Calibrate", "Reproduce", "Evaluate", "Research", "Help")
GROUPS: Mapping[str, Group] = MappingProxyType({name: Group(name, sort_key=at) for at, name in enumerate(_NAMES)})
"""Groups of commands in the help, in the order of the work."""

_QUANTITIES = "Quantities need a unit: 200mm, 20Hz, 0.5s, 30Pa."
_EXAMPLES = re.compile(r"\n *Examples\n *-+\n(.*?)(?=\n\n *[A-Z][a-z]+\n *-+\n|\Z)", re.DOTALL)


def add_command(app: App, command: Callable[..., Any], name: str, *, group: str | None = None) -> None:
    """Add a command to an app; the lines of its docstring's `Examples` that begin with ``$ `` appear below its help."""
    placed: Any = {} if group is None else {"group": GROUPS[group]}
    # In the order of the calls, not alphabetical.
    order = len(tuple(app))
    app.command(app_of_command(command, name, sort_key=order, **placed))


_NUMBERS = {int: "a whole number such as 3", float: "a number such as 1.5"}


def _number(kind: type, tokens: Sequence[Token]) -> object:
    """A typed number; cyclopts would round 2.5 to a whole one."""
    try:
        return kind(tokens[0].value)
    except ValueError:
        raise ValueError(f"expected {_NUMBERS[kind]}, got {tokens[0].value!r}") from None


class _Imported(App):
    """A command whose help comes from its own docstring, and whose options are described once."""

    @property
    def help(self) -> str:
        return super().help

    @help.setter
    def help(self, value: str) -> None:
        del value

    @cached_property
    def _described(self) -> dict[bool, ArgumentCollection]:
        return {}

    def assemble_argument_collection(self, *, parse_docstring: bool = False, **how: Any) -> ArgumentCollection:
        """Describe the options once, since that is slow and cyclopts asks up to three times for a line."""
        if parse_docstring not in self._described:
            made = super().assemble_argument_collection(parse_docstring=parse_docstring, **how)
            for each in made:
                if resolve_optional(each.hint) in _NUMBERS and each.parameter.converter is None:
                    each.parameter = Parameter.combine(each.parameter, Parameter(converter=_number))
            self._described[parse_docstring] = made
        first = self._described[parse_docstring]
        copies = {id(old): new for old, new in zip(first, first.copy(reset_tokens=True), strict=True)}
        for new in copies.values():
            new.children = ArgumentCollection(copies[id(child)] for child in new.children)
        return ArgumentCollection(copies.values())


def app_of_command(command: Callable[..., Any], name: str, **placed: Any) -> App:
    """The app of a command that is added to another app by its import path."""
    made = _Imported(name=name, help_epilogue=epilogue(examples_of(command)), **placed)
    made.default(command)
    return made


def examples_of(command: Callable[..., Any]) -> tuple[str, ...]:
    """Examples in the docstring of a command, without the prompt."""
    found = _EXAMPLES.search("\n" + cleandoc(command.__doc__ or ""))
    lines = found.group(1).splitlines() if found else []
    return tuple(line.strip().removeprefix("$ ") for line in lines if line.strip().startswith("$ "))


def epilogue(examples: tuple[str, ...]) -> str:
    """Text below the help of a command with these examples."""
    if not examples:
        return _QUANTITIES
    title = "Example:" if len(examples) == 1 else "Examples:"
    # Broken into shell lines that fit 80 columns.
    parts = (wrap(line, 70, initial_indent="  ", break_long_words=False, break_on_hyphens=False) for line in examples)
    return "\n".join([title, *(" \\\n      ".join(lines) for lines in parts), "", _QUANTITIES])
