"""Help of a command: its group and the examples below it."""

import re
from collections.abc import Callable, Mapping
from inspect import cleandoc
from textwrap import wrap
from types import MappingProxyType
from typing import Any

from cyclopts import App, Group

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
    app.command(command, name=name, sort_key=order, help_epilogue=epilogue(examples_of(command)), **placed)


class _Imported(App):
    """A command whose help comes from its own docstring, not from the app that it is added to."""

    @property
    def help(self) -> str:
        return super().help

    @help.setter
    def help(self, value: str) -> None:
        del value


def app_of_command(command: Callable[..., Any], name: str) -> App:
    """The app of a command that is added to another app by its import path."""
    made = _Imported(name=name, help_epilogue=epilogue(examples_of(command)))
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
