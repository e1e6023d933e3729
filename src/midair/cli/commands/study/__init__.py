"""The commands around a study: `midair study` and those below it."""

from cyclopts import App

from midair.cli.commands.study.numbers import paper_command, power_command
from midair.cli.commands.study.study import analyse_command, export_command, new_command, run_command

study_app = App(name="study", help="Plan a study on people, run it one participant at a time, and analyse it.")
study_app.command(power_command, name="power")
study_app.command(paper_command, name="paper")
study_app.command(new_command, name="new")
study_app.command(run_command, name="run")
study_app.command(analyse_command, name="analyse")
study_app.command(export_command, name="export")

__all__ = ["study_app"]
