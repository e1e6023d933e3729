"""The commands around a calibration: `midair calibrate` and those below it."""

from cyclopts import App

from midair.cli.commands.calibrate.apply import apply_command, show_command
from midair.cli.commands.calibrate.measure import beam_command, bench_command, measure_command, tone_command

calibrate_app = App(
    name="calibrate",
    help="Turn a recording into pressure: midair calibrate RECORDING. What a calibration is measured with: against a "
    "reference (measure), by a tone of known level (tone), by a focused beam (beam).",
)
calibrate_app.default(apply_command)
calibrate_app.command(show_command, name="show")
calibrate_app.command(measure_command, name="measure")
calibrate_app.command(tone_command, name="tone")
calibrate_app.command(beam_command, name="beam")
calibrate_app.command(bench_command, name="bench")

__all__ = ["calibrate_app"]
