"""The command `midair sweep` and its subcommands."""

from cyclopts import App

from midair.cli.help_text import add_command, epilogue

from .patterns import patterns_command
from .recordings import recordings_command
from .report import report_command

sweep_app = App(
    name="sweep", help_epilogue=epilogue(("midair sweep patterns patterns.zarr --count 1000 --strength 0.1",))
)
add_command(sweep_app, patterns_command, "patterns")
add_command(sweep_app, recordings_command, "recordings")
add_command(sweep_app, report_command, "report")
