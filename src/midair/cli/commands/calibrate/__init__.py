"""The command `midair calibrate` and its subcommands."""

from cyclopts import App

from midair.cli.help_text import add_command, epilogue, examples_of

from .measure import apply_command, beam_command, bench_command, measure_command, show_command
from .measure_array import array_command, tracker_command

calibrate_app = App(name="calibrate", help_epilogue=epilogue(examples_of(apply_command)))
calibrate_app.default(apply_command)
add_command(calibrate_app, show_command, "show")
add_command(calibrate_app, measure_command, "measure")
add_command(calibrate_app, beam_command, "beam")
add_command(calibrate_app, array_command, "array")
add_command(calibrate_app, tracker_command, "tracker")
add_command(calibrate_app, bench_command, "bench")
