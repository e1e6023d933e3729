"""The command `midair study` and its subcommands."""

from cyclopts import App

from midair.cli.commands.study.numbers import paper_command, power_command
from midair.cli.commands.study.planning import new_command, plan_command, withdraw_command
from midair.cli.commands.study.running import run_command
from midair.cli.commands.study.study import analyse_command, export_command, verify_command
from midair.cli.terminal import epilogue, offer

study_app = App(
    name="study",
    help_epilogue=epilogue(("midair study new touch --participants 3",)),
)
offer(study_app, new_command, "new")
offer(study_app, plan_command, "plan")
offer(study_app, run_command, "run")
offer(study_app, analyse_command, "analyse")
offer(study_app, export_command, "export")
offer(study_app, verify_command, "verify")
offer(study_app, withdraw_command, "withdraw")
offer(study_app, power_command, "power")
offer(study_app, paper_command, "paper")

__all__ = ["study_app"]
