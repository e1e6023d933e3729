"""The command line: what a person types.

Each file adds its commands to the one app in app.py.
"""

from midair.cli.app import app, main, run
from midair.cli.commands import budget, compare, demo, doctor, edit, exposure, identify, info, loop, paper, record, stop
from midair.cli.commands import import_export as recordings
from midair.cli.commands import solve_play as reproduction
from midair.cli.commands.calibrate import apply as calibrate
from midair.cli.commands.calibrate import measure as calibrate_measure
from midair.cli.commands.study import study
from midair.cli.commands.sweep import patterns as sweep
from midair.cli.commands.sweep import recordings as sweep_recordings
from midair.cli.commands.sweep import report as sweep_report

app.command(calibrate.app)
app.command(study.app)
app.command(sweep.app)

__all__ = [
    "app",
    "budget",
    "calibrate",
    "calibrate_measure",
    "compare",
    "demo",
    "doctor",
    "edit",
    "exposure",
    "identify",
    "info",
    "loop",
    "main",
    "paper",
    "record",
    "recordings",
    "reproduction",
    "run",
    "stop",
    "study",
    "sweep",
    "sweep_recordings",
    "sweep_report",
]
