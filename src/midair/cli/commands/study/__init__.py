"""The command `midair study` and its subcommands."""

from cyclopts import App

from midair.cli.help_text import add_command, epilogue

from .planning import new_command, power_command, withdraw_command
from .running import run_command
from .study import analyse_command, export_command

study_app = App(name="study", help_epilogue=epilogue(("midair study new touch --participants 3",)))
add_command(study_app, new_command, "new")
add_command(study_app, run_command, "run")
add_command(study_app, analyse_command, "analyse")
add_command(study_app, export_command, "export")
add_command(study_app, withdraw_command, "withdraw")
add_command(study_app, power_command, "power")
