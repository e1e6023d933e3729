"""All commands by name, one module each; a module is imported only when its command or its help is called."""

import re
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path

from cyclopts import App

from midair.cli.help_text import app_of_command

COMMANDS: Mapping[str, tuple[str, str]] = {
    "demo": ("Get started", "demo"),
    "studio": ("Get started", "studio"),
    "doctor": ("Get started", "doctor"),
    "record": ("Record", "record"),
    "import": ("Record", "import_export"),
    "mend": ("Record", "import_export"),
    "identify": ("Record", "identify"),
    "repair": ("Record", "import_export"),
    "info": ("Edit", "info"),
    "show": ("Edit", "show"),
    "cut": ("Edit", "edit"),
    "trim": ("Edit", "edit"),
    "join": ("Edit", "edit"),
    "gain": ("Edit", "edit"),
    "fade": ("Edit", "edit"),
    "mask": ("Edit", "edit"),
    "resample": ("Edit", "edit"),
    "export": ("Edit", "import_export"),
    "draw": ("Reproduce", "draw"),
    "solve": ("Reproduce", "solve_play"),
    "exposure": ("Reproduce", "exposure"),
    "play": ("Reproduce", "solve_play"),
    "stop": ("Reproduce", "stop"),
    "live": ("Reproduce", "live"),
    "loop": ("Reproduce", "loop"),
    "compare": ("Evaluate", "compare"),
    "budget": ("Evaluate", "budget"),
    "paper": ("Research", "paper"),
}
"""For each command: its group in `help_text.GROUPS`, and the module of its function `NAME_command`."""

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
    "log": ("Reproduce", "Export the log of all drives that were played, with the dose of sound."),
}
"""Commands with subcommands: group and help."""

PASSES: Mapping[str, int] = {
    "import": 4,
    "mend": 4,
    "repair": 6,
    "info": 2,
    "show": 3,
    "cut": 5,
    "trim": 8,
    "join": 7,
    "gain": 5,
    "fade": 7,
    "mask": 5,
    "resample": 5,
    "export": 2,
    "exposure": 3,
    "compare": 10,
    "doctor": 1,
    "calibrate": 8,
    "calibrate measure": 1,
    "calibrate tone": 1,
    "study plan": 1,
    "study power": 1,
    "study paper": 1,
    "study analyse": 1,
    "sweep report": 1,
}
"""For commands without their own progress bar: how many times they go through their data, which `busy_bar` needs."""


def command_of(tokens: Sequence[str]) -> str:
    """Key of `PASSES` that a command line names, such as "cut" or "calibrate measure"; "" if none."""
    return next((name for name in (" ".join(tokens[:2]), *tokens[:1]) if name in PASSES), "")


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
