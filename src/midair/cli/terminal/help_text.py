"""How a command is put before people: its place in the order of the work, and examples below its help."""

import re
from collections.abc import Callable, Mapping
from inspect import cleandoc
from textwrap import wrap
from types import MappingProxyType
from typing import Any

from cyclopts import App, Group

_NAMES = ("Begin", "Record", "Edit", "Calibrate", "Reproduce", "Judge", "Research", "Help")
GROUPS: Mapping[str, Group] = MappingProxyType({name: Group(name, sort_key=at) for at, name in enumerate(_NAMES)})
"""Of commands, in the order of the work."""

_QUANTITIES = "Quantities take units: 200mm, 20Hz, 0.5s, 30Pa."
_EXAMPLES = re.compile(r"\n *Examples\n *-+\n(.*?)(?=\n\n *[A-Z][a-z]+\n *-+\n|\Z)", re.DOTALL)


def offer(app: App, command: Callable[..., Any], name: str, *, group: str | None = None) -> None:
    """Put a command into an app, with the examples of its docstring below its help.

    Parameters
    ----------
    app : App
        Into which.
    command : callable
        With a numpy docstring; lines of its section `Examples` that begin with ``$ `` are what a person can type.
    name : str
        By which people call it.
    group : str, optional
        One of `GROUPS`.
    """
    placed: Any = {} if group is None else {"group": GROUPS[group]}
    # Below each other as they were offered, and not by the alphabet.
    order = len(tuple(app))
    app.command(command, name=name, sort_key=order, help_epilogue=epilogue(examples_of(command)), **placed)


class _Imported(App):
    """A command with its own help, whatever line stood for it before it was imported."""

    @property
    def help(self) -> str:
        return super().help

    @help.setter
    def help(self, value: str) -> None:
        del value


def imported(command: Callable[..., Any], name: str) -> App:
    """A command as `offer` puts it into an app, for one that is put there by its path."""
    made = _Imported(name=name, help_epilogue=epilogue(examples_of(command)))
    made.default(command)
    return made


def examples_of(command: Callable[..., Any]) -> tuple[str, ...]:
    """What the docstring of a command gives as examples, without the prompt."""
    found = _EXAMPLES.search("\n" + cleandoc(command.__doc__ or ""))
    lines = found.group(1).splitlines() if found else []
    return tuple(line.strip().removeprefix("$ ") for line in lines if line.strip().startswith("$ "))


def epilogue(examples: tuple[str, ...]) -> str:
    """What stands below the help of a command with these examples."""
    if not examples:
        return _QUANTITIES
    title = "Example:" if len(examples) == 1 else "Examples:"
    return "\n".join([title, *(_in_lines(line) for line in examples), "", _QUANTITIES])


def _in_lines(example: str) -> str:
    """An example that can be copied from a terminal of 80 columns: broken as a shell takes it."""
    return " \\\n      ".join(wrap(example, 70, initial_indent="  ", break_long_words=False, break_on_hyphens=False))
