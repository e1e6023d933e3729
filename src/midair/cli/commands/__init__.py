"""The commands, a file each; none imports another. `COMMANDS` has them by the names that people type."""

from collections.abc import Callable, Mapping
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

SILENT = frozenset(
    ("import", "mend", "repair", "info", "cut", "trim", "join", "gain", "mask", "resample", "export")
) | {"exposure", "compare", "doctor"}
"""Commands without bars, meters and questions of their own: a moving line says so when they take long."""

__all__ = ["COMMANDS", "FOLDERS", "SILENT"]
