"""All commands by name, one module each; a module is imported only when its command or its help is called."""

import re
import tomllib
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

from cyclopts import App

from midair.cli.help_text import app_of_command

_STORED = tomllib.loads(Path(__file__).with_name("commands.toml").read_text(encoding="utf-8"))

COMMANDS: Mapping[str, tuple[str, str]] = {
    name: (group, module) for group, listed in _STORED["commands"].items() for name, module in listed.items()
}
"""For each command: its group in `help_text.GROUPS`, and the module of its function `NAME_command`."""

FOLDERS: Mapping[str, tuple[str, str]] = {name: (one["group"], one["help"]) for name, one in _STORED["folders"].items()}
"""Commands with subcommands: group and help."""


def summary_of(name: str) -> str:
    """First paragraph of a command's docstring, read from the source so that `midair --help` imports no command."""
    source = Path(__file__).with_name(f"{COMMANDS[name][1]}.py").read_text(encoding="utf-8")
    found = re.search(rf'^def {name}_command\(.*?^    """(.+?)(?:\n\n|""")', source, re.DOTALL | re.MULTILINE)
    return "" if found is None else " ".join(found[1].split())


def __getattr__(name: str) -> App:
    """Import a command and return its app, for names such as `solve_app`."""
    typed = name.removesuffix("_app")
    if typed == name or typed not in COMMANDS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = import_module(f"{__name__}.{COMMANDS[typed][1]}")
    return app_of_command(getattr(module, f"{typed}_command"), typed)
