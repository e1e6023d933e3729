"""The command line: what a person types.

Each file adds its commands to the one app in app.py.
"""

from midair.cli import (
    budget,
    calibrate,
    calibrate_measure,
    compare,
    demo,
    doctor,
    edit,
    exposure,
    identify,
    info,
    loop,
    paper,
    record,
    recordings,
    reproduction,
    stop,
    study,
    sweep,
    sweep_recordings,
    sweep_report,
)
from midair.cli.app import app, main, run

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
