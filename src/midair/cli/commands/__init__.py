"""The commands, a file each; none imports another. `COMMANDS` has them by the names that people type."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cyclopts import App

from midair.cli.commands.budget import budget_command
from midair.cli.commands.calibrate import calibrate_app
from midair.cli.commands.compare import compare_command
from midair.cli.commands.demo import demo_command
from midair.cli.commands.doctor import doctor_command
from midair.cli.commands.edit import (
    cut_command,
    gain_command,
    join_command,
    mask_command,
    resample_command,
    trim_command,
)
from midair.cli.commands.exposure import exposure_command
from midair.cli.commands.identify import identify_command
from midair.cli.commands.import_export import export_command, import_command, mend_command, repair_command
from midair.cli.commands.info import info_command
from midair.cli.commands.live import live_command
from midair.cli.commands.loop import loop_command
from midair.cli.commands.paper import paper_command
from midair.cli.commands.record import record_command
from midair.cli.commands.show import show_command
from midair.cli.commands.solve_play import play_command, solve_command
from midair.cli.commands.stop import stop_command
from midair.cli.commands.studio import studio_command
from midair.cli.commands.study import study_app
from midair.cli.commands.sweep import sweep_app

COMMANDS: Mapping[str, tuple[str, Callable[..., Any]]] = {
    "demo": ("Begin", demo_command),
    "studio": ("Begin", studio_command),
    "doctor": ("Begin", doctor_command),
    "record": ("Record", record_command),
    "import": ("Record", import_command),
    "mend": ("Record", mend_command),
    "identify": ("Record", identify_command),
    "repair": ("Record", repair_command),
    "info": ("Edit", info_command),
    "show": ("Edit", show_command),
    "cut": ("Edit", cut_command),
    "trim": ("Edit", trim_command),
    "join": ("Edit", join_command),
    "gain": ("Edit", gain_command),
    "mask": ("Edit", mask_command),
    "resample": ("Edit", resample_command),
    "export": ("Edit", export_command),
    "solve": ("Reproduce", solve_command),
    "exposure": ("Reproduce", exposure_command),
    "play": ("Reproduce", play_command),
    "stop": ("Reproduce", stop_command),
    "live": ("Reproduce", live_command),
    "loop": ("Reproduce", loop_command),
    "compare": ("Judge", compare_command),
    "budget": ("Judge", budget_command),
    "paper": ("Research", paper_command),
}
"""A group of `terminal.GROUPS` and a command, by the name that people type, in the order of the work."""

FOLDERS: Mapping[str, tuple[str, App]] = {
    "calibrate": ("Calibrate", calibrate_app),
    "sweep": ("Research", sweep_app),
    "study": ("Research", study_app),
}
"""Commands that have commands below them."""

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
"""Commands without bars, meters and questions of their own, and how often each goes through what it works on: a bar
with the time left shows when they take long."""


def command_of(tokens: Sequence[str]) -> str:
    """The command of a line, with the folder that it is in: "cut", "calibrate", "calibrate measure"."""
    return next((name for name in (" ".join(tokens[:2]), *tokens[:1]) if name in PASSES), "")


__all__ = ["COMMANDS", "FOLDERS", "PASSES", "command_of"]
