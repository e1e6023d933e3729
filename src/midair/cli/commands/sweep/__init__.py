"""The commands around a sweep: `midair sweep` and those below it."""

from cyclopts import App

from midair.cli.commands.sweep.patterns import patterns_command
from midair.cli.commands.sweep.recordings import recordings_command
from midair.cli.commands.sweep.report import report_command

sweep_app = App(
    name="sweep",
    help="Solve many targets on many processes, and report E: all binary patterns of the paper's simulation (5.1) over "
    "strengths and heights, or recordings under many settings.",
)
sweep_app.command(patterns_command, name="patterns")
sweep_app.command(recordings_command, name="recordings")
sweep_app.command(report_command, name="report")

__all__ = ["sweep_app"]
