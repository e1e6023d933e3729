"""All commands by name, one module each; a module is imported only when its command or its help is called."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path

from cyclopts import App

from midair.cli.help_text import app_of_command
from midair.lazy import defer_numpy_tools

GROUPED: Mapping[str, Sequence[str]] = {
    "Get started": ("demo", "gallery", "studio", "doctor"),
    "Record": ("record", "import", "identify", "repair"),
    "Edit": ("info", "show", "cut", "trim", "join", "gain", "fade", "mask", "resample", "export"),
    "Reproduce": ("draw", "solve", "exposure", "play", "stop", "live", "loop"),
    "Evaluate": ("compare", "budget"),
    "Research": ("paper",),
}
"""The commands without subcommands in the order of the help, by its groups."""

_SHARED = {
    "edit": ("cut", "trim", "join", "gain", "fade", "mask", "resample"),
    "import_export": ("import", "export", "repair"),
}
"""Modules of several commands; others have the name of their command."""

COMMANDS: Mapping[str, str] = {name: name for listed in GROUPED.values() for name in listed} | {
    name: module for module, listed in _SHARED.items() for name in listed
}
"""For each command, the module of its function `NAME_command`."""

FOLDERS: Mapping[str, tuple[str, str]] = {
    "calibrate": (
        "Calibrate",
        "Convert a recording to pressure (midair calibrate RECORDING), or measure a calibration with a subcommand.",
    ),
    "sweep": ("Research", "Solve many targets in parallel processes and report the error E."),
    "study": ("Research", "Plan, run and analyse a user study."),
    "serve": (
        "Reproduce",
        "Let other programs play: Unity, Max, TouchDesigner, scripts, over WebSocket or OSC, or the AdapTics Designer.",
    ),
}
"""Commands with subcommands: group and help."""


def summary_of(name: str) -> str:
    """First paragraph of a command's docstring, read from the source so that `midair --help` imports no command."""
    source = Path(__file__).with_name(f"{COMMANDS[name]}.py").read_text(encoding="utf-8")
    return " ".join(source.partition(f"def {name}_command(")[2].split('"""')[1].split("\n\n")[0].split())


def __getattr__(name: str) -> App:
    """Import a command and return its app, for names such as `solve_app`."""
    typed = name.removesuffix("_app")
    if typed == name or typed not in COMMANDS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = import_module(f"{__name__}.{COMMANDS[typed]}")
    defer_numpy_tools()
    return app_of_command(getattr(module, f"{typed}_command"), typed)
