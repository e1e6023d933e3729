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
from midair.cli.commands.loop import loop_command
from midair.cli.commands.paper import paper_command
from midair.cli.commands.record import record_command
from midair.cli.commands.solve_play import play_command, solve_command
from midair.cli.commands.stop import stop_command
from midair.cli.commands.study import study_app
from midair.cli.commands.sweep import sweep_app

COMMANDS: Mapping[str, Callable[..., Any]] = {
    "budget": budget_command,
    "compare": compare_command,
    "cut": cut_command,
    "demo": demo_command,
    "doctor": doctor_command,
    "export": export_command,
    "exposure": exposure_command,
    "gain": gain_command,
    "identify": identify_command,
    "import": import_command,
    "info": info_command,
    "join": join_command,
    "loop": loop_command,
    "mask": mask_command,
    "paper": paper_command,
    "mend": mend_command,
    "play": play_command,
    "record": record_command,
    "repair": repair_command,
    "resample": resample_command,
    "solve": solve_command,
    "stop": stop_command,
    "trim": trim_command,
}

GROUPS: tuple[App, ...] = (calibrate_app, study_app, sweep_app)
"""Commands that have commands below them."""

__all__ = ["COMMANDS", "GROUPS"]
